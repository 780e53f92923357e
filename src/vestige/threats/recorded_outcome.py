"""Determine the outcome of an attack in a recording that a receiver has processed, in the words of the threat table.

`campaign/run_outcome.py` defines the words of the threat table. An outcome needs the epochs and the errors of the
ranges. This module takes epochs and errors from the recording:

**Error of a range.** The error is the tracked pseudorange minus the pseudorange of the same receiver without the
attack. The pseudorange without the attack is computed from the scenario, without samples. The two pseudoranges have the
same clock, orbits and atmosphere. If a signal that is earlier than the E1 signal gives the range in use, this range
minus the E1 pseudorange is added to the error.

**Epochs.** Each RECS is an epoch. If the level tests E1 between RECS, each second between two RECS is also an epoch. A
satellite of the scenario that is not tracked has the verdict NOT_AVAILABLE.

The error of the position is not computed, because this error follows from the errors of the ranges.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int8

from vestige.acas_processor.levels import POSITION
from vestige.acas_processor.processor import Step
from vestige.campaign.levels import alarm_begins, failures_in_order
from vestige.campaign.range_errors import window_of, worst_of
from vestige.campaign.run_outcome import RunOutcome, run_outcome
from vestige.recording.observations.observation_file import ObservationTrack
from vestige.records import Status
from vestige.records.checks import AlarmShare, CheckName
from vestige.records.observation_epoch import ObservationEpoch
from vestige.scenario.scenario_processor import processor_of
from vestige.simulated.exported_case import AcasTestCase
from vestige.threats.recorded_scenes import RecordedScene

_SAME_S = 0.5  # half of the time in s between two epochs of E1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordedVerdicts:
    """Verdicts at one level for a recording of n epochs and m satellites, with the fields of `JudgedRun`."""

    status: Int8[np.ndarray, "n m"]
    state: Int8[np.ndarray, "n m"]  # state that a receiver shows to its user after an epoch
    recs: Bool[np.ndarray, " n"]
    seen: Bool[np.ndarray, "n m"]
    range_error_m: Float[np.ndarray, "n m"]
    tests: Mapping[CheckName | str, Bool[np.ndarray, "n m"]]
    failed: Mapping[CheckName | str, Bool[np.ndarray, "n m"]]
    time_s: Float[np.ndarray, " n"]  # time in s after the start of the scenario

    @property
    def budget(self) -> Mapping[CheckName | str, AlarmShare]:
        """Empty mapping, because a recording of some seconds is too short to count alarms per day."""
        return {}

    @property
    def begins(self) -> Bool[np.ndarray, " n"]:
        """Epochs with an alarm of any satellite that are the first epoch or follow an epoch without alarms."""
        return alarm_begins(self.state)

    def first_failures(self, rows: Bool[np.ndarray, " n"]) -> tuple[tuple[str, int], ...]:
        """Return the checks that failed in the epochs `rows`, each with its first failed epoch, in order of time."""
        return failures_in_order(self.failed, rows)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackedErrors:
    """Errors in m that an attack causes in the pseudoranges of m satellites at k times; NaN without tracking."""

    time_s: Float[np.ndarray, " k"]
    error_m: Float[np.ndarray, "k m"]

    def worst_m(self, column: int, after_s: float, to_s: float) -> float:
        """Return a satellite's error of largest magnitude after `after_s` and up to `to_s`; NaN without tracking."""
        here = (self.time_s > after_s + _SAME_S) & (self.time_s < to_s + _SAME_S)
        return worst_of(self.error_m[here, column])


def tracked_errors(recorded: RecordedScene, tracked: Sequence[ObservationEpoch]) -> TrackedErrors:
    """Return the errors that the attack of a scene caused in the tracked pseudoranges of its recording.

    Parameters
    ----------
    recorded
        Scene of the threat table as a recording.
    tracked
        Observations that a receiver made by tracking the samples of the recording.
    """
    case = AcasTestCase(
        scenario=recorded.scenario(attacked=False), first=recorded.recording.first_s, end=recorded.recording.end_s
    )
    epochs, svids, track = tuple(case.observations()), svids_of(recorded), ObservationTrack(tracked)
    error_m = np.full((len(epochs), len(svids)), np.nan)
    for row, epoch in enumerate(epochs):
        seen = track.at(epoch.time)
        for column, svid in enumerate(svids):
            if svid in seen and svid in epoch.observations:
                error_m[row, column] = seen[svid].pseudorange_m - epoch.observations[svid].pseudorange_m
    start = case.scenario.start_time
    return TrackedErrors(time_s=np.array([epoch.time - start for epoch in epochs]), error_m=error_m)


def svids_of(recorded: RecordedScene) -> tuple[int, ...]:
    """Return the SVIDs of the satellites of a recording, in ascending order."""
    return tuple(sorted(recorded.recording.svids))


def recorded_verdicts(recorded: RecordedScene, steps: Sequence[Step], errors: TrackedErrors) -> RecordedVerdicts:
    """Return the verdicts at one level for a recording.

    Parameters
    ----------
    recorded
        Scene of the threat table as a recording.
    steps
        Answers of the processor at each epoch, in order of time.
    errors
        Errors that the attack caused in the tracked pseudoranges.
    """
    svids, start, n = svids_of(recorded), recorded.scenario().start_time, len(steps)
    shape = (n, len(svids))
    status = np.full(shape, POSITION[Status.NOT_AVAILABLE], np.int8)
    state = status.copy()
    range_error_m = np.full(shape, np.nan)
    recs, time_s = np.zeros(n, np.bool_), np.zeros(n)
    tests: dict[CheckName | str, np.ndarray] = {}
    failed: dict[CheckName | str, np.ndarray] = {}
    before_s = -np.inf
    for row, step in enumerate(steps):
        block = step.block
        snapshots = block.measured.snapshots
        time_s[row], recs[row] = snapshots.time.at(0) - start, bool(snapshots.recs[0])
        for place, svid in enumerate(snapshots.svids):
            if svid not in svids:
                continue
            column = svids.index(svid)
            status[row, column], state[row, column] = block.status[0, place], block.state[0, place]
            for name, series in block.checks.items():
                of_check = (0,) if series.run.ndim == 1 else (0, place)
                tests.setdefault(name, np.zeros(shape, np.bool_))[row, column] = series.run[of_check]
                failed.setdefault(name, np.zeros(shape, np.bool_))[row, column] = block.failed[name][of_check]
            in_use_m = float(block.range_in_use_m[0, place])
            if not recs[row] or np.isnan(in_use_m):
                continue
            if block.earlier[0, place]:
                earlier_m = in_use_m - float(snapshots.e1.pseudorange_m[0, place])
                range_error_m[row, column] = earlier_m + errors.worst_m(column, time_s[row] - 1.0, time_s[row])
            else:
                range_error_m[row, column] = errors.worst_m(column, before_s, time_s[row])
        before_s = time_s[row] if recs[row] else before_s
    return RecordedVerdicts(
        status=status,
        state=state,
        recs=recs,
        seen=np.ones(shape, np.bool_),
        range_error_m=range_error_m,
        tests=tests,
        failed=failed,
        time_s=time_s,
    )


def recorded_outcome(recorded: RecordedScene, found: RecordedVerdicts) -> RunOutcome:
    """Return the outcome of a recorded attack, from its verdicts at one level."""
    scenario = recorded.scenario()
    begin_s, end_s = window_of(scenario)
    counted = (found.time_s >= begin_s) & (found.time_s < end_s)
    limit_m = processor_of(scenario).range_limit_m
    return run_outcome(found, found.time_s, counted, limit_m, np.full(found.time_s.size, np.nan))
