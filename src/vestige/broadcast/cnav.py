"""Make C/NAV on E6-B: dummy pages of the High Accuracy Service [HAS-ICD, 3], one page a second.

| field | bits |
|---|---|
| reserved | 14 |
| HAS page header, `AF3BC3` for a dummy page | 24 |
| HAS message, here random bits | 424 |
| CRC-24Q over the fields above | 24 |
| tail | 6, zero |

The page passes through the convolutional code and the interleaver of I/NAV, here with 123 columns and 8 rows. Together
with 16 synchronisation symbols at the beginning, a page has 1000 symbols, one symbol in each period of the E6-B code. A
page begins at a whole second of GST.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from jaxtyping import Int8, Int64, UInt8

from vestige.navigation.inav.coding.channel_coding import convolved, interleaved
from vestige.navigation.inav.crc import crc_24q
from vestige.streams import stream_key
from vestige.time import GalileoTime

CNAV_SYNC_PATTERN = (1, 0, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 0, 0, 0, 0)  # [HAS-ICD, 3.1]
CNAV_PAGE_SYMBOLS = 1000
CNAV_PAGE_BITS = 492
DUMMY_HEADER = 0xAF3BC3  # [HAS-ICD, 3.2]
_RESERVED_BITS, _HEADER_BITS, _MESSAGE_BITS, _CRC_BITS = 14, 24, 424, 24
_PAGES_KEPT = 64


def dummy_page(message: int) -> UInt8[np.ndarray, " 492"]:
    """Return the bits of a dummy page, tail included.

    Parameters
    ----------
    message
        HAS message of 424 bits, as an integer.

    Raises
    ------
    ValueError
        If the message is negative or has more than 424 bits.
    """
    if not 0 <= message < 1 << _MESSAGE_BITS:
        raise ValueError(f"a HAS message has {_MESSAGE_BITS} bits, found {message.bit_length()}")
    body = DUMMY_HEADER << _MESSAGE_BITS | message
    checked = body.to_bytes((_RESERVED_BITS + _HEADER_BITS + _MESSAGE_BITS + 7) // 8, "big")
    page = (body << _CRC_BITS | crc_24q(checked)) << CNAV_PAGE_BITS - 486
    bits = np.unpackbits(np.frombuffer(page.to_bytes(62, "big"), np.uint8))
    return bits[-CNAV_PAGE_BITS:]


def cnav_page_symbols(bits: UInt8[np.ndarray, " 492"]) -> UInt8[np.ndarray, " 1000"]:
    """Return the symbols of a page in the order of transmission, 0 or 1."""
    return np.concatenate([np.array(CNAV_SYNC_PATTERN, np.uint8), interleaved(convolved(bits))])


def cnav_symbols(
    seed: int, svid: int, reference: GalileoTime
) -> Callable[[Int64[np.ndarray, " n"]], Int8[np.ndarray, " n"]]:
    """Return a function that gives the symbols of a satellite as ±1 by their number; logic 0 is +1.

    Parameters
    ----------
    seed, svid
        Seed and SVID from which the dummy messages follow. Every satellite and second has a different message.
    reference
        Whole second at which symbol 0 begins.

    In each call of the returned function the numbers must ascend.
    """

    @lru_cache(maxsize=_PAGES_KEPT)
    def page(second: int) -> Int8[np.ndarray, " 1000"]:
        message = int.from_bytes(stream_key(seed, "C/NAV", svid, second) * 2, "big") >> 512 - _MESSAGE_BITS
        return np.int8(1) - np.int8(2) * cnav_page_symbols(dummy_page(message)).astype(np.int8)

    def symbol(index: Int64[np.ndarray, " n"]) -> Int8[np.ndarray, " n"]:
        if not index.size:
            return np.empty(0, np.int8)
        number, place = np.divmod(index + reference.gst_seconds * CNAV_PAGE_SYMBOLS, CNAV_PAGE_SYMBOLS)
        first = int(number[0])
        return np.stack([page(one) for one in range(first, int(number[-1]) + 1)])[number - first, place]

    return symbol
