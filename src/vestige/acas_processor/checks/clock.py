"""Check whether the receiver clock changes by no more than the noise of its oscillator allows.

Theory of operation
-------------------
A position fix gives bias b and drift d of the receiver's clock, both multiplied by the speed of light c. The codes give
b with the standard deviation σ_b, and the carriers give d with the standard deviation σ_d. The errors of b and d are
independent. The oscillator has white (Sf) and random-walk (Sg) frequency noise [GALLEANI08]. Without an attack, the
three statistics have these variances, with the step Δt from one epoch to the next:

    innovation     d_k − d_{k−1}                            c² Sg Δt + 2 σ_d²
    consistency    b_k − b_{k−1} − ½(d_k + d_{k−1}) Δt      c² (Sf Δt + Sg Δt³/12) + 2 σ_b² + ½ σ_d² Δt²
    slope          least-squares slope of the last drifts   wᵀ C w,  C_ij = c² Sg min(t_i, t_j) + σ_d² δ_ij

w is the vector of the weights of the least-squares slope, and C is the covariance of the drifts at the times t_i. A
test fails if its statistic is more than K standard deviations from 0. The three tests share the budget P_fa equally,
and K follows from P_fa/3.

The innovation test detects a step of the drift. The consistency test detects a delay of the codes that the carriers do
not follow. The slope test detects a slow, steady change of the drift. An attack that changes code and carrier alike,
and more slowly than the random walk of the oscillator, is not detected. A receiver that steps its clock by whole
milliseconds must remove these steps from its measurements before the check.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int64

from vestige.acas_processor.checks.check import check_budget, series_of, two_sided_detection, two_sided_factor
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.monitoring.memory import RECEIVER, CheckMemory
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records.checks import CheckName, CheckSeries


class ClockHistory(NamedTuple):
    """The receiver clock at n epochs with a fix: time, bias and drift (both multiplied by c), and their variances."""

    time_s: Float[np.ndarray, " n"]
    bias_m: Float[np.ndarray, " n"]
    drift_mps: Float[np.ndarray, " n"]
    bias_variance: Float[np.ndarray, " n"]
    drift_variance: Float[np.ndarray, " n"]


class ClockStatistics(NamedTuple):
    """Statistics and thresholds of the three tests; a statistic is NaN after a gap or with too few epochs."""

    innovation: Float[np.ndarray, " n"]
    innovation_threshold: Float[np.ndarray, " n"]
    consistency: Float[np.ndarray, " n"]
    consistency_threshold: Float[np.ndarray, " n"]
    slope: Float[np.ndarray, " n"]
    slope_threshold: Float[np.ndarray, " n"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockDriftMonitor:
    """Monitor that compares changes of the receiver clock's bias and drift with the noise of its oscillator.

    The default is the clock of [WFO, Sec. V].
    """

    white_s: float = 7.115e-24 / 2  # Sf = h0/2, white frequency noise of the oscillator [WFO, Sec. V]
    # Sg = 2π² h−2, random-walk frequency noise of the oscillator [WFO, Sec. V]
    walk_hz: float = 2 * math.pi**2 * 4.311e-21
    window: int = 10  # number of epochs over which the slope is computed, 3 or more
    max_gap_s: float = 120.0  # longest step between epochs in s; the monitor begins anew after a longer gap
    p_fa: float = 1e-5  # false-alarm probability of one epoch, all three tests together

    def __post_init__(self) -> None:
        check_budget(self.p_fa)
        if self.window < 3:
            raise ValueError(f"a slope needs three epochs, found {self.window}")

    @property
    def factor(self) -> float:
        """K, the threshold of each of the three tests in standard deviations."""
        return two_sided_factor(self.p_fa / 3)

    def statistics(self, clock: ClockHistory) -> ClockStatistics:
        """Return statistics and thresholds of the tests; a statistic is NaN after a gap or with too few epochs."""
        step = np.diff(clock.time_s, prepend=np.nan)
        step = np.where((step > 0) & (step <= self.max_gap_s), step, np.nan)
        before = np.roll(clock.drift_mps, 1)
        drifts = clock.drift_variance + np.roll(clock.drift_variance, 1)
        biases = clock.bias_variance + np.roll(clock.bias_variance, 1)
        walk, white = SPEED_OF_LIGHT_MPS**2 * self.walk_hz, SPEED_OF_LIGHT_MPS**2 * self.white_s
        slope, slope_sigma = self._slopes(clock, step)
        return ClockStatistics(
            innovation=(clock.drift_mps - before) + 0 * step,
            innovation_threshold=self.factor * np.sqrt(walk * step + drifts),
            consistency=np.diff(clock.bias_m, prepend=np.nan) - (clock.drift_mps + before) / 2 * step,
            consistency_threshold=self.factor
            * np.sqrt(white * step + walk * step**3 / 12 + biases + drifts * step**2 / 4),
            slope=slope,
            slope_threshold=self.factor * slope_sigma,
        )

    def _slopes(
        self, clock: ClockHistory, step_s: Float[np.ndarray, " n"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        slope, sigma = np.full(step_s.size, np.nan), np.full(step_s.size, np.nan)
        if step_s.size >= self.window:
            t, d, variance = (
                np.ascontiguousarray(np.lib.stride_tricks.sliding_window_view(values, self.window))
                for values in (clock.time_s, clock.drift_mps, clock.drift_variance)
            )
            centred = t - t.mean(axis=1, keepdims=True)
            weight = centred / np.sum(centred**2, axis=1, keepdims=True)
            # Variance wᵀ min(t_i, t_j) w: a random walk is the sum of its steps, and each step changes all later drifts
            later = np.ascontiguousarray(np.cumsum(weight[:, ::-1], axis=1)[:, ::-1][:, 1:])
            steps = np.diff(t, axis=1)
            walk = SPEED_OF_LIGHT_MPS**2 * self.walk_hz * np.sum(later**2 * steps, axis=1)
            whole = np.all((steps > 0) & (steps <= self.max_gap_s), axis=1)
            slope[self.window - 1 :] = np.where(whole, np.sum(weight * d, axis=1), np.nan)
            sigma[self.window - 1 :] = np.sqrt(walk + np.sum(weight**2 * variance, axis=1))
        return slope, sigma

    def probability_of_detection(
        self, step_mps: Float[np.ndarray, "*n"], interval_s: float, sigma_drift_mps: float
    ) -> Float[np.ndarray, "*n"]:
        """Return the probability that the innovation test detects a step of the drift between two epochs."""
        sigma = math.sqrt(SPEED_OF_LIGHT_MPS**2 * self.walk_hz * interval_s + 2 * sigma_drift_mps**2)
        return two_sided_detection(step_mps / sigma, self.p_fa / 3)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockCheck:
    """One of the three tests of a `ClockDriftMonitor` as a check."""

    name: CheckName
    monitor: ClockDriftMonitor

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""
        return _PARTS[self.name][1]

    @property
    def p_fa(self) -> float:
        """False-alarm probability of one test."""
        return self.monitor.p_fa / 3

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block of epochs."""
        attribute, unit, what = _PARTS[self.name]
        history, rows = clock_history(evidence, self.monitor.window)
        found, before = self.monitor.statistics(history), history.time_s.size - rows.size
        statistic, threshold = np.full((2, evidence.shape[0]), np.nan)
        statistic[rows] = getattr(found, attribute)[before:]
        threshold[rows] = getattr(found, f"{attribute}_threshold")[before:]

        def explain(epoch: int, satellite: int) -> str:  # noqa: ARG001  (of the receiver)
            if epoch not in rows:
                return "no position fix, so no receiver clock"
            if np.isnan(statistic[epoch]):
                if self.name is CheckName.CLOCK_SLOPE:
                    return f"fewer than {self.monitor.window} position fixes in a row"
                return "no position fix shortly before"
            return f"{what} {statistic[epoch]:+.3g} {unit}, more than {threshold[epoch]:.3g} {unit}"

        fix = evidence.measured.fix
        return series_of(self, statistic, threshold, explain, exact=fix is not None and not fix.bounded)

    def remember(self, evidence: Evidence) -> CheckMemory:
        """Return the clock at the last epochs with a fix, in the order of `ClockHistory`."""
        history, _ = clock_history(evidence, self.monitor.window)
        rows = np.stack(history, axis=1)[-(self.monitor.window - 1) :]
        return {RECEIVER: tuple(rows.ravel().tolist())} if rows.size else {}


