"""Mitigation levels: which checks a verdict rests on, and what follows from them [WFO, Sec. IV].

Theory of operation
-------------------
A level is a table of checks, one row each, with the paper's step, the status that follows when the check fails, what it
looks at (one satellite or the whole receiver), and how often.

* Level 1 is the minimum defence, steps 1 and 2: the true E6 signal is there, and where E1 says.
* Level 2 adds power and C/N0 monitoring (3), the vestigial search on E1 with hand-over to E6 (4), and the position fix:
  clock drift and RAIM (5).
* Level 3 adds OSNMA from a second channel (4), the exhaustive search on E6 (5), and what bridges the time between two
  RECS: power–distortion and inertial sensors (7). The paper has its steps 4 and 5 replace those of level 2 and numbers
  the fix 6. We keep the hand-over search: the exhaustive one takes minutes and is made at the start, on suspicion and
  every so often, and in between a second signal on E1 is suspicion.

Checks are evidence of different weight. One that finds a second signal, or E6 where E1 is not, says SPOOFED: somebody
sends what the satellite did not. No E6 at all is NOT_DETECTED. What jamming, a building or a bad oscillator might do
too is SUSPECT, and so is every other satellite when one is found twice: a meaconer repeats the whole band, and its copy
of a weak satellite may hide the true signal. Of several failures the gravest counts. A check that was not run is no
evidence: without steps 1 and 2 nothing follows (NOT_AVAILABLE); of the others the reason of the verdict says which are
missing. Between two RECS only the monitors speak.

A check that is known to err by itself now and then (power–distortion: 0.6 % [WESSON18]) has to fail `confirm` times in
a row. What a receiver shows its user is steadier still: `alarm.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from jaxtyping import Bool, Int8

from vestige.acas_processor.minimum_defence import Limits, check_e6_power, check_range
from vestige.measurement import Measurement
from vestige.records import CheckResult, Outcome, Status, Verdict


class Scope(Enum):
    """What one test of a check looks at."""

    SATELLITE = "satellite"
    RECEIVER = "receiver"


class Occasion(Enum):
    """When a check is made."""

    RECS = "RECS"
    OBSERVATION = "observation"  # every epoch of E1
    SUBFRAME = "subframe"  # every 30 s of navigation message
    SEARCH = "search"  # as `SearchSchedule` says


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One check of a level.

    Attributes
    ----------
    step
        Its number in [WFO, Sec. IV].
    name
        As in `CheckResult`.
    failure
        Status that follows if it fails.
    scope, occasion
        What one test looks at, and when it is made.
    confirm
        Tests in a row that must fail.
    spreads
        Whether a failure makes all other satellites SUSPECT: who sends one satellite twice may send them all.
    """

    step: int
    name: str
    failure: Status
    scope: Scope = Scope.SATELLITE
    occasion: Occasion = Occasion.OBSERVATION
    confirm: int = 1
    spreads: bool = False


_MINIMUM = (
    Row(step=1, name="E6 power", failure=Status.NOT_DETECTED, occasion=Occasion.RECS),
    Row(step=2, name="E1-E6 range", failure=Status.SPOOFED, occasion=Occasion.RECS),
)
_POWER = (
    Row(step=3, name="E1 received power", failure=Status.SUSPECT, scope=Scope.RECEIVER),
    Row(step=3, name="E6 received power", failure=Status.SUSPECT, scope=Scope.RECEIVER, occasion=Occasion.RECS),
    Row(step=3, name="C/N0", failure=Status.SUSPECT),
    Row(step=3, name="E6 C/N0", failure=Status.SUSPECT, occasion=Occasion.RECS),
    Row(step=3, name="wrong-code floor", failure=Status.SUSPECT, occasion=Occasion.RECS),
)
_HANDOVER_SEARCH = (
    Row(step=4, name="E6 second signal", failure=Status.SPOOFED, occasion=Occasion.RECS),
    Row(step=4, name="E1 vestigial search", failure=Status.SPOOFED, occasion=Occasion.RECS, spreads=True),
)
_FIX = tuple(
    Row(step=5, name=name, failure=Status.SUSPECT, scope=Scope.RECEIVER)
    for name in ("clock innovation", "clock consistency", "clock slope", "RAIM", "solution separation")
)
_SECOND_CHANNEL = (
    Row(step=4, name="OSNMA availability", failure=Status.SUSPECT, scope=Scope.RECEIVER, occasion=Occasion.SUBFRAME),
    Row(step=4, name="OSNMA reception", failure=Status.SUSPECT, scope=Scope.RECEIVER, occasion=Occasion.SUBFRAME),
    Row(step=4, name="OSNMA agreement", failure=Status.SPOOFED, scope=Scope.RECEIVER, occasion=Occasion.SUBFRAME),
)
_EXHAUSTIVE_SEARCH = (
    Row(step=5, name="E6 exhaustive search", failure=Status.SPOOFED, occasion=Occasion.SEARCH, spreads=True),
)
_BRIDGING = (
    Row(step=7, name="power-distortion", failure=Status.SUSPECT, confirm=3),
    Row(step=7, name="inertial range rate", failure=Status.SUSPECT),
)

LEVELS: dict[int, tuple[Row, ...]] = {
    1: _MINIMUM,
    2: (*_MINIMUM, *_POWER, *_HANDOVER_SEARCH, *_FIX),
    3: (*_MINIMUM, *_POWER, *_HANDOVER_SEARCH, *_SECOND_CHANNEL, *_EXHAUSTIVE_SEARCH, *_FIX, *_BRIDGING),
}

