"""Mitigation levels: which checks a verdict rests on [WFO, Sec. IV].

Level 1 is the minimum defence [WFO, Sec. IV-A]:

1. significant E6 correlation power at the offset that E1 predicts, against the post-correlation noise of a code that
   is not in the signal (so pushing up the power does not help an attacker);
2. the range difference between E1 and E6 within |offset| ≤ κσ [TAES2023, Eq. 21-24].

A verdict is AUTHENTIC only if every check of its level passed. A missing E6 signal is an alarm (NOT_DETECTED), unless
the C/N0 on E1 says that it would often be missed anyway: then nothing follows from it (NOT_AVAILABLE).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int8

from vestige.acas_processor.error_budget import ErrorBudget
from vestige.records import CheckResult, Measurement, Outcome, SatelliteMeasurement, Status, Verdict


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
    kappa: float = 3.0
    min_pd: float = 0.9


Check = Callable[[SatelliteMeasurement, Limits], CheckResult]


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


# Status that follows when this check fails, in order of the paper's steps
_FAILURE = {"E6 power": Status.NOT_DETECTED, "E1-E6 range": Status.SPOOFED}

_POSITION = {status: position for position, status in enumerate(Status)}

LEVELS: dict[int, tuple[Check, ...]] = {
    1: (check_e6_power, check_range),
}


def decide(measurement: Measurement, level: int, limits: Limits) -> tuple[Verdict, ...]:
    """Return one verdict for each satellite of a snapshot.

    Parameters
    ----------
    measurement
        What `AcasProcessor.measure` found.
    level
        Mitigation level, a key of `LEVELS`.
    limits
        Thresholds of the checks.
    """
    verdicts = []
    for satellite in measurement.satellites:
        checks = tuple(check(satellite, limits) for check in LEVELS[level])
        status, reason = _combine(checks, satellite)
        verdicts.append(
            Verdict(
                index=measurement.index,
                time=measurement.time,
                available_at=satellite.available_at,
                svid=satellite.svid,
                level=level,
                status=status,
                checks=checks,
                range_offset_m=float("nan") if satellite.detection is None else satellite.detection.range_offset_m,
                reason=reason,
            )
        )
    return tuple(verdicts)


def status_block(
    detected: Bool[np.ndarray, " n_epochs"],
    range_offset_m: Float[np.ndarray, " n_epochs"],
    predicted_pd: Float[np.ndarray, " n_epochs"],
    limits: Limits,
) -> Int8[np.ndarray, " n_epochs"]:
    """Return the level 1 status of a block of epochs, as the position in `Status`.

    It says of arrays what `decide` says of one measurement.

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
    near = np.abs(range_offset_m) <= limits.kappa * limits.budget.sigma_m
    found = np.where(near, _POSITION[Status.AUTHENTIC], _POSITION[Status.SPOOFED])
    missing = np.where(predicted_pd >= limits.min_pd, _POSITION[Status.NOT_DETECTED], _POSITION[Status.NOT_AVAILABLE])
    return np.where(detected, found, missing).astype(np.int8)


def _combine(checks: tuple[CheckResult, ...], satellite: SatelliteMeasurement) -> tuple[Status, str]:
    """Return the status and its reason: the first failure decides, then the first check that could not run."""
    if satellite.bank is None:
        return Status.NOT_AVAILABLE, satellite.unavailable
    for check in checks:
        if check.outcome is Outcome.FAIL:
            return _FAILURE[check.name], check.reason
    for check in checks:
        if check.outcome is Outcome.NOT_RUN:
            return Status.NOT_AVAILABLE, check.reason
    return Status.AUTHENTIC, "all checks passed"
