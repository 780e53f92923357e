from __future__ import annotations

from dataclasses import replace

import pytest

from vestige.broadcast.satellite_words import EphemerisIssue, SatelliteWords, SystemData
from vestige.errors import VestigeError
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.almanac_words import AlmanacSet, almanac_sets
from vestige.navigation.inav.coding.fec2 import restored_words
from vestige.navigation.inav.ephemeris_words import as_broadcast, ephemeris_from_words
from vestige.navigation.inav.ionosphere import BroadcastIonosphere
from vestige.navigation.inav.reduced_ced import ReducedCed
from vestige.navigation.inav.schedule import scheduled_word
from vestige.navigation.inav.timing_words import UtcModel
from vestige.navigation.inav.words import InavWord, time_in_word, word_type
from vestige.navigation.reissue import reissued
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.time import GalileoTime

START = GalileoTime(1372, 604_740)  # a minute before the end of the week
WALKER = [as_broadcast(one) for one in walker_ephemerides(START + -600.0)]
NOW = WALKER[3]
IONOSPHERE = BroadcastIonosphere(ai0_sfu=120.25, ai1_sfu_per_deg=-0.5)
SYSTEM = SystemData(
    utc=UtcModel.at(START), ionosphere=IONOSPHERE, almanac=almanac_sets(WALKER, GalileoTime(1372, 604_200))
)


def issued(*starts_s: float) -> list[EphemerisIssue]:
    return [
        EphemerisIssue(start=START + start_s, ephemeris=as_broadcast(reissued(NOW, number)))
        for number, start_s in enumerate(starts_s)
    ]


def sent(words: SatelliteWords, start: GalileoTime, n_subframes: int = 1) -> dict[GalileoTime, int]:
    return {start + 1.0 + 2.0 * k: words.word(start + 1.0 + 2.0 * k) for k in range(15 * n_subframes)}


def test_words_follow_the_schedule_and_tell_the_time() -> None:
    for time, word in sent(SatelliteWords(issued(0.0), SYSTEM), START, 4).items():
        assert word_type(word) == scheduled_word(time)
        if word_type(word) in (0, 5, 6):
            assert time_in_word(word) == (None if word_type(word) == 6 else time.week, time.second)


def test_a_subframe_holds_the_ephemeris_and_what_all_send() -> None:
    words = {word_type(word): word for word in sent(SatelliteWords(issued(0.0), SYSTEM), START).values()}
    assert ephemeris_from_words(words, START) == NOW
    assert BroadcastIonosphere.from_word(words[5]) == IONOSPHERE
    assert UtcModel.from_word(words[6], START) == replace(
        SYSTEM.utc, leap_day=UtcModel.from_word(words[6], START).leap_day
    )
    reduced = ReducedCed.from_ephemeris(NOW, START)
    assert reduced is not None
    assert words[16] == reduced.word


def test_the_parity_of_a_minute_gives_the_ephemeris() -> None:
    words = {word_type(word): word for word in sent(SatelliteWords(issued(0.0), SYSTEM), START, 2).values()}
    restored = restored_words({kind: words[kind] for kind in (17, 18, 19, 20)})
    assert restored == {kind: words[kind] for kind in (1, 2, 3, 4)}


@pytest.mark.parametrize(("second", "first_new"), [(60.0, 2), (59.0, 2), (30.5, 2), (61.0, 3)])
def test_a_new_issue_starts_with_a_subframe(second: float, first_new: int) -> None:
    """Here the subframe 2 is the first one of a new week."""
    words = SatelliteWords(issued(0.0, second), SYSTEM)
    issues = [
        {
            InavWord.decode(word).raw["iod_nav"]
            for word in sent(words, START + 30.0 * k).values()
            if 1 <= word >> 122 <= 4
        }
        for k in range(4)
    ]
    old, new = {NOW.iod_nav}, {NOW.iod_nav + 1}
    assert issues == [new if k >= first_new else old for k in range(4)]
    assert words.ephemeris(START + 30.0 * first_new).iod_nav == NOW.iod_nav + 1
    low_bits = [
        InavWord.decode(word).raw["iod_nav_low"]
        for word in sent(words, START + 30.0 * first_new).values()
        if word_type(word) in (17, 18, 19, 20)
    ]
    assert low_bits == [(NOW.iod_nav + 1) & 3] * 2


def test_all_sets_of_the_almanac_come_in_turn() -> None:
    words, received = SatelliteWords(issued(0.0), SYSTEM), {}
    for minute in range(8):
        of_minute = {word_type(word): word for word in sent(words, START + 60.0 * minute, 2).values()}
        decoded = AlmanacSet.from_words(of_minute, START)
        assert decoded is not None
        received |= {entry.svid: entry for entry in decoded.entries}
    assert sorted(received) == list(range(1, 25))


def test_without_almanac_and_fec2_word_0_fills_the_places() -> None:
    words = SatelliteWords(issued(0.0), SystemData(utc=UtcModel.at(START)), fec2=False)
    kinds = [word_type(word) for word in sent(words, START, 2).values()]
    assert kinds == [2, 4, 6, *[0] * 7, 1, 3, 5, 0, 0] * 2


def test_an_eccentric_orbit_sends_word_5_in_place_of_16() -> None:
    eccentric: Ephemeris = as_broadcast(replace(NOW, eccentricity=0.16))
    words = SatelliteWords([EphemerisIssue(start=START, ephemeris=eccentric)], SYSTEM)
    kinds = [word_type(word) for word in sent(words, START).values()]
    assert kinds == [2, 4, 6, 7, 8, 17, 19, 5, 0, 0, 1, 3, 5, 0, 5]


def test_what_cannot_be_sent_is_one_line() -> None:
    with pytest.raises(VestigeError, match="without an ephemeris"):
        SatelliteWords([], SYSTEM)
    with pytest.raises(VestigeError, match=r"^E04: no ephemeris was issued before 2025"):
        SatelliteWords(issued(31.0), SYSTEM).word(START + 31.0)
    same = [EphemerisIssue(start=START + 60.0 * k, ephemeris=NOW) for k in range(2)]
    repeated = rf"^E04: the ephemeris issued at .* has the IODnav {NOW.iod_nav} of the previous issue"
    with pytest.raises(VestigeError, match=repeated):
        SatelliteWords(same, SYSTEM)
    with pytest.raises(ValueError, match="several satellites"):
        SatelliteWords([EphemerisIssue(start=START, ephemeris=one) for one in WALKER[:2]], SYSTEM)
    with pytest.raises(ValueError, match="no I/NAV page starts at"):
        SatelliteWords(issued(0.0), SYSTEM).word(START)