# From what says least to what says most; alarms are those from SUSPECT on
GRAVITY = (Status.NOT_AVAILABLE, Status.AUTHENTIC, Status.SUSPECT, Status.NOT_DETECTED, Status.SPOOFED)
ALARMS = GRAVITY[GRAVITY.index(Status.SUSPECT) :]

_REQUIRED = {row.name for row in _MINIMUM}
_POSITION = {status: position for position, status in enumerate(Status)}


def combine(level: int, checks: Sequence[CheckResult]) -> tuple[Status, str]:
    """Return what follows from the checks of a satellite in one epoch, and why.

    Parameters
    ----------
    level
        Mitigation level, a key of `LEVELS`.
    checks
        In any order; checks that are not of the level are not looked at. A failure counts as confirmed.
    """
    by_name = {check.name: check for check in checks}
    ours = [(row, by_name[row.name]) for row in LEVELS[level] if row.name in by_name]
    failures = [(row.failure, check.reason) for row, check in ours if check.outcome is Outcome.FAIL]
    if failures:
        return max(failures, key=lambda failure: GRAVITY.index(failure[0]))
    missing = [check for _, check in ours if check.outcome is Outcome.NOT_RUN]
    for check in missing:
        if check.name in _REQUIRED:
            return Status.NOT_AVAILABLE, check.reason
    if missing:
        return (
            Status.AUTHENTIC,
            f"all checks that could be run passed; not run: {', '.join(one.name for one in missing)}",
        )
    return Status.AUTHENTIC, "all checks passed"


def combine_block(
    level: int, failed: Mapping[str, Bool[np.ndarray, "..."]], available: Bool[np.ndarray, "n_epochs m"]
) -> Int8[np.ndarray, "n_epochs m"]:
    """Return what `combine` says of every epoch and satellite, as the position in `Status`.

    Parameters
    ----------
    failed
        Confirmed failures by name of the check, of each satellite or of the receiver; names that are not of the
        level are not looked at.
    available
        Whether steps 1 and 2 were run.
    """
    found = np.where(available, GRAVITY.index(Status.AUTHENTIC), GRAVITY.index(Status.NOT_AVAILABLE))
    for row in LEVELS[level]:
        if row.name in failed:
            of_row = failed[row.name]
            of_row = of_row[:, None] if of_row.ndim == 1 else of_row
            found = np.maximum(found, np.where(of_row, GRAVITY.index(row.failure), 0))
            if row.spreads:
                twice = np.any(of_row, axis=1, keepdims=True)
                found = np.maximum(found, np.where(twice, GRAVITY.index(Status.SUSPECT), 0))
    return np.array([_POSITION[status] for status in GRAVITY], np.int8)[found]


def confirmed_block(
    failed: Bool[np.ndarray, "*n"], run: Bool[np.ndarray, "*n"], confirm: int
) -> Bool[np.ndarray, "*n"]:
    """Return where a check failed `confirm` times in a row, epochs in which it was not run left out.

    Parameters
    ----------
    failed, run
        Whether it failed, and whether it was run.
    confirm
        As `Row`.
    """
    found = np.zeros(failed.shape, np.bool_)
    flat, made, out = (array.reshape(array.shape[0], -1) for array in (failed, run, found))
    for column in range(flat.shape[1]):
        rows = np.flatnonzero(made[:, column])
        row_failed = flat[rows, column]
        in_a_row = row_failed.copy()
        for back in range(1, confirm):
            in_a_row[back:] &= row_failed[:-back]
            in_a_row[:back] = False
        out[rows, column] = in_a_row
    return found


def decide(
    measurement: Measurement,
    level: int,
    limits: Limits,
    further: Mapping[int, Sequence[CheckResult]] | None = None,
    true_offset_m: Mapping[int, float] | None = None,
) -> tuple[Verdict, ...]:
    """Return one verdict for each satellite of a snapshot.

    Parameters
    ----------
    measurement
        What `AcasProcessor.measure` found.
    level
        Mitigation level, a key of `LEVELS`.
    limits
        Thresholds of steps 1 and 2.
    further
        The other checks of the level, by satellite; those of the receiver belong to every satellite.
    true_offset_m
        As in `Verdict`, by satellite.
    """
    every = {
        one.svid: (check_e6_power(one, limits), check_range(one, limits), *(further or {}).get(one.svid, ()))
        for one in measurement.satellites
    }
    twice = _seen_twice(level, every)
    verdicts = []
    for satellite in measurement.satellites:
        checks = every[satellite.svid]
        status, reason = combine(level, checks)
        if twice and GRAVITY.index(status) < GRAVITY.index(Status.SUSPECT):
            status, reason = Status.SUSPECT, f"{' '.join(f'E{svid:02d}' for svid in twice)}: more than one signal"
        verdicts.append(
            Verdict(
                index=measurement.index,
                time=measurement.time,
                available_at=satellite.available_at,
                svid=satellite.svid,
                level=level,
                status=status,
                checks=checks,
                range_offset_m=math.nan if satellite.detection is None else satellite.detection.range_offset_m,
                reason=reason,
                true_offset_m=(true_offset_m or {}).get(satellite.svid, math.nan),
            )
        )
    return tuple(verdicts)


def _seen_twice(level: int, checks: Mapping[int, Sequence[CheckResult]]) -> list[int]:
    """Return the satellites of which a search found more than one signal."""
    searches = {row.name for row in LEVELS[level] if row.spreads}
    return [
        svid
        for svid, own in checks.items()
        if any(check.name in searches and check.outcome is Outcome.FAIL for check in own)
    ]
