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
  the fix 6. vestige keeps the hand-over search: the exhaustive one takes minutes and is made at the start, on suspicion
  and every so often, and in between a second signal on E1 is suspicion.

Checks are evidence of different weight. A check that finds a second signal, or E6 where E1 is not, says SPOOFED:
somebody sends what the satellite did not. No E6 at all is NOT_DETECTED. What jamming, a building or a bad oscillator
might do too is SUSPECT, and so is every other satellite when one is found twice: a meaconer repeats the whole band, and
its copy of a weak satellite may hide the true signal. Of several failures the gravest counts. A check that was not run
is no evidence: without steps 1 and 2 nothing follows (NOT_AVAILABLE); of the others the reason of the verdict says
which are missing. Between two RECS only the monitors speak.

A check that is known to err by itself now and then (power–distortion: 0.6 % [WESSON18]) has to fail `confirm` times in
a row. What a receiver shows its user is steadier still: `alarm.py`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from jaxtyping import Bool, Int, Int8, Int64

from vestige.records import Status
from vestige.records.checks import CheckName


class Scope(Enum):
    """What one test of a check looks at."""

    SATELLITE = "satellite"
    RECEIVER = "receiver"


class TestCadence(Enum):
    """When a check is made."""

    __test__ = False  # not a test of pytest

    RECS = "RECS"
    OBSERVATION = "observation"  # every epoch of E1
    SUBFRAME = "subframe"  # every 30 s of navigation message
    SEARCH = "search"  # as `searches.search_due` says


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckSpec:
    """One check of a level."""

    step: int  # its number in [WFO, Sec. IV].
    name: CheckName | str  # the check; a text of one that a user wrote
    failure: Status  # status that follows if it fails
    # what one test looks at, and when it is made
    scope: Scope = Scope.SATELLITE
    cadence: TestCadence = TestCadence.OBSERVATION
    confirm: int = 1
    # whether a failure makes all other satellites SUSPECT: who sends one satellite twice may send them all
    suspects_all_satellites: bool = False


_RECS, _RECEIVER, _SUBFRAME = TestCadence.RECS, Scope.RECEIVER, TestCadence.SUBFRAME
_MINIMUM = (
    CheckSpec(step=1, name=CheckName.E6_POWER, failure=Status.NOT_DETECTED, cadence=_RECS),
    CheckSpec(step=2, name=CheckName.E1_E6_RANGE, failure=Status.SPOOFED, cadence=_RECS),
)
_POWER = (
    CheckSpec(step=3, name=CheckName.E1_RECEIVED_POWER, failure=Status.SUSPECT, scope=_RECEIVER),
    CheckSpec(step=3, name=CheckName.E6_RECEIVED_POWER, failure=Status.SUSPECT, scope=_RECEIVER, cadence=_RECS),
    CheckSpec(step=3, name=CheckName.E1_CN0, failure=Status.SUSPECT),
    CheckSpec(step=3, name=CheckName.E6_CN0, failure=Status.SUSPECT, cadence=_RECS),
    CheckSpec(step=3, name=CheckName.NOISE_FLOOR, failure=Status.SUSPECT, cadence=_RECS),
)
_HANDOVER_SEARCH = (
    CheckSpec(step=4, name=CheckName.E6_SECOND_SIGNAL, failure=Status.SPOOFED, cadence=_RECS),
    CheckSpec(
        step=4, name=CheckName.E1_VESTIGIAL_SEARCH, failure=Status.SPOOFED, cadence=_RECS, suspects_all_satellites=True
    ),
)
_FIX = tuple(
    CheckSpec(step=5, name=name, failure=Status.SUSPECT, scope=_RECEIVER)
    for name in (
        CheckName.CLOCK_INNOVATION,
        CheckName.CLOCK_CONSISTENCY,
        CheckName.CLOCK_SLOPE,
        CheckName.RAIM,
        CheckName.SOLUTION_SEPARATION,
    )
)
_SECOND_CHANNEL = (
    CheckSpec(step=4, name=CheckName.OSNMA_AVAILABILITY, failure=Status.SUSPECT, scope=_RECEIVER, cadence=_SUBFRAME),
    CheckSpec(step=4, name=CheckName.OSNMA_RECEPTION, failure=Status.SUSPECT, scope=_RECEIVER, cadence=_SUBFRAME),
    CheckSpec(
        step=4,
        name=CheckName.OSNMA_AGREEMENT,
        failure=Status.SPOOFED,
        scope=_RECEIVER,
        cadence=_SUBFRAME,
    ),
)
_EXHAUSTIVE_SEARCH = (
    CheckSpec(
        step=5,
        name=CheckName.E6_EXHAUSTIVE_SEARCH,
        failure=Status.SPOOFED,
        cadence=TestCadence.SEARCH,
        suspects_all_satellites=True,
    ),
)
_BRIDGING = (
    CheckSpec(step=7, name=CheckName.POWER_DISTORTION, failure=Status.SUSPECT, confirm=3),
    CheckSpec(step=7, name=CheckName.INERTIAL_RANGE_RATE, failure=Status.SUSPECT),
)

