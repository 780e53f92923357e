from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from osnma_builder import crc_24q, make_page
from vestige.navigation.inav.crc import crc_24q as fast_crc
from vestige.navigation.inav.page import InavPage, encode_page, page_checksum, page_ssp
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


@given(st.integers(0, 2**128 - 1), st.binary(min_size=5, max_size=5), st.booleans())
def test_an_encoded_page_is_that_of_the_bits_as_text(word: int, osnma: bytes, alert: bool) -> None:
    made = encode_page(word, osnma=osnma, sar=0, spare=0, ssp=0, alert=alert)
    assert made == make_page(2, TIME, word, osnma, alert=alert).data


def test_fields_of_the_official_page() -> None:
    made = page(OFFICIAL)
    assert (made.field("sar"), made.field("spare"), made.field("ssp"), made.field("tail_1")) == (0x2AAAAA, 1, 0x04, 0)
    assert encode_page(made.word, osnma=made.osnma, ssp=page_ssp(TIME)) == OFFICIAL


def test_patterns_follow_the_second() -> None:
    patterns = [
        page_ssp(GalileoTime(1251, 604_797 + 2 * k) if k < 2 else GalileoTime(1252, 2 * k - 3)) for k in range(5)
    ]
    assert patterns == [0x2B, 0x2F, 0x04, 0x2B, 0x2F]


@pytest.mark.parametrize("time", [GalileoTime(1251, 2), GalileoTime(1251, 1, 0.5)])
def test_no_page_starts_there(time: GalileoTime) -> None:
    with pytest.raises(ValueError, match="no I/NAV page starts at"):
        page_ssp(time)


@pytest.mark.parametrize("wrong", [{"osnma": bytes(4)}, {"sar": 1 << 22}, {"ssp": 256}])
def test_fields_that_do_not_fit_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="expected"):
        encode_page(0, **wrong)  # type: ignore[arg-type]
