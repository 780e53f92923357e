from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from osnma_builder import crc_24q, make_page, make_word
from vestige.navigation.inav.crc import crc_24q as fast_crc
from vestige.navigation.inav.page import InavPage, page_checksum
from vestige.navigation.inav.words import time_in_word, word_bits
from vestige.time import GalileoTime

TIME = GalileoTime(1251, 277201)
# First page of E02 in the official OSNMA test vector, configuration 1.
OFFICIAL = bytes.fromhex("021333662A4249DD4A6EBB4CAE1900BD2A5C9E8497BA6AAAAA6A9778C100")
COVERED = [*range(114), *range(120, 226)]  # checksum included
FREE = [*range(114, 120), *range(226, 240)]


def page(data: bytes) -> InavPage:
    return InavPage(svid=2, time=TIME, data=data)


def flipped(data: bytes, bit: int) -> bytes:
    return (int.from_bytes(data, "big") ^ 1 << (8 * len(data) - 1 - bit)).to_bytes(len(data), "big")


def test_official_page() -> None:
    assert page(OFFICIAL).crc_ok
    assert page(OFFICIAL).word >> 122 == 2
    assert not page(OFFICIAL).is_alert


@given(st.binary(max_size=40))
def test_crc_equals_division_bit_by_bit(data: bytes) -> None:
    bits = "".join(f"{byte:08b}" for byte in data)
    assert fast_crc(data) == crc_24q(bits)


def test_every_single_bit_error_is_seen_where_the_checksum_covers() -> None:
    assert not any(page(flipped(OFFICIAL, bit)).crc_ok for bit in COVERED)
    assert all(page(flipped(OFFICIAL, bit)).crc_ok for bit in FREE)


@given(st.integers(0, 2**128 - 1), st.binary(min_size=5, max_size=5), st.booleans())
def test_a_page_gives_back_what_was_put_into_it(word: int, osnma: bytes, alert: bool) -> None:
    made = make_page(2, TIME, word, osnma, alert=alert)
    assert made.crc_ok
    assert (made.word, made.osnma, made.is_alert) == (word, osnma, alert)


def test_two_even_halves_are_no_page() -> None:
    odd_bit_cleared = flipped(OFFICIAL, 120)
    checksum = page_checksum(odd_bit_cleared)
    bits = int.from_bytes(odd_bit_cleared, "big") & ~(0xFFFFFF << 14) | checksum << 14
    assert not page(bits.to_bytes(30, "big")).crc_ok


@pytest.mark.parametrize(("svid", "data"), [(0, bytes(30)), (37, bytes(30)), (1, bytes(29))])
def test_impossible_pages(svid: int, data: bytes) -> None:
    with pytest.raises(ValueError, match="not an I/NAV page"):
        InavPage(svid=svid, time=TIME, data=data)


@pytest.mark.parametrize(
    ("kind", "expected"), [(0, (1251, 277201)), (5, (1251, 277201)), (6, (None, 277201)), (1, None)]
)
def test_time_in_words(kind: int, expected: tuple[int | None, int] | None) -> None:
    assert time_in_word(make_word(kind, 3, TIME, issue=9)) == expected


def test_word_0_without_time() -> None:
    word = make_word(0, 3, TIME, issue=9) & ~(3 << 120)
    assert time_in_word(word) is None


def test_word_bits_counts_from_the_first_bit_sent() -> None:
    assert word_bits(0b101 << 125, 0, 3) == 0b101
    assert word_bits(0b11, 126, 2) == 0b11
