"""Define the checks of each mitigation level, and the status that follows from failed checks [WFO, Sec. IV].

Theory of operation
-------------------
A level is a table of checks. A row of the table gives the paper's step, the status after a failure, the scope (one
satellite or the whole receiver), and the times of the tests.

* Level 1 is the minimum defence: the true E6 signal is received (step 1), and its range agrees with E1 (step 2).
* Level 2 adds power and C/N0 monitoring (step 3), and the vestigial search on E1 with hand-over to E6 (step 4). The
  position fix gives the statistics of the clock checks and of RAIM (step 5).
* Level 3 adds OSNMA from a second channel (step 4) and the exhaustive search on E6 (step 5). Power–distortion and
  inertial sensors monitor the time between two RECS (step 7). In the paper, steps 4 and 5 of level 3 replace steps 4
  and 5 of level 2, and the fix is step 6. In contrast to the paper, vestige also makes the hand-over search at level 3,
  because the exhaustive search takes minutes. The exhaustive search is made at the start, at each RECS for which
  another check failed, and at least once in a configured period. A second signal that the search on E1 finds also leads
  to an exhaustive search.

Failures of different checks prove an attack with different certainty. A second signal, or an E6 range that differs from
E1, gives SPOOFED, because such signals do not come from the satellite. A missing E6 signal gives NOT_DETECTED. A
failure that jamming, a building or a bad oscillator may also cause gives SUSPECT. If a search finds a satellite twice,
every other satellite is at least SUSPECT, because a meaconer repeats the whole band. The repeated signal of a weak
satellite may hide the true signal. If several checks fail, the gravest failure counts. A check that was not run counts
neither for nor against an attack. If no check failed and step 1 was not run, the status is NOT_AVAILABLE. The reason of
an AUTHENTIC verdict names the checks that were not run. Between two RECS only the checks that need no RECS are run.

A row of the table contains all properties of a check that the processor needs. Three of these properties are the
function that makes the check from the settings, the use of reference levels, and the false-alarm probability. A new
check needs a class in `checks/`, a row in this file, and a member of `CheckName`. The settings of the check, if any,
are a field of `MonitoringSettings`. The checks of `OPTIONAL` belong to every level if their settings turn them on.

A check with frequent false alarms (power–distortion: 0.6 % [WESSON18]) has to fail `confirm` times in a row before the
failure counts. The state that a receiver shows its user changes even less often: see `alarm.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Bool, Int, Int8

from vestige.acas_processor.checks.check import Check
from vestige.acas_processor.checks.clock import ClockCheck
from vestige.acas_processor.checks.clock_limit import CLOCK_LIMIT_P_FA, ClockLimitMonitor
from vestige.acas_processor.checks.e1_e6_range import KAPPA, RangeCheck
from vestige.acas_processor.checks.e6_phase import E6PhaseMonitor
from vestige.acas_processor.checks.osnma import OsnmaAgreementMonitor
from vestige.acas_processor.checks.power.e6_fading import E6FadingMonitor
from vestige.acas_processor.checks.power.e6_misses import E6MissesCheck
from vestige.acas_processor.checks.power.e6_power import MIN_PD, E6PowerCheck
from vestige.acas_processor.checks.raim import RaimMonitor
from vestige.acas_processor.checks.solution_separation import SolutionSeparationMonitor
from vestige.records import Status
from vestige.records.checks import CheckName

if TYPE_CHECKING:
    from vestige.acas_processor.processor import AcasProcessor


class Scope(Enum):
    """Scope of one test of a check: a single satellite, or the whole receiver."""

    SATELLITE = "satellite"
    RECEIVER = "receiver"


class TestCadence(Enum):
    """Times at which a check is made."""

    __test__ = False  # pytest must not collect this class as a test

    RECS = "RECS"
    OBSERVATION = "observation"  # every epoch of E1
    SUBFRAME = "subframe"  # the end of each subframe of 30 s
    SEARCH = "search"  # RECS at which `searches.search_due` is true


class DetectionAssumptions(NamedTuple):
    """Assumptions from which the false-alarm probability of steps 1 and 2 follows."""

    kappa: float = KAPPA  # κ, factor of the range check
    pd: float = MIN_PD  # probability that E6 is detected
    bank_p_fa: float = 0.0  # probability that noise exceeds the detection threshold in any correlator of the bank


# Function that makes a check from the processor's settings and the false-alarm probability of one test. The function
# returns None if the settings do not allow the check.
CheckMaker = Callable[["AcasProcessor", float], Check | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckSpec:
    """Row in the table of a level: all properties of a check that the processor needs."""

    step: int  # number of the step in [WFO, Sec. IV]
    name: CheckName | str  # name of the check; a string if a user wrote the check
    failure: Status  # status after a failure
    # function that makes the check; None for the searches, which `assess` makes, and for checks that a user wrote
    make: CheckMaker | None = None
    scope: Scope = Scope.SATELLITE  # scope of one test
    cadence: TestCadence = TestCadence.OBSERVATION  # times at which a test is made
    confirm: int = 1  # number of tests in a row that must fail
    # whether a failure makes all other satellites SUSPECT, because an attacker may repeat all satellites
    suspects_all_satellites: bool = False
    # the check's own false-alarm probability of one test; None if the check has a share of the level's budget
    own_p_fa: Callable[[DetectionAssumptions], float] | None = None
    # part of the false-alarm probability that does not depend on the threshold of the check; used if the level's false
    # alarms a day are set
    fixed_p_fa: Callable[[DetectionAssumptions], float] | None = None
    settable: bool = True  # whether threshold or confirmation can be computed from the level's false alarms a day
    exact: bool = False  # whether the false-alarm probability is exact, and not an upper limit
    one_of: int = 1  # number of checks that share the false-alarm probability of a single monitor
    needs_references: bool = False  # whether the check compares with reference levels


_RECS, _RECEIVER, _SUBFRAME = TestCadence.RECS, Scope.RECEIVER, TestCadence.SUBFRAME
_SUSPECT, _SPOOFED = Status.SUSPECT, Status.SPOOFED


def _e6_power(processor: AcasProcessor, p_fa: float) -> Check:
    """Return the check of E6 power.

    By default the check fails at every missing signal that E1 predicts. If the false alarms a day are set, the check
    fails only after an improbable number of missing signals in a row.
    """
    if processor.monitoring.alarms_per_day is None:
        return E6PowerCheck(min_pd=processor.min_pd)
    return E6MissesCheck(p_fa=p_fa, prediction=processor.miss_prediction)


_MINIMUM = (
    CheckSpec(
        step=1,
        name=CheckName.E6_POWER,
        failure=Status.NOT_DETECTED,
        make=_e6_power,
        cadence=_RECS,
        own_p_fa=lambda assumed: 1 - assumed.pd,
    ),
    CheckSpec(
        step=2,
        name=CheckName.E1_E6_RANGE,
        failure=_SPOOFED,
        make=lambda processor, _: RangeCheck(budget=processor.budget, kappa=processor.range_kappa),
        cadence=_RECS,
        own_p_fa=lambda assumed: RangeCheck(kappa=assumed.kappa).p_fa + assumed.bank_p_fa,
        fixed_p_fa=lambda assumed: assumed.bank_p_fa,
    ),
)
_POWER = (
    CheckSpec(
        step=3,
        name=CheckName.E1_RECEIVED_POWER,
        failure=_SUSPECT,
        make=lambda processor, p_fa: replace(processor.monitoring.e1_power, p_fa=p_fa),
        scope=_RECEIVER,
        needs_references=True,
    ),
    CheckSpec(
        step=3,
        name=CheckName.E6_RECEIVED_POWER,
        failure=_SUSPECT,
        make=lambda processor, p_fa: replace(processor.monitoring.e6_power, p_fa=p_fa),
        scope=_RECEIVER,
        cadence=_RECS,
        needs_references=True,
    ),
    CheckSpec(
        step=3,
        name=CheckName.E1_CN0,
        failure=_SUSPECT,
        make=lambda processor, p_fa: replace(processor.monitoring.e1_cn0, p_fa=p_fa),
        needs_references=True,
    ),
    CheckSpec(
        step=3,
        name=CheckName.E6_CN0,
        failure=_SUSPECT,
        make=lambda processor, p_fa: replace(processor.monitoring.e6_cn0, p_fa=p_fa),
        cadence=_RECS,
        needs_references=True,
    ),
    CheckSpec(
        step=3,
        name=CheckName.NOISE_FLOOR,
        failure=_SUSPECT,
        make=lambda processor, p_fa: replace(processor.monitoring.noise_floor, p_fa=p_fa),
        cadence=_RECS,
        needs_references=True,
    ),
)


def _second_signal(processor: AcasProcessor, p_fa: float) -> Check | None:
    """Return the check for a second signal; None if a filter of the front end distorts the correlation function."""
    settings = processor.monitoring
    if settings.second_signal_filtered:
        return None
    return replace(settings.second_signal, p_fa=p_fa, reach_m=processor.late_reach_m)


_HANDOVER_SEARCH = (
    CheckSpec(step=4, name=CheckName.E6_SECOND_SIGNAL, failure=_SPOOFED, make=_second_signal, cadence=_RECS),
    CheckSpec(
        step=4, name=CheckName.E1_VESTIGIAL_SEARCH, failure=_SPOOFED, cadence=_RECS, suspects_all_satellites=True
    ),
)


def _clock(name: CheckName) -> CheckSpec:
    """Return the table row of one of the three tests of the receiver clock."""
    return CheckSpec(
        step=5,
        name=name,
        failure=_SUSPECT,
        make=lambda processor, p_fa: ClockCheck(name=name, monitor=replace(processor.monitoring.clock, p_fa=3 * p_fa)),
        scope=_RECEIVER,
        exact=True,
        one_of=3,
    )


_FIX = (
    _clock(CheckName.CLOCK_INNOVATION),
    _clock(CheckName.CLOCK_CONSISTENCY),
    _clock(CheckName.CLOCK_SLOPE),
    CheckSpec(
        step=5,
        name=CheckName.CLOCK_LIMIT,
        failure=_SUSPECT,
        make=lambda _, p_fa: ClockLimitMonitor(p_fa=p_fa),
        scope=_RECEIVER,
        own_p_fa=lambda _: CLOCK_LIMIT_P_FA,
        settable=False,
    ),
    CheckSpec(
        step=5,
        name=CheckName.RAIM,
        failure=_SUSPECT,
        make=lambda _, p_fa: RaimMonitor(p_fa=p_fa),
        scope=_RECEIVER,
        exact=True,
    ),
    CheckSpec(
        step=5,
        name=CheckName.SOLUTION_SEPARATION,
        failure=_SUSPECT,
        make=lambda _, p_fa: SolutionSeparationMonitor.of_budget(p_fa),
        scope=_RECEIVER,
    ),
)
_SECOND_CHANNEL = (
    CheckSpec(
        step=4,
        name=CheckName.OSNMA_AVAILABILITY,
        failure=_SUSPECT,
        make=lambda processor, p_fa: replace(processor.monitoring.osnma_availability, p_fa=p_fa),
        scope=_RECEIVER,
        cadence=_SUBFRAME,
    ),
    CheckSpec(
        step=4,
        name=CheckName.OSNMA_RECEPTION,
        failure=_SUSPECT,
        make=lambda processor, p_fa: replace(processor.monitoring.osnma_reception, p_fa=p_fa),
        scope=_RECEIVER,
        cadence=_SUBFRAME,
    ),
    CheckSpec(
        step=4,
        name=CheckName.OSNMA_AGREEMENT,
        failure=_SPOOFED,
        make=lambda _processor, _p_fa: OsnmaAgreementMonitor(),
        scope=_RECEIVER,
        cadence=_SUBFRAME,
        own_p_fa=lambda _: 2.0**-24,  # probability that CRC-24 passes a damaged page
        settable=False,
    ),
)
_EXHAUSTIVE_SEARCH = (
    CheckSpec(
        step=5,
        name=CheckName.E6_EXHAUSTIVE_SEARCH,
        failure=_SPOOFED,
        cadence=TestCadence.SEARCH,
        suspects_all_satellites=True,
    ),
)
_BRIDGING = (
    CheckSpec(
        step=7,
        name=CheckName.POWER_DISTORTION,
        failure=_SUSPECT,
        make=lambda processor, _: processor.monitoring.power_distortion,
        confirm=3,
        own_p_fa=lambda _: 0.006,  # [WESSON18]
        needs_references=True,
    ),
    CheckSpec(
        step=7,
        name=CheckName.INERTIAL_RANGE_RATE,
        failure=_SUSPECT,
        make=lambda processor, p_fa: replace(processor.monitoring.inertial, p_fa=p_fa),
    ),
)

LEVELS: dict[int, tuple[CheckSpec, ...]] = {
    1: _MINIMUM,
    2: (*_MINIMUM, *_POWER, *_HANDOVER_SEARCH, *_FIX),
    3: (*_MINIMUM, *_POWER, *_HANDOVER_SEARCH, *_SECOND_CHANNEL, *_EXHAUSTIVE_SEARCH, *_FIX, *_BRIDGING),
}
MINIMUM = tuple(spec.name for spec in _MINIMUM)
STEADY_P_FA = 1e-6  # false-alarm probability of one test of E6 phase or E6 fading


def _steady(name: CheckName, settings: Callable[[AcasProcessor], E6PhaseMonitor | E6FadingMonitor | None]) -> CheckSpec:
    """Return the table row of E6 phase or of E6 fading; `settings` returns None if the monitor is turned off."""

    def make(processor: AcasProcessor, p_fa: float) -> Check | None:
        monitor = settings(processor)
        return None if monitor is None else replace(monitor, p_fa=p_fa)

    return CheckSpec(
        step=8,  # number after the last step of [WFO, Sec. IV]; Sec. VI-B of the paper treats the phase
        name=name,
        failure=_SUSPECT,
        make=make,
        cadence=_RECS,
        own_p_fa=lambda _: STEADY_P_FA,
    )


# Checks that every level has if they are turned on. These checks do not reduce the budget of the other checks.
OPTIONAL = (
    _steady(CheckName.E6_PHASE, lambda processor: processor.monitoring.e6_phase),
    _steady(CheckName.E6_FADING, lambda processor: processor.monitoring.e6_fading),
)

# Statuses from the least grave to the gravest. SUSPECT and all graver statuses are alarms.
GRAVITY = (Status.NOT_AVAILABLE, Status.AUTHENTIC, Status.SUSPECT, Status.NOT_DETECTED, Status.SPOOFED)
ALARMS = GRAVITY[GRAVITY.index(Status.SUSPECT) :]
NO_CAUSE = -2  # value of a cause if no check failed
OTHERS = -1  # value of a cause if another satellite was found twice

POSITION = {status: place for place, status in enumerate(Status)}  # number that stands for a status in arrays
_BY_GRAVITY = np.array([POSITION[status] for status in GRAVITY], np.int8)


def is_alarm(status: Int[np.ndarray, "*n"]) -> Bool[np.ndarray, "*n"]:
    """Return for each status whether the status is an alarm; a status is given as its position in `Status`."""
    return np.isin(status, [POSITION[one] for one in ALARMS])


def combine(
    level: int,
    failed: Mapping[CheckName | str, Bool[np.ndarray, "*n"]],
    available: Bool[np.ndarray, "n m"],
    own: Sequence[CheckSpec] = (),
) -> tuple[Int8[np.ndarray, "n m"], Int8[np.ndarray, "n m"]]:
    """Return the status of each satellite at each epoch, and the check that caused the status.

    `failed` contains the confirmed failures of each satellite or of the receiver. Checks of other levels are ignored.
    `available` is True where step 1 was run. `own` contains the optional checks and the user's checks, which follow the
    checks of the level.

    Returns
    -------
    status, cause
        Statuses as positions in `Status`. The cause is the index of the check with the gravest failure in
        `LEVELS[level]` followed by `own`. Among equally grave failures the first failure is the cause. The cause is
        `OTHERS` if only another satellite, which was found twice, makes the satellite SUSPECT. Without a failure the
        cause is `NO_CAUSE`.
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
