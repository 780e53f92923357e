from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.errors import VestigeError
from vestige.navigation.inav.bit_fields import BitField, BitLayout

ANGLE = BitField(name="m0_rad", start=0, length=16, signed=True, scale=2.0**-15 * math.pi, unit="rad")
LENGTH = BitField(name="crc_m", start=16, length=8, signed=True, scale=0.25, unit="m")
COUNT = BitField(name="count", start=24, length=4)
SPARE = BitField(name="spare", start=28, length=4, fill=0b1010)
LAYOUT = BitLayout(32, (ANGLE, LENGTH, COUNT, SPARE))


@given(st.integers(0, 2**32 - 1))
def test_what_was_unpacked_packs_to_the_same_bits(bits: int) -> None:
    raw = LAYOUT.unpack(bits)
    assert LAYOUT.pack(raw) == bits
    assert [raw["count"], raw["spare"]] == [int(f"{bits:032b}"[24:28], 2), int(f"{bits:032b}"[28:], 2)]


def test_signed_fields_are_twos_complement() -> None:
    assert LAYOUT.read(0x8000_FF00, "m0_rad") == -(1 << 15)
    assert LAYOUT.read(0x8000_FF00, "crc_m") == -1
    assert LAYOUT.pack({"m0_rad": -1, "crc_m": -128, "count": 3}) == 0xFFFF_803A


@given(st.floats(-31.8, 31.6))
def test_a_value_is_rounded_to_the_nearest_step(value: float) -> None:
    assert abs(LENGTH.quantised(value) * 0.25 - value) <= 0.125


@given(st.floats(-50.0, 50.0))
def test_every_angle_fits_a_field_of_one_turn(angle: float) -> None:
    low, high = ANGLE.raw_range
    raw = ANGLE.quantised(angle)
    assert low <= raw <= high
    assert abs(math.remainder(raw * ANGLE.scale - angle, 2 * math.pi)) <= ANGLE.scale * 0.5001


@pytest.mark.parametrize("value", [32.0, -32.2, math.nan, math.inf])
def test_a_value_that_does_not_fit_is_one_line(value: float) -> None:
    with pytest.raises(VestigeError, match=r"^crc_m is .* m; its 8 bits in the message hold -32 to 31.75 m$"):
        LENGTH.quantised(value)


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        ({"m0_rad": 0, "crc_m": 128, "count": 0}, "crc_m is 128"),
        ({"m0_rad": 0, "crc_m": 0, "count": -1}, "count is -1"),
        ({"m0_rad": 0, "crc_m": 0}, "count is None"),
        ({"m0_rad": 0, "crc_m": 0, "count": 0, "more": 0}, "unknown fields"),
    ],
)
def test_wrong_raw_values_are_refused(raw: dict[str, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        LAYOUT.pack(raw)


@pytest.mark.parametrize("fields", [(ANGLE, COUNT, SPARE), (ANGLE, LENGTH, COUNT)])
def test_a_layout_has_no_gap_and_its_length(fields: tuple[BitField, ...]) -> None:
    with pytest.raises(ValueError, match="expected"):
        BitLayout(32, fields)
