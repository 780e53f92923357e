"""The fields of the words against their places as published, counted from 1, and the word as text of bits."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from osnma_builder import make_word
from vestige.errors import VestigeError
from vestige.navigation.inav.word_table import WORD_LAYOUTS, word_layout
from vestige.navigation.inav.words import InavWord, time_in_word, word_bits
from vestige.time import GalileoTime

TIME = GalileoTime(1251, 277201)
A, S, U = "angle", "signed", "unsigned"

# word type -> (field, first bit counted from 1, length, kind, exponent of the last bit or its value)
PUBLISHED = {
    0: [("time_set", 7, 2, U, 1.0), ("week", 97, 12, U, 1.0), ("tow_s", 109, 20, U, 1.0)],
    1: [
        ("iod_nav", 7, 10, U, 1.0),
        ("toe_s", 17, 14, U, 60.0),
        ("m0_rad", 31, 32, A, -31),
        ("eccentricity", 63, 32, U, -33),
        ("sqrt_a", 95, 32, U, -19),
    ],
    2: [
        ("iod_nav", 7, 10, U, 1.0),
        ("omega0_rad", 17, 32, A, -31),
        ("i0_rad", 49, 32, A, -31),
        ("omega_rad", 81, 32, A, -31),
        ("i_dot_radps", 113, 14, A, -43),
    ],
    3: [
        ("iod_nav", 7, 10, U, 1.0),
        ("omega_dot_radps", 17, 24, A, -43),
        ("delta_n_radps", 41, 16, A, -43),
        ("cuc_rad", 57, 16, S, -29),
        ("cus_rad", 73, 16, S, -29),
        ("crc_m", 89, 16, S, -5),
        ("crs_m", 105, 16, S, -5),
        ("sisa_index", 121, 8, U, 1.0),
    ],
    4: [
        ("iod_nav", 7, 10, U, 1.0),
        ("svid", 17, 6, U, 1.0),
        ("cic_rad", 23, 16, S, -29),
        ("cis_rad", 39, 16, S, -29),
        ("toc_s", 55, 14, U, 60.0),
        ("af0_s", 69, 31, S, -34),
        ("af1", 100, 21, S, -46),
        ("af2_per_s", 121, 6, S, -59),
    ],
    5: [
        ("ai0_sfu", 7, 11, U, -2),
        ("ai1_sfu_per_deg", 18, 11, S, -8),
        ("ai2_sfu_per_deg2", 29, 14, S, -15),
        ("ionosphere_disturbance", 43, 5, U, 1.0),
        ("bgd_e1_e5a_s", 48, 10, S, -32),
        ("bgd_e1_e5b_s", 58, 10, S, -32),
        ("e5b_health", 68, 2, U, 1.0),
        ("e1b_health", 70, 2, U, 1.0),
        ("e5b_data_invalid", 72, 1, U, 1.0),
        ("e1b_data_invalid", 73, 1, U, 1.0),
        ("week", 74, 12, U, 1.0),
        ("tow_s", 86, 20, U, 1.0),
    ],
    6: [
        ("a0_s", 7, 32, S, -30),
        ("a1", 39, 24, S, -50),
        ("leap_seconds", 63, 8, S, 1.0),
        ("t0t_s", 71, 8, U, 3600.0),
        ("utc_week", 79, 8, U, 1.0),
        ("leap_week", 87, 8, U, 1.0),
        ("leap_day", 95, 3, U, 1.0),
        ("leap_seconds_after", 98, 8, S, 1.0),
        ("tow_s", 106, 20, U, 1.0),
    ],
    10: [
        ("a0g_s", 87, 16, S, -35),
        ("a1g", 103, 12, S, -51),
        ("t0g_s", 115, 8, U, 3600.0),
        ("ggto_week", 123, 6, U, 1.0),
    ],
    16: [
        ("delta_a_m", 7, 5, S, 256.0),
        ("ex", 12, 13, S, -22),
        ("ey", 25, 13, S, -22),
        ("delta_i0_rad", 38, 17, A, -22),
        ("omega0_rad", 55, 23, A, -22),
        ("lambda0_rad", 78, 23, A, -22),
        ("af0_s", 101, 22, S, -26),
        ("af1", 123, 6, S, -35),
    ],
    17: [("first_octet", 7, 8, U, 1.0), ("iod_nav_low", 15, 2, U, 1.0), ("octets", 17, 112, U, 1.0)],
}


@pytest.mark.parametrize("kind", PUBLISHED)
@given(bits=st.integers(0, 2**122 - 1))
def test_fields_are_where_they_are_published(kind: int, bits: int) -> None:
    word = kind << 122 | bits
    text, decoded = f"{word:0128b}", InavWord.decode(word)
    for name, first, length, number, step in PUBLISHED[kind]:
        raw = int(text[first - 1 : first - 1 + length], 2)
        if number in (A, S) and raw >= 1 << (length - 1):
            raw -= 1 << length
        value = (2.0**step if isinstance(step, int) else step) * (math.pi if number == A else 1.0)
        assert decoded.raw[name] == raw, name
        assert decoded.value(name) == pytest.approx(raw * value, rel=1e-14), name
        assert decoded.values[name] == decoded.value(name)


@settings(max_examples=25)
@given(st.integers(0, 2**128 - 1))
def test_a_decoded_word_encodes_to_the_same_bits(bits: int) -> None:
    for kind in range(64):
        word = kind << 122 | bits & ((1 << 122) - 1)
        decoded = InavWord.decode(word)
        assert decoded.encode() == word
        assert InavWord.from_values(kind, decoded.values) == decoded


def test_every_type_of_the_message_is_in_the_table() -> None:
    assert sorted(WORD_LAYOUTS) == [*range(11), 16, 17, 18, 19, 20]
    with pytest.raises(ValueError, match="word type 64"):
        word_layout(64)


def test_a_value_that_does_not_fit_names_word_and_field() -> None:
    values = {"iod_nav": 3, "toe_s": 0, "m0_rad": 0, "eccentricity": 0, "sqrt_a": 8192.0}
    with pytest.raises(VestigeError, match=r"^I/NAV word 1: sqrt_a is 8192 m\^0.5; its 32 bits"):
        InavWord.from_values(1, values)
    with pytest.raises(ValueError, match="word 1 has no field 'af0_s'"):
        InavWord.from_values(1, {"af0_s": 0.0})


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
