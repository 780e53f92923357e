"""Satellites that rise are looked for first, by the almanac of the message."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from builders import START, received_batch, satellite
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import ecef_from_geodetic
from vestige.navigation.inav.almanac_words import almanac_sets
from vestige.navigation.line_of_sight import ReceiverMotion, line_of_sight
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.records import Band, E1Observation, SampleBatch
from vestige.records.observation_epoch import ObservationEpoch
from vestige.sample_processor.tracking.outlook import HORIZON_DEG, Outlook
from vestige.sample_processor.tracking.tracking_receiver import TrackingReceiver
from vestige.time import GalileoTime

PLACE_M = ecef_from_geodetic(np.radians([48.1]), np.radians([11.6]), np.array([500.0]))[0]
T0A = GalileoTime(START.week, START.second // 600 * 600)
WALKER = walker_ephemerides(T0A)
RATE_HZ = 4.1e6
RISES_S = 0.5


def _pages(*, left_out: tuple[int, int] | None = None) -> list[SimpleNamespace]:
    """All sets of the almanac, one a minute, less the word of a type in one minute."""
    begin = GalileoTime.from_gst_seconds(START.gst_seconds // 60 * 60)
    return [
        SimpleNamespace(svid=11, time=begin + (60 * minute + 2 * place), word=word, is_alert=False)
        for minute, one in enumerate(almanac_sets(WALKER, T0A))
        for place, (kind, word) in enumerate(one.words().items())
        if left_out != (minute, kind)
    ]


def _seen(time: GalileoTime) -> dict[int, tuple[float, float]]:
    """Range in m and elevation in degrees of every satellite of the constellation."""
    rest = np.zeros((1, 3))
    here = ReceiverMotion(position_m=PLACE_M[None, :], velocity_mps=rest, acceleration_mps2=rest)
    found = {}
    for one in WALKER:
        line = line_of_sight(one, time, np.zeros(1), here)
        found[one.svid] = float(line.range_m[0] - line.satellite_clock_m[0]), float(np.degrees(line.elevation_rad[0]))
    return found


def _epoch(time: GalileoTime, *, at_most: int = 9) -> ObservationEpoch:
    high = [svid for svid, (_, elevation) in sorted(_seen(time).items()) if elevation > 20][:at_most]
    unknown = dict.fromkeys(("doppler_hz", "doppler_rate_hz_per_s", "carrier_phase_cycles", "cn0_dbhz"), float("nan"))
    clock_m = 1e-3 * SPEED_OF_LIGHT_MPS
    return ObservationEpoch(
        time=time + 1e-3,
        observations={
            svid: E1Observation(svid=svid, pseudorange_m=_seen(time)[svid][0] + clock_m, **unknown) for svid in high
        },
    )


def _outlook() -> Outlook:
    outlook = Outlook()
    for page in _pages():
        outlook.take(page)  # type: ignore[arg-type]
    outlook.locate(_epoch(START))
    return outlook


def test_position_and_elevations_follow_from_almanac_and_ranges() -> None:
    outlook = _outlook()
    assert outlook.known == {one.svid for one in WALKER}
    assert outlook.position_m is not None
    assert np.linalg.norm(outlook.position_m - PLACE_M) < 20e3
    later = START + 3600.0
    for svid, (_, elevation_deg) in _seen(later).items():
        assert outlook.elevation_deg(svid, later) == pytest.approx(elevation_deg, abs=0.3)


def test_words_of_two_sets_are_not_mixed() -> None:
    """The third set is without its word 9: its satellites are unknown, all others are right."""
    outlook = Outlook()
    for page in _pages(left_out=(2, 9)):
        outlook.take(page)  # type: ignore[arg-type]
    missing = {entry.svid for entry in almanac_sets(WALKER, T0A)[2].entries}
    assert outlook.known == {one.svid for one in WALKER} - missing


def test_three_satellites_are_no_position() -> None:
    outlook = _outlook()
    before = outlook.position_m
    outlook.locate(_epoch(START + 60.0, at_most=3))
    assert outlook.position_m is before


def test_three_searches_of_four_are_of_satellites_above_the_horizon() -> None:
    outlook = _outlook()
    above = [svid for svid, (_, elevation) in _seen(START).items() if elevation > HORIZON_DEG]
    unseen = [one.svid for one in WALKER if one.svid not in above[2:]]
    turns = [outlook.next_search(unseen, START) for _ in range(40)]
    assert {turn for number, turn in enumerate(turns, start=1) if number % 4} == set(above[:2])
    assert turns[0] != turns[1]
    others = turns[3::4]
    assert len(set(others)) == len(others) == 10
    assert not set(others) & set(above)
    assert outlook.next_search([], START) is None


def test_without_an_almanac_all_satellites_come_in_turn() -> None:
    outlook = Outlook()
    outlook.locate(_epoch(START))
    turns = [outlook.next_search([3, 5, 9], START) for _ in range(6)]
    assert turns == [3, 5, 9, 3, 5, 9]


@pytest.fixture(scope="module")
def sky() -> SampleBatch:
    """E11 all the time, and E17, which rises after 0.5 s."""
    first, second = (
        satellite(11, 2.41e7, -350.0, 45.0, 45.0, seed=2),
        satellite(17, 2.6e7, -600.0, 45.0, 45.0, seed=5),
    )
    before, after = (
        received_batch(Band.E1, signals, duration_s=1.6, rate_hz=RATE_HZ, seed=4)
        for signals in ([first], [first, second])
    )
    rises = round(RISES_S * RATE_HZ)
    return replace(before, samples=np.concatenate((before.samples[:rises], after.samples[rises:])))


@pytest.mark.parametrize("told", [True, False])
def test_a_satellite_that_begins_later_is_tracked(
    sky: SampleBatch, monkeypatch: pytest.MonkeyPatch, told: bool
) -> None:
    """If the almanac says that E17 is above the horizon, the next search has it; else five others come first."""
    receiver = TrackingReceiver(svids=(1, 2, 3, 4, 5, 11, 17), search_every_s=0.4)
    if told:
        receiver.outlook._orbits[17] = WALKER[0]
        monkeypatch.setattr(Outlook, "elevation_deg", lambda *_: 5.0)
    epochs = [epoch for stretch in receiver.run([sky]) for epoch in stretch.epochs]
    seen_s = [epoch.time - START for epoch in epochs if 17 in epoch.observations]
    assert 11 in epochs[-1].observations
    assert bool(seen_s) == told
    if told:
        assert 0.8 < seen_s[0] < 1.45  # searched at 0.8 s, and half a second to pull in
        error_m = epochs[-1].observations[17].pseudorange_m - (2.6e7 - 600.0 * (epochs[-1].time - START))
        assert abs(error_m) < 15.0


def test_a_satellite_that_was_lost_for_long_is_searched_anew() -> None:
    """When it rises again its Doppler is another one than that with which it set."""
    receiver = TrackingReceiver(svids=(11, 12))
    lost = {svid: SimpleNamespace(channel=SimpleNamespace(lost=svid == 11)) for svid in (11, 12)}
    receiver.tracks = dict(lost)  # type: ignore[arg-type]
    receiver._waiting[11] = []
    for stretch in (10, 500, 609):
        receiver._stretch = stretch
        receiver._forget_lost()
        assert set(receiver.tracks) == {11, 12}
    receiver._stretch = 610
    receiver._forget_lost()
    assert set(receiver.tracks) == {12}
    assert 11 not in receiver._waiting
