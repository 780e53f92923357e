"""Provide the common parts of all checks: the class `Check`, and thresholds from a false-alarm budget.

A check has a name, a unit, and a false-alarm probability `p_fa` of one test. The method `series` returns statistic and
threshold for a block of epochs. A check fails where |statistic| > threshold. If an input is missing, the check is not
run: the statistic or the threshold is NaN, and the check states the reason. A check that was not run counts neither for
nor against an attack.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int64
from scipy.special import bdtrc, ndtr, ndtri

from vestige.records.checks import CheckName, CheckSeries

if TYPE_CHECKING:
    from vestige.acas_processor.evidence import Evidence
    from vestige.acas_processor.monitoring.memory import CheckMemory


@runtime_checkable
class Check(Protocol):
    """Protocol of a check. Each check of vestige has a row in `levels.py` and a member of `CheckName`."""

    @property
    def name(self) -> CheckName | str:
        """Name of the check."""

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""

    @property
    def p_fa(self) -> float:
        """False-alarm probability of one test."""

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block of epochs."""


@runtime_checkable
class CheckWithMemory(Check, Protocol):
    """Protocol of a check that remembers numbers from one block of epochs to the next.

    The division of the epochs into blocks must not change any bit of the results. So the memory of a check contains all
    data that `series` needs from the epochs before a block.
    """

    def remember(self, evidence: Evidence) -> CheckMemory:
        """Return the memory after a block, which the check gets as `evidence.memory` with the next block."""


def check_budget(p_fa: float) -> None:
    """Raise ValueError unless a false-alarm probability lies between 0 and 1."""
    if not 0 < p_fa < 1:
        raise ValueError(f"a false-alarm probability lies between 0 and 1, found {p_fa}")


def series_of(
    check: Check,
    statistic: Float[np.ndarray, "*n"],
    threshold: Float[np.ndarray, "*n"],
    explain: Callable[[int, int], str],
    *,
    exact: bool = False,
) -> CheckSeries:
    """Return the results of a check for a block, with the name, unit and false-alarm probability of the check."""
    return CheckSeries(
        name=check.name,
        unit=check.unit,
        p_fa=check.p_fa,
        statistic=statistic,
        threshold=threshold,
        explain=explain,
        exact=exact,
    )


class Monitor:
    """A check whose false-alarm probability can be chosen."""

    __slots__ = ()

    def __post_init__(self: Check) -> None:
        check_budget(self.p_fa)


class _Level(Check, Protocol):
    @property
    def sigma_db(self) -> float: ...


class LevelMonitor(Monitor):
    """Two-sided monitor of a quantity L in dB, which passes if |ΔL| ≤ K σ.

    ΔL is L minus its expected value, K is `two_sided_factor(p_fa)`, and `sigma_db` is σ without interference. If the
    receiver learned the expected value, the limit is larger by the factor `Reference.growth`.
    """

    __slots__ = ()
    unit: ClassVar = "dB"

    @property
    def threshold_db(self: _Level) -> float:
        """Largest |ΔL| with which the monitor passes, in dB."""
        return two_sided_factor(self.p_fa) * self.sigma_db

    def probability_of_detection(self: _Level, change_db: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the probability that the monitor detects a change of the quantity by `change_db`."""
        return two_sided_detection(change_db / self.sigma_db, self.p_fa)


def two_sided_factor(p_fa: float) -> float:
    """Return K with P(|z| > K) = p_fa for a standard normal z."""
    return float(-ndtri(p_fa / 2))


def two_sided_detection(shift_sigma: Float[np.ndarray, "*n"], p_fa: float) -> Float[np.ndarray, "*n"]:
    """Return P(|z + shift| > K), the detection probability of a two-sided test of a normal statistic.

    K is `two_sided_factor(p_fa)`, z is standard normal, and `shift_sigma` is the shift of the mean.
    """
    factor = two_sided_factor(p_fa)
    return ndtr(shift_sigma - factor) + ndtr(-shift_sigma - factor)


def count_threshold(trials: int, probability: float, p_fa: float) -> int:
    """Return the smallest t with P(count > t) ≤ p_fa for a binomial count.

    Counts are whole numbers, so the false-alarm probability is at most `p_fa`, and mostly smaller.
    """
    counts = np.arange(trials + 1, dtype=np.float64)
    return int(np.argmax(bdtrc(counts, trials, probability) <= p_fa))


def confirmed(
    failed: Bool[np.ndarray, "*n"], run: Bool[np.ndarray, "*n"], confirm: int, before: Int64[np.ndarray, "*k"]
) -> Bool[np.ndarray, "*n"]:
    """Return at each epoch whether a check has failed in `confirm` tests in a row; epochs without a test are skipped.

    `before` is the number of failures in a row just before the block for each satellite, at most `confirm`.
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
