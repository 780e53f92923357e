"""Convert the bits of an I/NAV page to the symbols on E1-B, and back [OS-ICD, 4.1.4].

A page has two halves of 120 bits. Each half passes through the convolutional code of rate 1/2 and constraint length 7
(171 and 133 octal, the second output inverted). A block interleaver of 30 columns and 8 rows follows. Ten
synchronisation symbols precede each half, so a half takes 250 symbols in 1 s. The six tail bits return the encoder to
state 0, so each half is decoded independently of the other half.

Soft symbols are positive for a 0 and negative for a 1, as E1-B is modulated. The scale of soft symbols does not matter.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8

from vestige.navigation.inav.coding.viterbi_kernel import decode_terminated
from vestige.navigation.inav.page import PAGE_BITS, PAGE_BYTES

SYNC_PATTERN = (0, 1, 0, 1, 1, 0, 0, 0, 0, 0)  # [OS-ICD, 4.3.2.1]
HALF_BITS = PAGE_BITS // 2
CODED_SYMBOLS = 2 * HALF_BITS
HALF_SYMBOLS = len(SYNC_PATTERN) + CODED_SYMBOLS
PAGE_SYMBOLS = 2 * HALF_SYMBOLS

_GENERATORS = (0o171, 0o133)  # the most significant bit is the tap of the newest bit [OS-ICD, 4.1.4.1]
_MEMORY = 6
_ROWS = 8  # rows of the interleaver, which is written column by column and read row by row [OS-ICD, 4.1.4.2]


def _register_signs() -> Float[np.ndarray, "128 2"]:
    """Return the two symbols (±1) for each content of the encoder's register. The second symbol is inverted.

    The newest bit of the register is the most significant bit.
    """
    register = np.arange(1 << (_MEMORY + 1))
    parity = [np.bitwise_count(register & generator) & 1 for generator in _GENERATORS]
    symbols = np.stack((parity[0], 1 - parity[1]), axis=1)
    return (1 - 2 * symbols.astype(np.int8)).astype(np.float32)


_SIGNS = _register_signs()


def interleaved(symbols: UInt8[np.ndarray, "*n k"]) -> UInt8[np.ndarray, "*n k"]:
    """Return the symbols of each block in the order of transmission.

    A block is the 240 symbols of an I/NAV half-page or the 984 symbols of a C/NAV page.

    Parameters
    ----------
    symbols
        Symbols in the order of the encoder.
    """
    return symbols.reshape(*symbols.shape[:-1], -1, _ROWS).swapaxes(-1, -2).reshape(symbols.shape)


def deinterleaved(symbols: Float[np.ndarray, "*n k"]) -> Float[np.ndarray, "*n k"]:
    """Return the soft symbols of each block in the order of the encoder. The function is the inverse of `interleaved`.

    Parameters
    ----------
    symbols
        Symbols in the order of transmission.
    """
    return symbols.reshape(*symbols.shape[:-1], _ROWS, -1).swapaxes(-1, -2).reshape(symbols.shape)


def convolved(bits: UInt8[np.ndarray, "*n bits"]) -> UInt8[np.ndarray, "*n symbols"]:
    """Return the convolutional code symbols of each block of bits, two symbols for each bit.

    Parameters
    ----------
    bits
        Bits, 0 or 1. The encoder starts in state 0.
    """
    padded = np.concatenate((np.zeros((*bits.shape[:-1], _MEMORY), np.uint8), bits), axis=-1)
    outputs = []
    for generator in _GENERATORS:
        taps = [delay for delay in range(_MEMORY + 1) if generator >> (_MEMORY - delay) & 1]
        shifted = [padded[..., _MEMORY - delay : padded.shape[-1] - delay] for delay in taps]
        outputs.append(np.bitwise_xor.reduce(shifted))
    outputs[1] = outputs[1] ^ np.uint8(1)
    return np.stack(outputs, axis=-1).reshape(*bits.shape[:-1], 2 * bits.shape[-1])


def page_symbols(data: bytes) -> UInt8[np.ndarray, " 500"]:
    """Return the 500 symbols of a page in the order of transmission, 250 symbols a second.

    Parameters
    ----------
    data
        The 30 bytes of the page, with both tails zero.

    Returns
    -------
    array
        Symbols, 0 or 1: synchronisation pattern, even half, synchronisation pattern, odd half.

    Raises
    ------
    ValueError
        If the page does not have 30 bytes.

    Examples
    --------
    >>> from vestige.navigation.inav.page import encode_page
    >>> page = encode_page(0)
    >>> page_from_symbols(1.0 - 2.0 * page_symbols(page)) == page
    True
    """
    if len(data) != PAGE_BYTES:
        raise ValueError(f"{len(data)} bytes in a page, expected {PAGE_BYTES}")
    halves = np.unpackbits(np.frombuffer(data, np.uint8)).reshape(2, HALF_BITS)
    sync = np.broadcast_to(np.array(SYNC_PATTERN, np.uint8), (2, len(SYNC_PATTERN)))
    return np.concatenate((sync, interleaved(convolved(halves))), axis=1).reshape(PAGE_SYMBOLS)


def decoded_halves(soft: Float[np.ndarray, "n 240"]) -> UInt8[np.ndarray, "n 120"]:
    """Return the most likely bits of each half-page by the Viterbi algorithm.

    Parameters
    ----------
    soft
        The 240 symbols behind the synchronisation pattern in the order of transmission, positive for a 0 and negative
        for a 1, of any scale. Hard decisions are ±1. A symbol that was not received is 0.

    Returns
    -------
    array
        Bits, 0 or 1, including the six tail bits, which are always 0.

    Raises
    ------
    ValueError
        If a symbol is not finite.
    """
    if not np.isfinite(soft).all():
        raise ValueError("a soft symbol is not finite")
    bits = np.empty((soft.shape[0], HALF_BITS), np.uint8)
    decode_terminated(np.ascontiguousarray(deinterleaved(soft), dtype=np.float32), _SIGNS, bits)
    return bits


def page_from_symbols(soft: Float[np.ndarray, " 500"]) -> bytes:
    """Return the 30 bytes of the page in 500 soft symbols.

    The page's checksum shows whether the decoding succeeded. The tracking loop has an ambiguity of half a cycle, so the
    sign of the symbols is taken from the synchronisation pattern.

    Parameters
    ----------
    soft
        Soft symbols from the first synchronisation symbol of the even half on. A positive symbol may mean 0 or 1,
        because the sign of all symbols is unknown.

    Raises
    ------
    ValueError
        If a symbol is not finite.
    """
    halves = soft.reshape(2, HALF_SYMBOLS)
    expected = 1.0 - 2.0 * np.array(SYNC_PATTERN, np.float64)
    sign = -1.0 if float((halves[:, : len(SYNC_PATTERN)] @ expected).sum()) < 0 else 1.0
    return np.packbits(decoded_halves(sign * halves[:, len(SYNC_PATTERN) :])).tobytes()
