"""Names of the checks, and the result of one check over many epochs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum, StrEnum

import numpy as np
from jaxtyping import Bool, Float

from vestige.records import CheckResult, Outcome


class CheckName(StrEnum):
    """Every check that a mitigation level may have; a new check is a new member."""

    E6_POWER = "E6 power"
    E1_E6_RANGE = "E1-E6 range"
    E1_RECEIVED_POWER = "E1 received power"
    E6_RECEIVED_POWER = "E6 received power"
    E1_CN0 = "C/N0"
    E6_CN0 = "E6 C/N0"
    NOISE_FLOOR = "post-correlation noise floor"
    E6_SECOND_SIGNAL = "E6 second signal"
    E1_VESTIGIAL_SEARCH = "E1 vestigial search"
    OSNMA_AVAILABILITY = "OSNMA availability"
    OSNMA_RECEPTION = "OSNMA reception"
    OSNMA_AGREEMENT = "OSNMA agreement"
    E6_EXHAUSTIVE_SEARCH = "E6 exhaustive search"
    CLOCK_INNOVATION = "clock innovation"
    CLOCK_CONSISTENCY = "clock consistency"
    CLOCK_SLOPE = "clock slope"
    CLOCK_LIMIT = "clock limit"
    RAIM = "RAIM"
    SOLUTION_SEPARATION = "solution separation"
    POWER_DISTORTION = "power-distortion"
    INERTIAL_RANGE_RATE = "inertial range rate"
    E6_PHASE = "E6 phase"
    E6_FADING = "E6 fading"


class SignalClass(IntEnum):
    """Class of a received signal, by its power and distortion."""

    CLEAN = 0
    MULTIPATH = 1
    SPOOFED = 2
    JAMMED = 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CheckSeries:
    """One check over n epochs, of the receiver (axes: epoch) or of each satellite (axes: epoch, satellite).

    Attributes
    ----------
    name, unit
        Name of the check, a `CheckName` or the name of a check that a user wrote, and the unit of statistic and
        threshold.
    p_fa
        False-alarm probability of one test.
    statistic, threshold
        float64 of one shape; NaN where the check was not run. It fails where |statistic| > threshold.
    explain
        Writes why the check failed, or was not run, at an epoch and satellite; reasons are written when asked for.
    exact
        Whether p_fa is met exactly; otherwise it is an upper limit.
    """

    name: CheckName | str
    unit: str
    p_fa: float
    statistic: Float[np.ndarray, "*n"]
    threshold: Float[np.ndarray, "*n"]
    explain: Callable[[int, int], str]
    exact: bool = True

    @property
    def run(self) -> Bool[np.ndarray, "*n"]:
        """Whether the check was run."""
        return ~(np.isnan(self.statistic) | np.isnan(self.threshold))

    @property
    def failed(self) -> Bool[np.ndarray, "*n"]:
        """Whether the check was run and failed."""
        return self.run & (np.abs(self.statistic) > self.threshold)

    @property
    def of_receiver(self) -> bool:
        """Whether it looks at the whole receiver and not at each satellite."""
        return self.statistic.ndim == 1

    def place(self, epoch: int, satellite: int) -> tuple[int, ...]:
        """Return where an epoch and satellite stand in the arrays."""
        return (epoch,) if self.of_receiver else (epoch, satellite)

    def result(self, epoch: int, satellite: int) -> CheckResult:
        """Return the check of one epoch and satellite, with its reason."""
        here = self.place(epoch, satellite)
        run, failed = bool(self.run[here]), bool(self.failed[here])
        return CheckResult(
            name=self.name,
            outcome=Outcome.FAIL if failed else Outcome.PASS if run else Outcome.NOT_RUN,
            statistic=float(self.statistic[here]),
            threshold=float(self.threshold[here]),
            unit=self.unit,
            reason=self.explain(epoch, satellite) if failed or not run else "",
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmShare:
    """Share of one check in the false alarms that a level may raise."""

    p_fa: float  # false-alarm probability of one test, before confirmation
    confirm: int = 1  # how many tests in a row must fail
    alarms_a_day: float  # at most, after confirmation
    chosen: bool  # whether p_fa is a share of the level's budget, or the check's own
    exact: bool = False  # whether failures come as often as p_fa says; otherwise it is an upper limit

    @property
    def confirmed_p_fa(self) -> float:
        """Probability that a test fails without an attack and confirms the failures before it."""
        return self.p_fa**self.confirm
