from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vestige.navigation.inav.almanac_words import AlmanacEntry, AlmanacSet, almanac_sets
from vestige.navigation.inav.timing_words import GpsTimeOffset
from vestige.navigation.inav.words import InavWord
from vestige.navigation.orbit import satellite_state
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.time import GalileoTime

TOE = GalileoTime(1371, 603_000)
T0A = GalileoTime(1372, 600)  # in the next week
WALKER = [replace(one, af0_s=1e-5 * one.svid, af1=-1e-11) for one in walker_ephemerides(TOE)]
GPS_TIME = GpsTimeOffset(a0g_s=2.0**-29, a1g=2.0**-48, reference=GalileoTime(1372, 518_400))


def test_words_give_back_their_set() -> None:
    for one in almanac_sets(WALKER, T0A, issue=11, gps_time=GPS_TIME):
        decoded = AlmanacSet.from_words(one.words(), T0A + 9000.0)
        assert decoded is not None
        assert decoded.words() == one.words()
        assert (decoded.issue, decoded.t0a, decoded.gps_time) == (11, T0A, GPS_TIME)
        assert [entry.svid for entry in decoded.entries] == [entry.svid for entry in one.entries]


def test_positions_are_right_to_kilometres_and_clocks_to_a_microsecond() -> None:
    sets = [AlmanacSet.from_words(one.words(), T0A) for one in almanac_sets(WALKER, T0A)]
    entries = [entry for one in sets if one is not None for entry in one.entries]
    assert [entry.svid for entry in entries] == list(range(1, 25))
    for entry, ephemeris in zip(entries, WALKER, strict=True):
        elapsed = np.array([0.0, 7200.0])
        told, true = (satellite_state(one, T0A, elapsed) for one in (entry.ephemeris(T0A), ephemeris))
        assert np.linalg.norm(told.position_m - true.position_m, axis=1).max() < 6000.0
        assert np.abs(told.clock_s - true.clock_s).max() < 1.2e-6  # half a step is 0.95 µs


def test_a_set_may_have_empty_places_and_no_gps_time() -> None:
    *_, last = almanac_sets(WALKER[:4], T0A)
    decoded = AlmanacSet.from_words(last.words(), T0A)
    assert decoded is not None
    assert [entry.svid for entry in decoded.entries] == [4, 0, 0]
    assert decoded.gps_time is None
    assert f"{last.words()[10]:0128b}"[86:] == "1" * 42


def test_satellites_that_do_not_fit_are_left_out() -> None:
    eccentric = replace(WALKER[0], eccentricity=0.16)
    assert AlmanacEntry.from_ephemeris(eccentric, T0A) is None
    assert [entry.svid for one in almanac_sets([eccentric, *WALKER[1:3]], T0A) for entry in one.entries] == [2, 3]


def test_words_of_several_issues_give_nothing() -> None:
    first, second = (almanac_sets(WALKER, T0A, issue=issue)[0].words() for issue in (3, 4))
    assert AlmanacSet.from_words({**first, 9: second[9]}, T0A) is None
    assert AlmanacSet.from_words({kind: word for kind, word in first.items() if kind != 8}, T0A) is None


def test_the_issue_is_in_every_word() -> None:
    words = almanac_sets(WALKER, T0A, issue=13)[0].words()
    assert {kind: InavWord.decode(word).raw["iod_almanac"] for kind, word in words.items()} == dict.fromkeys(words, 13)


def test_sets_have_one_to_three_entries_at_whole_ten_minutes() -> None:
    entry = AlmanacEntry(svid=1)
    for entries, time in (((), T0A), ((entry,) * 4, T0A), ((entry,), T0A + 60.0)):
        with pytest.raises(ValueError, match="expected 1 to 3 at whole 10 minutes"):
            AlmanacSet(issue=0, t0a=time, entries=entries)


@pytest.mark.parametrize("weeks", [-1, 0, 1, 2])
def test_the_week_of_an_almanac_is_up_to_two_weeks_ago(weeks: int) -> None:
    decoded = AlmanacSet.from_words(almanac_sets(WALKER, T0A)[0].words(), T0A + 604_800.0 * weeks)
    assert decoded is not None
    assert decoded.t0a == T0A
