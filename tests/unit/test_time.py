from __future__ import annotations

from datetime import datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.time import GalileoTime

times = st.builds(
    GalileoTime,
    st.integers(0, 6000),
    st.integers(0, 604_799),
    st.floats(0, 1, exclude_max=True, allow_nan=False),
)


@pytest.mark.parametrize(
    ("text", "week", "second"),
    [  # protocol facts: test vector start, recorded keys, epoch
        ("2023-08-16T05:00:01 GST", 1251, 277201),
        ("2025-12-12 13:22:00 GST", 1372, 480120),
        ("1999-08-22T00:00:00 GST", 0, 0),
        ("1999-08-21T23:59:47 UTC", 0, 0),
        ("2021-11-25T00:40:00Z", 1161, 348018),
        ("1251:277200", 1251, 277200),
    ],
)
def test_parse(text: str, week: int, second: int) -> None:
    assert GalileoTime.parse(text) == GalileoTime(week, second)


@pytest.mark.parametrize("week", [-1, 400_001, 10**18, 10**20])
def test_no_time_is_beyond_the_calendar(week: int) -> None:
    with pytest.raises(ValueError, match="not a Galileo time"):
        GalileoTime(week, 0)
    assert str(GalileoTime(400_000, 604_799)).startswith("9665-10-17")


def test_leap_second_table_at_its_steps() -> None:
    assert GalileoTime.from_utc(datetime(2017, 1, 1)) - GalileoTime.from_utc(datetime(2016, 12, 31, 23, 59, 59)) == 2
    assert GalileoTime.from_utc(datetime(2012, 6, 30, 23, 59, 59)).utc == datetime.fromisoformat(
        "2012-06-30T23:59:59+00:00"
    )


@pytest.mark.parametrize(
    "text", ["", "yesterday", "2023-13-01T00:00:00", "1251:604800", "2023-08-16T05:00:01 GPS", "1:2:3"]
)
def test_parse_refuses(text: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        GalileoTime.parse(text)


@given(times, st.floats(-1e6, 1e6, allow_nan=False))
def test_add_then_subtract(time: GalileoTime, seconds: float) -> None:
    if (time.week * 604800 + time.second) + seconds < 1:
        return
    assert (time + seconds) - time == pytest.approx(seconds, abs=2e-10)


def test_differences_keep_their_precision_over_a_week_roll_over() -> None:
    before, after = GalileoTime(1371, 604_799, 0.999_999_999_5), GalileoTime(1372, 0, 1e-10)
    assert after - before == pytest.approx(6e-10, abs=1e-16)


@given(times)
def test_utc_round_trip(time: GalileoTime) -> None:
    assert abs(GalileoTime.from_utc(time.utc) - time) <= 1.001  # one second at a leap second, else a microsecond


@given(times)
def test_subframe_holds_the_time(time: GalileoTime) -> None:
    assert 0 <= time - time.subframe < 30
    assert time.subframe.second % 30 == 0


def test_negative_fraction_that_rounds_to_one() -> None:
    assert GalileoTime.normalized(10, 5, -1e-20) == GalileoTime(10, 5, 0.0)


def test_prints_truncated_not_rounded() -> None:
    assert str(GalileoTime(0, 59, 0.99999)) == "1999-08-22T00:00:59.999 GST"
