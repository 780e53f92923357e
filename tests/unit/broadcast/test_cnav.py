from __future__ import annotations

import numpy as np
import pytest

from vestige.broadcast.cnav import CNAV_SYNC_PATTERN, DUMMY_HEADER, cnav_page_symbols, cnav_symbols, dummy_page
from vestige.navigation.inav.crc import crc_24q
from vestige.time import GalileoTime


def test_a_dummy_page_holds_header_message_and_checksum() -> None:
    bits = dummy_page(0x123456789 << 300 | 5)
    text = int("".join(map(str, bits)), 2)
    assert bits.size == 492
    assert text & 0x3F == 0
    body, checksum = text >> 30, text >> 6 & 0xFFFFFF
    assert checksum == crc_24q(body.to_bytes(58, "big"))
    assert body >> 424 == DUMMY_HEADER
    assert body & (1 << 424) - 1 == 0x123456789 << 300 | 5
    with pytest.raises(ValueError, match="424 bits"):
        dummy_page(1 << 424)


def test_the_interleaver_has_123_columns_and_8_rows() -> None:
    """Symbols that follow each other in the code are 123 symbols apart on the air."""
    first, second = dummy_page(0), dummy_page(1 << 423)
    changed = np.flatnonzero(cnav_page_symbols(first)[16:] != cnav_page_symbols(second)[16:])
    assert cnav_page_symbols(first)[:16].tolist() == list(CNAV_SYNC_PATTERN)
    # the message's first bit is bit 38 of the page, so symbols 76 and 77 change first, in column 9, rows 4 and 5
    assert {4 * 123 + 9, 5 * 123 + 9} <= set(changed.tolist())


def test_symbols_are_those_of_the_second_and_satellite() -> None:
    start = GalileoTime(1400, 100)
    symbols = cnav_symbols(1, 7, start)
    index = np.arange(-1500, 3200)
    found = symbols(index)
    assert set(np.unique(found)) == {-1, 1}
    for second in range(-1, 3):
        sync = found[1500 + 1000 * second : 1516 + 1000 * second]
        assert ((1 - sync) // 2).tolist() == list(CNAV_SYNC_PATTERN)
    assert np.array_equal(cnav_symbols(1, 7, GalileoTime(1400, 101))(index[:2000] - 1000), found[:2000])
    assert not np.array_equal(cnav_symbols(1, 8, start)(index), found)
    assert symbols(index[:0]).size == 0
