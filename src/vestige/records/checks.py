"""Define the names of the checks, and the results of a check over many epochs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum, StrEnum

import numpy as np
from jaxtyping import Bool, Float

from vestige.records import CheckResult, Outcome


class CheckName(StrEnum):
    """Names of all checks of the mitigation levels.

    Every new check of vestige adds a member.
    """

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
    """Results of a check at n epochs, for the whole receiver or for each satellite.

    The arrays have the axis epoch for the whole receiver, and the axes epoch and satellite otherwise.

    Attributes
    ----------
    name
        Name of the check: a `CheckName`, or the name of a check that a user wrote.
    unit
        Unit of statistic and threshold.
    p_fa
        False-alarm probability of one test.
    statistic, threshold
        Statistic and threshold of each test, float64 of equal shape. The check was not run where the statistic, the
        threshold or both are NaN. A test fails where |statistic| > threshold.
    explain
        Function that returns the reason why the check failed, or was not run, at an epoch and satellite.
    exact
        Whether `p_fa` is exact; otherwise `p_fa` is an upper limit.
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
        """Whether the check concerns the whole receiver and not each satellite."""
        return self.statistic.ndim == 1

    def place(self, epoch: int, satellite: int) -> tuple[int, ...]:
        """Return the index of an epoch and a satellite in `statistic` and `threshold`."""
        return (epoch,) if self.of_receiver else (epoch, satellite)

    def result(self, epoch: int, satellite: int) -> CheckResult:
        """Return the result of the check at one epoch for one satellite, with the reason unless the check passed."""
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
    """Share of a check in the false alarms of a level."""

    p_fa: float  # false-alarm probability of one test, before confirmation
    confirm: int = 1  # number of tests in a row that must fail before the check fails
    alarms_a_day: float  # upper limit of the false alarms a day, after confirmation
    chosen: bool  # True if p_fa is a share of the level's budget, False if the check sets its own p_fa
    exact: bool = False  # whether p_fa is exact; otherwise p_fa is an upper limit

    @property
    def confirmed_p_fa(self) -> float:
        """Probability that `confirm` independent tests in a row fail without an attack."""
        return self.p_fa**self.confirm