_PARTS = {
    CheckName.CLOCK_INNOVATION: ("innovation", "m/s", "the clock's drift jumped by"),
    CheckName.CLOCK_CONSISTENCY: ("consistency", "m", "the clock's bias differs from its prediction by"),
    CheckName.CLOCK_SLOPE: ("slope", "m/s²", "the clock's drift changes steadily by"),
}


def clock_history(evidence: Evidence, window: int) -> tuple[ClockHistory, Int64[np.ndarray, " k"]]:
    """Return the clock at the epochs with a fix, and the rows of the block that have a fix.

    The history begins with at most `window` − 1 epochs from earlier blocks.
    """
    fix = evidence.measured.fix
    rows = np.zeros(0, np.int64) if fix is None else np.flatnonzero(fix.fix.valid)
    own = (
        (np.zeros(0),) * 5
        if fix is None
        else (
            evidence.time_s[rows],
            fix.fix.clock_m[rows],
            fix.drift_mps[rows],
            fix.own_sigma_clock_m[rows] ** 2,
            fix.sigma_drift_mps[rows] ** 2,
        )
    )
    before = np.array(evidence.memory.get(RECEIVER, ())).reshape(-1, len(ClockHistory._fields))[-(window - 1) :]
    return ClockHistory(*(np.concatenate([old, new]) for old, new in zip(before.T, own, strict=True))), rows
