"""Pack chips of ±1 as bits, 32 chips in a word, for ciphers and compiled loops.

Chip i is bit 31 − (i mod 32) of word 1 + ⌊i / 32⌋, where all numbers count from 0. A set bit means −1. The word before
the first chip and three words after the last chip are 0, so that loops may read beyond both ends of the chips.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int8, UInt32

PAD = 32  # number of zero bits before the first chip; at least 32 zero bits follow the last chip


def packed_chips(chips: Int8[np.ndarray, " n"]) -> UInt32[np.ndarray, " n_words"]:
    """Return chips of ±1 as packed bits."""
    return packed_bits(np.packbits(chips < 0).tobytes(), chips.size)


def packed_bits(bits: bytes, n_chips: int, skip: int = 0) -> UInt32[np.ndarray, " n_words"]:
    """Return `n_chips` packed chips from the bits that follow the first `skip` bits.

    The most significant bit of each byte comes first.

    The function raises `ValueError` if `n_chips` is negative, or if `bits` has fewer than `skip` + `n_chips` bits.
    """
    if not (n_chips >= 0 and skip + n_chips <= 8 * len(bits)):
        raise ValueError(f"{len(bits)} bytes do not hold {skip + n_chips} chips")
    begin, shift = divmod(skip, 8)
    n_words = n_chips // 32 + 1  # at least one bit follows the chips
    stream = bits[begin : begin + 4 * (n_words + 1)].ljust(4 * (n_words + 1), b"\0")
    words = np.zeros(n_words + 4, np.uint32)
    inside = words[1 : 1 + n_words]
    inside[:] = np.frombuffer(stream, ">u4", n_words)
    if shift:
        inside <<= np.uint32(shift)
        inside |= np.frombuffer(stream, ">u4", n_words, offset=4) >> np.uint32(32 - shift)
    inside[-1] &= np.uint32(0xFFFFFFFF ^ (0xFFFFFFFF >> n_chips % 32))
    return words


def bits_of_packed(packed: UInt32[np.ndarray, " n_words"], n_bytes: int) -> bytes:
    """Return the first `n_bytes` bytes of packed chips, the most significant bit first; bits after the chips are 0."""
    return packed[1:].astype(">u4").tobytes()[:n_bytes].ljust(n_bytes, b"\0")


def unpacked_chips(packed: UInt32[np.ndarray, " n_words"], n_chips: int) -> Int8[np.ndarray, " n_chips"]:
    """Return the first `n_chips` packed chips as ±1."""
    bits = np.unpackbits(packed[1:].astype(">u4").view(np.uint8), count=n_chips).view(np.int8)
    return np.int8(1) - bits - bits  # in numpy, an int8 subtraction is ten times as fast as a shift
