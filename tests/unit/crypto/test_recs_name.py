from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.crypto.recs.recs_name import (
    RecsName,
    deciseconds_of_week,
    format_time_code,
    parse_name,
    parse_time_code,
    time_of_deciseconds,
)
from vestige.errors import InputFileError
from vestige.time import GalileoTime

# Weeks 0 … 5163 end in 2098, before the two digits of the year are used a second time.
times = st.builds(time_of_deciseconds, st.integers(0, 5163), st.integers(0, 6_047_999))
flags = st.integers(0, 1)
common = {"start": times, "svid": st.integers(1, 36), "key_delay": flags, "random_offset": flags,
          "interface_version": st.integers(0, 255), "file_version": st.integers(0, 255)}  # fmt: skip
unitary = st.builds(RecsName, provider=st.from_regex(r"[A-Z0-9]{4}", fullmatch=True), **common)
aggregated = st.builds(
    RecsName,
    duration_s=st.integers(0, 1_677_721),
    period_ds=st.integers(0, 65_535),
    n_chip_code=st.integers(0, 4),
    **common,
)


@given(st.one_of(unitary, aggregated))
def test_names_round_trip(name: RecsName) -> None:
    assert parse_name(str(name)) == name


def test_published_examples() -> None:
    assert parse_name("GSCX01_251551107160_14_0_0_01.RCS") == RecsName(
        provider="GSCX", start=GalileoTime.parse("2025-06-04T11:07:16"), svid=14, key_delay=0, random_offset=0
    )
    assert parse_name("01_253540000000_000600_00300_14_0_0_3_01.bin") == RecsName(
        start=GalileoTime.parse("2025-12-20T00:00:00"), svid=14, key_delay=0, random_offset=0,
        duration_s=600, period_ds=300, n_chip_code=3,
    )  # fmt: skip


@pytest.mark.parametrize(
    "name", ["", "night.bin", "GSCX01_251551107160_14_0_0_01.bin", "GSCX01_٢51551107160_14_0_0_01.RCS"]
)
def test_other_names_say_nothing(name: str) -> None:
    assert parse_name(name) is None


@pytest.mark.parametrize(
    "code", ["253661107160", "250001107160", "251552407160", "251551160160", "251551107600", "990010000000"]
)
def test_dates_that_do_not_exist(code: str) -> None:
    with pytest.raises(InputFileError, match="start: found"):
        parse_name(f"GSCX01_{code}_14_0_0_01.RCS")


def test_deciseconds_within_the_minute() -> None:
    time = GalileoTime.parse("2024-12-31T23:59:59.9")  # day 366
    assert format_time_code(time) == "243662359599"
    assert parse_time_code("243662359599") == time
    assert parse_time_code("992340000000") == GalileoTime(0, 0)  # the first instant of GST, 1999-08-22


@given(times, st.floats(-9e-10, 9e-10))
def test_a_fraction_that_floats_have_shaken_is_still_its_decisecond(time: GalileoTime, shake: float) -> None:
    try:
        shaken = time + shake
    except ValueError:
        return  # before the epoch
    assert format_time_code(shaken) == format_time_code(time)
    assert time_of_deciseconds(shaken.week, deciseconds_of_week(shaken)) == time


def test_other_fractions_are_refused() -> None:
    with pytest.raises(ValueError, match="whole number of deciseconds"):
        deciseconds_of_week(GalileoTime(1251, 0, 0.05))