LEVELS: dict[int, tuple[CheckSpec, ...]] = {
    1: _MINIMUM,
    2: (*_MINIMUM, *_POWER, *_HANDOVER_SEARCH, *_FIX),
    3: (*_MINIMUM, *_POWER, *_HANDOVER_SEARCH, *_SECOND_CHANNEL, *_EXHAUSTIVE_SEARCH, *_FIX, *_BRIDGING),
}
MINIMUM = tuple(spec.name for spec in _MINIMUM)

# From what says least to what says most; alarms are those from SUSPECT on
GRAVITY = (Status.NOT_AVAILABLE, Status.AUTHENTIC, Status.SUSPECT, Status.NOT_DETECTED, Status.SPOOFED)
ALARMS = GRAVITY[GRAVITY.index(Status.SUSPECT) :]
NO_CAUSE = -2  # as a cause: nothing failed
OTHERS = -1  # as a cause: another satellite was found twice

POSITION = {status: place for place, status in enumerate(Status)}  # how arrays write a status
_BY_GRAVITY = np.array([POSITION[status] for status in GRAVITY], np.int8)


def is_alarm(status: Int[np.ndarray, "*n"]) -> Bool[np.ndarray, "*n"]:
    """Return whether statuses, as positions in `Status`, are alarms."""
    return np.isin(status, [POSITION[one] for one in ALARMS])


def combine(
    level: int,
    failed: Mapping[CheckName | str, Bool[np.ndarray, "*n"]],
    available: Bool[np.ndarray, "n m"],
    own: Sequence[CheckSpec] = (),
) -> tuple[Int8[np.ndarray, "n m"], Int8[np.ndarray, "n m"]]:
    """Return what follows for every epoch and satellite, as positions in `Status`, and which check it follows from.

    `failed` holds the confirmed failures, of each satellite or of the receiver; checks that are not of the level are
    not looked at. `available` says whether steps 1 and 2 were run. `own` are the user's checks, which the level has
    after those of vestige.

    Returns
    -------
    status, cause
        The cause is a place in `LEVELS[level]` with `own` behind it, the first of the gravest; `OTHERS` or `NO_CAUSE`.
    """
    found = np.where(available, GRAVITY.index(Status.AUTHENTIC), GRAVITY.index(Status.NOT_AVAILABLE))
    cause = np.full(found.shape, NO_CAUSE, np.int8)
    suspect = GRAVITY.index(Status.SUSPECT)
    twice = np.zeros((found.shape[0], 1), np.bool_)
    for place, spec in enumerate((*LEVELS[level], *own)):
        if spec.name not in failed:
            continue
        of_check = failed[spec.name]
        of_check = of_check[:, None] if of_check.ndim == 1 else of_check
        graver = of_check & (GRAVITY.index(spec.failure) > found)
        found = np.where(graver, GRAVITY.index(spec.failure), found)
        cause = np.where(graver, place, cause).astype(np.int8)
        if spec.suspects_all_satellites:
            twice |= np.any(of_check, axis=1, keepdims=True)
    spread = twice & (found < suspect)
    return _BY_GRAVITY[np.where(spread, suspect, found)], np.where(spread, OTHERS, cause).astype(np.int8)


def confirmed(
    failed: Bool[np.ndarray, "*n"], run: Bool[np.ndarray, "*n"], confirm: int, before: Int64[np.ndarray, "*k"]
) -> Bool[np.ndarray, "*n"]:
    """Return where a check failed `confirm` times in a row, epochs in which it was not run left out.

    `before` says how many of a satellite's last tests before the block failed in a row, at most `confirm`.
    """
    out = np.zeros(failed.shape, np.bool_)
    flat_failed, flat_run, flat_out = (array.reshape(array.shape[0], -1) for array in (failed, run, out))
    for column, streak in enumerate(np.ravel(before).tolist()):
        rows = np.flatnonzero(flat_run[:, column])
        padded = np.concatenate(
            [np.zeros(confirm, np.bool_), np.ones(int(streak), np.bool_), flat_failed[rows, column]]
        )
        in_a_row = np.logical_and.reduce(np.lib.stride_tricks.sliding_window_view(padded, confirm), axis=1)
        flat_out[rows, column] = in_a_row[in_a_row.size - rows.size :]
    return out
