"""The minimum defence, steps 1 and 2 of every mitigation level [WFO, Sec. IV-A].

1. Significant E6 correlation power at the offset that E1 predicts, against the post-correlation noise of a code that is
   not in the signal, so that pushing up the power does not help an attacker.
2. The range difference between E1 and E6 within |offset| ≤ κσ [TAES2023, Eq. 21-24].

A missing E6 signal is an alarm, unless the C/N0 on E1 says that it would often be missed anyway: then nothing follows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from vestige.acas_processor.error_budget import ErrorBudget
from vestige.measurement import SatelliteMeasurement
from vestige.records import CheckResult, Outcome

KAPPA = 3.0
MIN_PD = 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What the checks compare with.

    Attributes
    ----------
    budget, kappa
        Error budget of the range difference, and its factor κ.
    min_pd
        Smallest predicted probability of detection with which a missing signal means anything.
    """

    budget: ErrorBudget
    kappa: float = KAPPA
    min_pd: float = MIN_PD


def check_e6_power(measurement: SatelliteMeasurement, limits: Limits) -> CheckResult:
    """Return whether the encrypted signal was found where E1 predicts it [WFO, Sec. IV-A, step 1]."""
    name, unit = "E6 power", "sigma"
    detection = measurement.detection
    if measurement.bank is None:
        return CheckResult(name=name, outcome=Outcome.NOT_RUN, unit=unit, reason=measurement.unavailable)
    if detection is not None:
        return CheckResult(
            name=name, outcome=Outcome.PASS, statistic=detection.magnitude, threshold=detection.threshold, unit=unit
        )
    if math.isnan(measurement.predicted_pd):
        reason = "C/N0 on E1 is not known, so nothing follows from a missing signal"
        return CheckResult(name=name, outcome=Outcome.NOT_RUN, unit=unit, reason=reason)
    if measurement.predicted_pd < limits.min_pd:
        reason = f"E1 predicts a detection probability of {measurement.predicted_pd:.2g} only, below {limits.min_pd:g}"
        return CheckResult(name=name, outcome=Outcome.NOT_RUN, unit=unit, reason=reason)
    return CheckResult(name=name, outcome=Outcome.FAIL, unit=unit, reason="no encrypted signal where E1 predicts it")


def check_range(measurement: SatelliteMeasurement, limits: Limits) -> CheckResult:
    """Return whether E6 arrives when E1 says, within κσ [WFO, Sec. IV-A, step 2]."""
    name, unit, limit = "E1-E6 range", "m", limits.kappa * limits.budget.sigma_m
    if measurement.detection is None:
        return CheckResult(name=name, outcome=Outcome.NOT_RUN, unit=unit, threshold=limit, reason="nothing detected")
    offset = measurement.detection.range_offset_m
    passed = abs(offset) <= limit
    return CheckResult(
        name=name,
        outcome=Outcome.PASS if passed else Outcome.FAIL,
        statistic=offset,
        threshold=limit,
        unit=unit,
        reason="" if passed else f"E6 is {offset:+.1f} m from where E1 puts it, more than {limit:.1f} m",
    )


def minimum_block(
    detected: Bool[np.ndarray, "*n"],
    range_offset_m: Float[np.ndarray, "*n"],
    predicted_pd: Float[np.ndarray, "*n"],
    limits: Limits,
) -> tuple[dict[str, Bool[np.ndarray, "*n"]], Bool[np.ndarray, "*n"]]:
    """Return which of the checks of step 1 and 2 failed in a block of epochs, and where they were run.

    Parameters
    ----------
    detected
        Whether the encrypted signal was found.
    range_offset_m
        Measured minus predicted range in m; not looked at where nothing was detected.
    predicted_pd
        Probability of detection that E1 predicts; NaN if it is not known or nothing was correlated.
    limits
        Thresholds of the checks.
    """
    missing = ~detected & (predicted_pd >= limits.min_pd)
    far = detected & (np.abs(range_offset_m) > limits.kappa * limits.budget.sigma_m)
    return {"E6 power": missing, "E1-E6 range": far}, detected | missing
