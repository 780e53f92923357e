from __future__ import annotations

import pytest

from vestige.navigation.inav.schedule import scheduled_word
from vestige.time import GalileoTime

FIRST = "2 4 6 7 8 17 19 16 0 0 1 3 5 0 16"
SECOND = "2 4 6 9 10 18 20 16 0 0 1 3 5 0 16"


def minute(**options: bool) -> str:
    return " ".join(str(scheduled_word(GalileoTime(1372, 480_000 + second), **options)) for second in range(1, 60, 2))


def test_the_words_of_a_minute() -> None:
    assert minute() == f"{FIRST} {SECOND}"


def test_satellites_without_fec2_tell_the_time_instead() -> None:
    assert minute(fec2=False) == "2 4 6 7 8 0 0 0 0 0 1 3 5 0 0 2 4 6 9 10 0 0 0 0 0 1 3 5 0 0"


def test_an_orbit_that_does_not_fit_word_16_gives_word_5() -> None:
    assert minute(reduced_ced=False) == f"{FIRST} {SECOND}".replace("16", "5")


@pytest.mark.parametrize("time", [GalileoTime(1372, 0), GalileoTime(1372, 1, 0.25)])
def test_pages_start_at_odd_seconds(time: GalileoTime) -> None:
    with pytest.raises(ValueError, match="no I/NAV page starts at"):
        scheduled_word(time)
