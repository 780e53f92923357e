"""What all checks share: thresholds from a false-alarm budget, and the result of one comparison.

A check has a name, a unit, a false-alarm probability `p_fa` per test, a statistic (a function of arrays over epochs)
and a threshold; it fails where |statistic| > threshold. Where an input is missing it does not run, and says why: a
check that was not run is no evidence of anything.
"""

from __future__ import annotations

import math
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from scipy.special import bdtrc, ndtr, ndtri

from vestige.records import CheckResult, Outcome


@runtime_checkable
class Monitor(Protocol):
    """A check: what it is called, in what unit it measures, how often it may be wrong."""

    @property
    def name(self) -> str:
        """Name in `CheckResult`."""
        ...

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""
        ...

    @property
    def p_fa(self) -> float:
        """False-alarm probability of one test."""
        ...


def check_budget(p_fa: float) -> None:
    """Raise ValueError unless a false-alarm probability lies between 0 and 1."""
    if not 0 < p_fa < 1:
        raise ValueError(f"a false-alarm probability lies between 0 and 1, found {p_fa}")


def two_sided_factor(p_fa: float) -> float:
    """Return K with P(|z| > K) = p_fa for a standard normal z."""
    return float(-ndtri(p_fa / 2))


def two_sided_detection(shift_sigma: Float[np.ndarray, "*n"], p_fa: float) -> Float[np.ndarray, "*n"]:
    """Return P(|z + shift| > K), the detection probability of a two-sided test of a normal statistic."""
    factor = two_sided_factor(p_fa)
    return ndtr(shift_sigma - factor) + ndtr(-shift_sigma - factor)


def count_threshold(trials: int, probability: float, p_fa: float) -> int:
    """Return the smallest t with P(count > t) ≤ p_fa for a binomial count.

    Counts are whole, so the false-alarm probability is at most the budget, not equal to it.
    """
    counts = np.arange(trials + 1, dtype=np.float64)
    return int(np.argmax(bdtrc(counts, trials, probability) <= p_fa))


def judged(monitor: Monitor, statistic: float, threshold: float, failure: str) -> CheckResult:
    """Return the result of |statistic| ≤ threshold; `failure` is the reason if it is not so.

    A statistic that is no number was not measured.
    """
    if math.isnan(statistic):
        return not_run(monitor, "the statistic could not be computed", threshold)
    passed = abs(statistic) <= threshold
    return CheckResult(
        name=monitor.name,
        outcome=Outcome.PASS if passed else Outcome.FAIL,
        statistic=statistic,
        threshold=threshold,
        unit=monitor.unit,
        reason="" if passed else failure,
    )


def not_run(monitor: Monitor, reason: str, threshold: float = math.nan) -> CheckResult:
    """Return that a check was not run, and why."""
    return CheckResult(
        name=monitor.name, outcome=Outcome.NOT_RUN, threshold=threshold, unit=monitor.unit, reason=reason
    )
