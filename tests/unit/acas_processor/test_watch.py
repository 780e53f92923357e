"""What a receiver on watch remembers. The searches themselves: tests/unit/acas_processor/monitors."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from builders import START, validated_key
from vestige.acas_processor.mitigation import LEVELS
from vestige.acas_processor.monitors.judgement import judged
from vestige.acas_processor.monitors.vestigial_search import E6ExhaustiveSearch, SatelliteSearch, TimeUncertainty
from vestige.acas_processor.watch import (
    FIXED_S,
    TRAVEL_TIME_SPREAD_S,
    Further,
    Watch,
    WatchState,
    _true_offsets,
)
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.measurement import Measurement, SatelliteMeasurement
from vestige.records import (
    Assistance,
    ChipSequence,
    E1Observation,
    Handover,
    Outcome,
    ReceivedOsnma,
    Snapshot,
    Status,
    Verdict,
)
from vestige.sample_processor.search.peak import Peak
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

SVIDS = (3, 5, 8, 13)
NOTHING = Assistance(segments=())


def _snapshot(n: int) -> tuple[Snapshot, Measurement]:
    time = START + 30.0 * n
    snapshot = Snapshot(index=n, time=time, received_at=time, time_uncertainty_s=15.0, observations={}, e6=None)
    satellites = tuple(SatelliteMeasurement(svid=svid) for svid in SVIDS)
    return snapshot, Measurement(index=n, time=time, satellites=satellites, observations={}, front_end={})


def _verdicts(n: int, *statuses: Status) -> tuple[Verdict, ...]:
    return tuple(
        Verdict(
            index=n,
            time=START + 30.0 * n,
            available_at=None,
            svid=svid,
            level=3,
            status=status,
            checks=(),
            range_offset_m=math.nan,
            reason="",
        )
        for svid, status in zip(SVIDS, statuses, strict=False)
    )


def _step(
    watch: Watch, state: WatchState, n: int, *, level: int = 3, failed: bool = False
) -> tuple[WatchState, Further]:
    snapshot, measurement = _snapshot(n)
    return watch.step(level, state, snapshot, measurement, NOTHING, failed=failed)


@pytest.mark.parametrize("level", sorted(LEVELS))
def test_every_check_of_a_level_is_there_or_says_why_not(level: int) -> None:
    _, further = _step(Watch(), WatchState(), 0, level=level)
    expected = {row.name for row in LEVELS[level]} - {"E6 power", "E1-E6 range"}
    for svid in SVIDS if level > 1 else ():
        # the searches answer for the satellites of the RECS, of which there are none here
        names = {check.name for check in further.checks[svid]}
        assert names == expected - {"E1 vestigial search"}
        assert all(check.reason for check in further.checks[svid] if check.outcome is Outcome.NOT_RUN)
    assert bool(further.checks) == (level > 1)


def test_the_exhaustive_search_is_made_at_the_start_on_suspicion_and_now_and_then() -> None:
    watch, state, searched = Watch(exhaustive_period_s=600.0), WatchState(), []
    failing = {4, 5, 6, 9}
    for n in range(32):
        before = state.searched_at
        state, _ = _step(watch, state, n, failed=n in failing)
        if state.searched_at != before:
            searched.append(n)
        snapshot, measurement = _snapshot(n)
        status = Status.SUSPECT if n in failing else Status.AUTHENTIC
        state, _ = watch.learn(state, snapshot, measurement, _verdicts(n, *[status] * 4))
    assert searched == [0, 4, 5, 6, 9, 29]


def test_a_second_signal_is_searched_for_until_a_search_finds_one_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """No other check sees the attacker of RECS 3 to 7."""
    seen = []

    def search(self: E6ExhaustiveSearch, snapshot: Snapshot, *_: object, **__: object) -> tuple[SatelliteSearch, ...]:
        seen.append(snapshot.index)
        count = 2.0 if 3 <= snapshot.index <= 7 else 1.0
        return (SatelliteSearch(svid=3, signals=(), peaks=(), check=judged(self, count, 1.0, "two")),)

    monkeypatch.setattr(E6ExhaustiveSearch, "search", search)
    watch, state, failed = Watch(exhaustive_period_s=90.0), WatchState(), []
    for n in range(13):
        state, further = _step(watch, state, n)
        failed += [
            n for check in further.checks[3] if check.name == watch.exhaustive.name and check.outcome is Outcome.FAIL
        ]
    assert seen == [0, 3, 4, 5, 6, 7, 8, 11]
    assert failed == [3, 4, 5, 6, 7]


def test_level_2_makes_no_exhaustive_search() -> None:
    state, _ = _step(Watch(), WatchState(), 0, level=2, failed=True)
    assert state.searched_at is None


@pytest.mark.parametrize(
    ("statuses", "fixed_s"),
    [
        ([Status.AUTHENTIC] * 4, FIXED_S),
        ([Status.AUTHENTIC] * 3 + [Status.NOT_AVAILABLE], TRAVEL_TIME_SPREAD_S),
        ([Status.NOT_AVAILABLE] * 4, None),
        ([Status.AUTHENTIC] * 3 + [Status.SUSPECT], None),
    ],
)
def test_the_time_uncertainty_shrinks_when_all_is_quiet(statuses: list[Status], fixed_s: float | None) -> None:
    snapshot, measurement = _snapshot(0)
    start = WatchState(uncertainty=TimeUncertainty(initial_s=15.0))
    state, _ = Watch().learn(start, snapshot, measurement, _verdicts(0, *statuses))
    assert state.uncertainty.at(START) == pytest.approx(fixed_s or 15.0)
    later_s = state.uncertainty.at(START + 1000.0)
    assert later_s == pytest.approx(15.0 if fixed_s is None else fixed_s + 1000.0 * 2e-6)


def test_alarms_come_once() -> None:
    watch, state, alarms = Watch(), WatchState(), []
    for n in range(10):
        snapshot, measurement = _snapshot(n)
        own = _verdicts(n, Status.SPOOFED if n in (3, 4, 5) else Status.AUTHENTIC, Status.AUTHENTIC)
        state, changes = watch.learn(state, snapshot, measurement, own)
        alarms += [(n, change.svid, change.after) for change in changes if change.alarm]
    assert alarms == [(3, 3, Status.SPOOFED)]


def test_a_satellite_that_e1_lost_is_due_for_an_hour_and_one_never_seen_is_not() -> None:
    def snapshot(time_s: float, *seen: int) -> Snapshot:
        unknown = dict.fromkeys(("carrier_phase_cycles", "doppler_hz", "doppler_rate_hz_per_s", "cn0_dbhz"), math.nan)
        observations = {svid: E1Observation(svid=svid, pseudorange_m=2.4e7, **unknown) for svid in seen}
        return replace(_snapshot(0)[0], time=START + time_s, observations=observations, recs=frozenset({3, 5, 8}))

    state, _ = Watch().learn(WatchState(), snapshot(0.0, 3, 5), _snapshot(0)[1], ())
    assert state.lost(snapshot(30.0, 3)) == (5,)
    state, _ = Watch().learn(state, snapshot(30.0, 3), _snapshot(0)[1], ())
    assert state.lost(snapshot(3599.0)) == (3, 5)
    assert state.lost(snapshot(3600.0)) == (3,)
    assert state.lost(snapshot(3600.0, 3)) == ()
    assert sorted(state.on_e1) == [3, 5]


def _key(number: int, data: int) -> ValidatedKey:
    return validated_key(START.subframe + 30 * number, bytes([data]) * 16)


@pytest.mark.parametrize(
    ("received", "outcomes"),
    [
        (lambda n: _key(n, n), ("pass", "pass", "pass")),
        (lambda n: _key(n, n + 1), ("pass", "pass", "fail")),  # keys of somebody else
        (lambda n: _key(n, n) if n < 8 else None, ("fail", "fail", "pass")),  # kept away since
    ],
)
def test_keys_are_compared_with_the_second_channel(received: object, outcomes: tuple[str, ...]) -> None:
    keys = tuple(key for key in (received(n) for n in range(20)) if key is not None)  # type: ignore[operator]
    watch = Watch(second_channel=Assistance(keys=tuple(_key(n, n) for n in range(20))))
    snapshot, measurement = _snapshot(19)
    _, further = watch.step(3, WatchState(), snapshot, measurement, Assistance(segments=(), keys=keys), failed=False)
    names = ("OSNMA availability", "OSNMA reception", "OSNMA agreement")
    found = {check.name: check.outcome.value for check in further.checks[3]}
    assert tuple(found[name] for name in names) == outcomes


@pytest.mark.parametrize(
    ("key", "page", "outcomes"),
    [
        (None, None, ("pass", "pass", "pass")),
        (b"forged", None, ("pass", "pass", "fail")),  # demodulated and not validated: no loss
        (None, b"other", ("pass", "pass", "fail")),  # a tag
    ],
)
def test_what_was_demodulated_is_compared(key: bytes | None, page: bytes | None, outcomes: tuple[str, ...]) -> None:
    keys = tuple(_key(n, n) for n in range(20))
    sent = tuple(ReceivedOsnma(svid=3, time=one.time, fields=(b"01234", None), key=one.data) for one in keys)
    last = replace(sent[19], key=key or sent[19].key, fields=(page or b"01234", b"56789"))
    own = Assistance(keys=keys, received=(*sent[:19], last))
    watch = Watch(second_channel=Assistance(keys=keys, received=sent))
    snapshot, measurement = _snapshot(19)
    _, further = watch.step(3, WatchState(), snapshot, measurement, own, failed=False)
    found = {check.name: check.outcome.value for check in further.checks[3]}
    assert tuple(found[name] for name in ("OSNMA availability", "OSNMA reception", "OSNMA agreement")) == outcomes


def test_keys_of_later_are_not_compared() -> None:
    """Those that the second channel has of the time after the snapshot cannot have been received yet."""
    watch = Watch(second_channel=Assistance(keys=tuple(_key(n, n) for n in range(40))))
    snapshot, measurement = _snapshot(19)
    keys = tuple(_key(n, n) for n in range(20))
    _, further = watch.step(3, WatchState(), snapshot, measurement, Assistance(segments=(), keys=keys), failed=False)
    assert {one.name: one.outcome.value for one in further.checks[3]}["OSNMA reception"] == "pass"


def test_the_earliest_of_several_signals_is_the_true_one() -> None:
    chips = ChipSequence(svid=3, transmit_time=START, chip_rate_hz=5.115e6, chips=np.ones(4, np.int8))
    expected = START + 0.08
    handover = Handover(
        svid=3, chips=chips, start_time=expected, doppler_hz=0.0, doppler_rate_hz_per_s=0.0, expected_cn0_dbhz=40.0
    )
    _, measurement = _snapshot(0)
    measurement = replace(measurement, satellites=(SatelliteMeasurement(svid=3, handover=handover),))
    check = _step(Watch(), WatchState(), 0)[1].checks[3][0]

    def search(*offsets_s: float, sent: GalileoTime = START) -> SatelliteSearch:
        peaks = tuple(
            Peak(
                svid=3,
                start_time=expected + offset_s,
                doppler_hz=0.0,
                magnitude=9.0,
                threshold=5.0,
                cn0_dbhz=40.0,
            )
            for offset_s in offsets_s
        )
        return SatelliteSearch(svid=3, signals=(), peaks=peaks, check=check, sent=sent)

    assert _true_offsets(measurement, {3: [search(0.0)]}) == {}
    # where the RECS before came twice says nothing of where this one did
    assert _true_offsets(measurement, {3: [search(-0.4, -0.3, sent=START + -0.4)]}) == {}
    found = _true_offsets(measurement, {3: [search(-1e-6, 0.0), search(-1e-3, 0.0)]})
    assert found == {3: pytest.approx(-1e-3 * SPEED_OF_LIGHT_MPS, abs=0.05)}
