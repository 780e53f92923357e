"""A receiver on watch: the checks that levels 2 and 3 add to a measurement, and what they have to remember.

Theory of operation
-------------------
Steps 1 and 2 look at one snapshot alone. The others compare with what was: power, C/N0 and noise floor with what they
usually are (`learned_checks.py`), the clock with its history, the range rates with those before and the accelerometers
(`inertial_bridging.py`), and the searches look as far as the clock may be wrong.
All of that is `WatchState`, and `Watch.step` folds over snapshots:

    state, snapshot, measurement → state, further checks of each satellite

**Searches are scheduled.** The search on E1 is made with every snapshot. Its signals are handed over to E6 where it
finds two of one satellite, and until the first authentic snapshot: then at every place in the time uncertainty. The
exhaustive search of E6 (level 3) takes seconds to minutes. It is made when it is due (`search_schedule.py`): at the
start, while anything is suspicious, and every `exhaustive_period_s`.

**The time uncertainty shrinks** with a snapshot in which no check fails. With four authentic satellites or more it is
what the position leaves open, with fewer the travel time is not known, 70 ms. From then on it grows with the
oscillator's frequency error (`TimeUncertainty`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from vestige.acas_processor.alarm import AlarmState, StateChange
from vestige.acas_processor.alarm_budget import SUBFRAME_S, Cadence, false_alarm_budget
from vestige.acas_processor.fix_checks import FixChecks
from vestige.acas_processor.inertial_bridging import InertialBridging, RateEpoch
from vestige.acas_processor.learned_checks import LearnedReferences
from vestige.acas_processor.mitigation import ALARMS, LEVELS
from vestige.acas_processor.monitors.clock_drift import ClockEpoch
from vestige.acas_processor.monitors.decision_map import PowerDistortionMonitor
from vestige.acas_processor.monitors.judgement import not_run
from vestige.acas_processor.monitors.osnma_check import AssistedOsnmaMonitor, OsnmaAvailabilityMonitor
from vestige.acas_processor.monitors.second_signal import SecondSignalMonitor
from vestige.acas_processor.monitors.vestigial_search import (
    FIXED_S,
    E1VestigialSearch,
    E6ExhaustiveSearch,
    SatelliteSearch,
    TimeUncertainty,
)
from vestige.acas_processor.osnma_comparison import compare_osnma
from vestige.acas_processor.search_schedule import search_due
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.measurement import Measurement
from vestige.records import Assistance, CheckResult, Outcome, Snapshot, Status, Verdict
from vestige.time import GalileoTime

FORGET_S = 3600.0  # a satellite that is gone for longer has set: no verdict is due any more
TRAVEL_TIME_SPREAD_S = 0.07  # of any satellite to any receiver on Earth
POSITION_SATELLITES = 4
OSNMA_SUBFRAMES = 20  # in which keys are looked for, 10 minutes
_NO_TAPS = not_run(PowerDistortionMonitor(), "a snapshot has no E1 correlators of the time since the one before")


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchState:
    """What a receiver on watch remembers.

    Attributes
    ----------
    uncertainty
        Of its clock.
    usual
        References of power, C/N0 and noise floor.
    clock
        History of the fix.
    rates
        Range rates of the last snapshot; None without accelerations.
    searched_at
        Time of the last exhaustive search.
    found_twice
        Whether an exhaustive search was made of the last snapshot and found more than one signal of a satellite.
    alarm
        What is shown of each satellite.
    on_e1
        When E1 showed each satellite last.
    """

    uncertainty: TimeUncertainty = field(default_factory=TimeUncertainty)
    usual: LearnedReferences = field(default_factory=LearnedReferences)
    clock: tuple[ClockEpoch, ...] = ()
    rates: RateEpoch | None = None
    searched_at: GalileoTime | None = None
    found_twice: bool = False
    alarm: AlarmState = field(default_factory=AlarmState)
    on_e1: Mapping[int, GalileoTime] = field(default_factory=dict)

    def lost(self, snapshot: Snapshot) -> tuple[int, ...]:
        """Return the satellites whose RECS a snapshot was cut for that E1 showed before, lately, and does not now."""
        lately = (svid for svid, seen in self.on_e1.items() if snapshot.time - seen < FORGET_S)
        return tuple(sorted(snapshot.unseen.intersection(lately)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Further:
    """What a level adds to the measurement of a snapshot.

    Attributes
    ----------
    checks
        By satellite; those of the receiver belong to each.
    true_offset_m
        By satellite, of those of which a search found more than one signal: how much later than where E1 puts it the
        earliest is, in m.
    """

    checks: Mapping[int, tuple[CheckResult, ...]] = field(default_factory=dict)
    true_offset_m: Mapping[int, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """Settings of the checks that levels 2 and 3 add.

    Attributes
    ----------
    cadence, alarms_a_day
        How often snapshots come, and how many false alarms a day they may bring: thresholds follow.
    fix
        Checks of the position fix, with the orbits.
    exhaustive, exhaustive_period_s
        The exhaustive search, and the time between two when nothing is wrong.
    second_channel
        OSNMA keys, and pages if there are any, that came over another channel [WFO, Sec. IV-C]; None without one.
    inertial
        The check against accelerometers, with what they say.
    """

    cadence: Cadence = Cadence(satellites=10, observation_s=30.0)  # noqa: RUF009  (frozen)
    alarms_a_day: float = 1.0
    fix: FixChecks = field(default_factory=FixChecks)
    exhaustive: E6ExhaustiveSearch = field(default_factory=E6ExhaustiveSearch)
    exhaustive_period_s: float = 3600.0
    second_channel: Assistance | None = None
    inertial: InertialBridging = field(default_factory=InertialBridging)

    def step(
        self,
        level: int,
        state: WatchState,
        snapshot: Snapshot,
        measurement: Measurement,
        assistance: Assistance,
        *,
        failed: bool,
    ) -> tuple[WatchState, Further]:
        """Return the state after a snapshot, and its further checks; nothing at level 1.

        Parameters
        ----------
        level
            Mitigation level.
        failed
            Whether step 1 or 2 failed for any satellite: reason for an exhaustive search.
        """
        names = {row.name for row in LEVELS[level]}
        budget = false_alarm_budget(level, self.cadence, alarms_a_day=self.alarms_a_day)
        p_fa = {name: share.p_fa for name, share in budget.items()}
        if "E1 vestigial search" not in names:
            return state, Further()
        solved = self.fix.solve(snapshot.time, snapshot.observations)
        clock, of_fix = self.fix.with_budget(p_fa).step(state.clock, solved)
        of_receiver = (*state.usual.of_receiver(snapshot, p_fa), *of_fix)
        if "OSNMA reception" in names:
            of_receiver = (*of_receiver, *self._osnma(snapshot, assistance, p_fa))
        handed_over = E1VestigialSearch(p_fa=p_fa["E1 vestigial search"])
        searches = {one.svid: [one] for one in handed_over.search(snapshot, assistance, state.uncertainty)}
        checks = {
            one.svid: (
                *state.usual.of_satellite(snapshot, one, p_fa),
                SecondSignalMonitor(p_fa=p_fa["E6 second signal"]).check(one.bank),
                *(search.check for search in searches.get(one.svid, ())),
                *of_receiver,
            )
            for one in measurement.satellites
        }
        state = replace(state, clock=clock)
        if "inertial range rate" in names:
            rates, inertial = self.inertial.step(state.rates, solved, checks, p_fa["inertial range rate"])
            checks = {svid: (*own, _NO_TAPS, inertial[svid]) for svid, own in checks.items()}
            state = replace(state, rates=rates)
        if "E6 exhaustive search" in names:
            failed = failed or any(check.outcome is Outcome.FAIL for own in checks.values() for check in own)
            state, found = self._exhaustive(
                state, snapshot, measurement, assistance, failed=failed, p_fa=p_fa["E6 exhaustive search"]
            )
            for svid, own in checks.items():
                check = found[svid].check if svid in found else not_run(self.exhaustive, "not due")
                checks[svid] = (*own, check)
                searches.setdefault(svid, []).extend([found[svid]] if svid in found else [])
        return state, Further(checks=checks, true_offset_m=_true_offsets(measurement, searches))

    def learn(
        self, state: WatchState, snapshot: Snapshot, measurement: Measurement, verdicts: tuple[Verdict, ...]
    ) -> tuple[WatchState, tuple[StateChange, ...]]:
        """Return the state that knows the verdicts of a snapshot, and what is now shown otherwise than before."""
        alarm, changes = state.alarm, []
        for verdict in verdicts:
            if verdict.svid in snapshot.unseen:
                alarm, change = alarm.lost(verdict.svid, verdict.time, verdict.reason)
            else:
                alarm, change = alarm.step(verdict.svid, verdict.time, verdict.status, verdict.reason)
            changes += [change] if change else []
        on_e1 = {**state.on_e1, **dict.fromkeys(snapshot.observations, snapshot.time)}
        state = replace(state, alarm=alarm, on_e1=on_e1)
        if any(verdict.status in ALARMS for verdict in verdicts):
            return state, tuple(changes)
        authentic = sum(verdict.status is Status.AUTHENTIC for verdict in verdicts)
        if authentic:
            fixed_s = FIXED_S if authentic >= POSITION_SATELLITES else TRAVEL_TIME_SPREAD_S
            state = replace(state, uncertainty=state.uncertainty.after_fix(snapshot.time, fixed_s=fixed_s))
        return replace(state, usual=state.usual.learn(snapshot, measurement)), tuple(changes)

    def _osnma(self, snapshot: Snapshot, assistance: Assistance, p_fa: Mapping[str, float]) -> tuple[CheckResult, ...]:
        """Return whether keys came, and whether keys and pages are those of the second channel."""
        availability = OsnmaAvailabilityMonitor(p_fa=p_fa["OSNMA availability"])
        reception = AssistedOsnmaMonitor(p_fa=p_fa["OSNMA reception"])
        if self.second_channel is None:
            return (not_run(availability, "no OSNMA data from a second channel"), *reception.check(()))
        since = snapshot.time + -SUBFRAME_S * OSNMA_SUBFRAMES
        found = compare_osnma(assistance, self.second_channel, since, snapshot.time)
        return (availability.check(found.validated), *reception.check(found.keys, found.pages))

    def _exhaustive(
        self,
        state: WatchState,
        snapshot: Snapshot,
        measurement: Measurement,
        assistance: Assistance,
        *,
        failed: bool,
        p_fa: float,
    ) -> tuple[WatchState, dict[int, SatelliteSearch]]:
        """Return the results of the exhaustive search, if one is due, and the state that knows of it."""
        since_s = None if state.searched_at is None else snapshot.time - state.searched_at
        if not search_due(since_s, self.exhaustive_period_s, suspicious=failed, found_twice=state.found_twice):
            return state, {}
        expected = {one.svid: one.handover.start_time for one in measurement.satellites if one.handover is not None}
        found = replace(self.exhaustive, p_fa=p_fa).search(snapshot, assistance, state.uncertainty, expected=expected)
        found_twice = any(one.check.outcome is Outcome.FAIL for one in found)
        return replace(state, searched_at=snapshot.time, found_twice=found_twice), {one.svid: one for one in found}


def _true_offsets(measurement: Measurement, searches: Mapping[int, list[SatelliteSearch]]) -> dict[int, float]:
    """Return where the earliest of several signals is against where E1 puts it, of one and the same RECS, in m."""
    offsets = {}
    for one in measurement.satellites:
        if one.handover is None:
            continue
        sent = one.handover.chips.transmit_time
        of_this = [own for own in searches.get(one.svid, []) if own.sent == sent and len(own.peaks) > 1]
        if of_this:
            first = min(peak.start_time for own in of_this for peak in own.peaks)
            offsets[one.svid] = (first - one.handover.start_time) * SPEED_OF_LIGHT_MPS
    return offsets
