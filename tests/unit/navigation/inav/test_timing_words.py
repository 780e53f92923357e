from __future__ import annotations

import pytest

from vestige.navigation.inav.timing_words import GpsTimeOffset, UtcModel, time_word
from vestige.navigation.inav.words import InavWord, time_in_word
from vestige.time import GalileoTime

NOW = GalileoTime(1372, 480_105)


def test_word_0_tells_the_time() -> None:
    assert time_in_word(time_word(GalileoTime(4096 + 5, 604_799))) == (5, 604_799)


def test_utc_of_today() -> None:
    model = UtcModel.at(NOW)
    assert (model.leap_seconds, model.leap_seconds_after) == (18, 18)
    raw = InavWord.decode(model.word(NOW)).raw
    # 2016-12-31 was a Saturday, the seventh day of week 905 = 137 modulo 256
    assert (raw["leap_week"], raw["leap_day"], raw["utc_week"], raw["tow_s"]) == (137, 7, 1372 % 256, 480_105)


@pytest.mark.parametrize(
    ("text", "before", "after", "day"),
    [
        ("2016-12-31T12:00:00 UTC", 17, 18, "2016-12-31"),
        ("2017-01-01T00:00:00 UTC", 18, 18, "2016-12-31"),
        ("2016-05-01T00:00:00 UTC", 17, 17, "2015-06-30"),
        ("1999-09-01T00:00:00 UTC", 13, 13, "1999-08-22"),
    ],
)
def test_leap_seconds_are_announced_half_a_year_ahead(text: str, before: int, after: int, day: str) -> None:
    model = UtcModel.at(GalileoTime.parse(text))
    assert (model.leap_seconds, model.leap_seconds_after) == (before, after)
    assert f"{model.leap_day.calendar:%Y-%m-%d}" == day


def test_the_utc_model_comes_back() -> None:
    time = GalileoTime.parse("2016-12-30T12:00:00 UTC")
    model = UtcModel(
        a0_s=-3 * 2.0**-30,
        a1=5 * 2.0**-50,
        reference=GalileoTime(time.week, 7200),
        leap_seconds=17,
        leap_seconds_after=18,
        leap_day=UtcModel.at(time).leap_day,
    )
    assert UtcModel.from_word(model.word(time), time) == model


def test_gps_time_comes_back_or_is_none() -> None:
    offset = GpsTimeOffset(a0g_s=-7 * 2.0**-35, a1g=2.0**-51, reference=GalileoTime(1372, 3600 * 144))
    made = InavWord.from_values(10, {**InavWord.decode(10 << 122).values, **offset.fields}).encode()
    assert GpsTimeOffset.from_word(made, NOW) == offset
    assert GpsTimeOffset.from_word(10 << 122 | (1 << 42) - 1, NOW) is None
