from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from real_ephemerides import recorded_words
from vestige.navigation.ephemeris import FIT_INTERVAL_S, nearest_ephemerides
from vestige.navigation.inav.ephemeris_words import ephemeris_from_words, sisa_m
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.time import GalileoTime


@pytest.mark.parametrize(
    ("index", "metres"),
    [(0, 0.0), (49, 0.49), (50, 0.5), (74, 0.98), (75, 1.0), (99, 1.96), (100, 2.0), (107, 3.12), (125, 6.0)],
)
def test_accuracy_index(index: int, metres: float) -> None:
    assert sisa_m(index) == pytest.approx(metres)


@pytest.mark.parametrize("index", [126, 200, 254, 255])
def test_no_accuracy(index: int) -> None:
    assert math.isnan(sisa_m(index))


def test_words_of_two_issues_make_no_ephemeris(osnma_data: Path) -> None:
    words, time = recorded_words(osnma_data)[21]
    assert ephemeris_from_words(words, time) is not None
    assert ephemeris_from_words({**words, 3: words[3] ^ 1 << 112}, time) is None
    assert ephemeris_from_words({kind: word for kind, word in words.items() if kind != 4}, time) is None


@pytest.mark.parametrize(
    ("received", "second", "toe"),
    [
        (GalileoTime(1372, 480_000), 479_400, GalileoTime(1372, 479_400)),
        (GalileoTime(1373, 30, 0.25), 604_200, GalileoTime(1372, 604_200)),
        (GalileoTime(1372, 604_790), 600, GalileoTime(1373, 600)),
    ],
)
def test_the_week_of_toe_is_the_nearest(osnma_data: Path, received: GalileoTime, second: int, toe: GalileoTime) -> None:
    words, _ = recorded_words(osnma_data)[21]
    mask = (1 << 14) - 1
    word_1 = words[1] & ~(mask << 98) | second // 60 << 98
    ephemeris = ephemeris_from_words({**words, 1: word_1}, received)
    assert ephemeris is not None
    assert ephemeris.toe == toe


def test_the_nearest_ephemeris_is_chosen() -> None:
    start = GalileoTime(1373, 0)
    early, late = walker_ephemerides(start)[0], walker_ephemerides(start + 3600.0)[0]
    assert nearest_ephemerides([early, late], start + 1700.0) == {1: early}
    assert nearest_ephemerides([late, early], start + 1900.0) == {1: late}
    assert nearest_ephemerides([early], start + -FIT_INTERVAL_S) == {1: early}
    assert nearest_ephemerides([early], start + (FIT_INTERVAL_S + 1)) == {}


def test_health() -> None:
    sound = walker_ephemerides(GalileoTime(1373, 0))[0]
    assert sound.healthy
    assert not replace(sound, e1b_health=1).healthy
    assert not replace(sound, e1b_data_valid=False).healthy
