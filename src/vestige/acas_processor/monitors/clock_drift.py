"""The receiver clock as a witness: whether it runs as an oscillator of its kind can.

Theory of operation
-------------------
A position fix gives bias b and drift d of the receiver's clock (both times c), independently measured: b from codes
with σ_b, d from carriers with σ_d. An oscillator with white (Sf) and random-walk (Sg) frequency noise [GALLEANI08]
allows, over a step Δt,

    innovation     d_k − d_{k−1}                            c² Sg Δt + 2 σ_d²
    consistency    b_k − b_{k−1} − ½(d_k + d_{k−1}) Δt      c² (Sf Δt + Sg Δt³/12) + 2 σ_b² + ½ σ_d² Δt²
    slope          least-squares slope of the last drifts   wᵀ C w,  C_ij = c² Sg min(t_i, t_j) + σ_d² δ_ij

as variances, and each test fails beyond K of its standard deviation, the budget P_fa shared in equal parts.

The first sees a step of the drift, the second a time push of the codes that the carriers do not follow, the third a
drift that is pulled off slowly. A pull-off below the random walk of the oscillator is hidden in it, and a push that the
attacker plays consistently on code and carrier and slower than that is not seen at all. A receiver that steps its
clock by whole milliseconds must take the steps out first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.monitors.judgement import (
    check_budget,
    judged,
    not_run,
    two_sided_detection,
    two_sided_factor,
)
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records import CheckResult
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockEpoch:
    """Bias in m and drift in m/s of the receiver clock, as a fix gave them, at a time on the receiver's clock."""

    time: GalileoTime
    bias_m: float
    drift_mps: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockStatistics:
    """Statistics and thresholds of n epochs; NaN where there are not enough epochs before."""

    innovation_mps: Float[np.ndarray, " n"]
    innovation_threshold_mps: Float[np.ndarray, " n"]
    consistency_m: Float[np.ndarray, " n"]
    consistency_threshold_m: Float[np.ndarray, " n"]
    slope_mps2: Float[np.ndarray, " n"]
    slope_threshold_mps2: Float[np.ndarray, " n"]


@dataclass(frozen=True, slots=True)
class _Part:
    """One of the three tests, as a check."""

    name: str
    unit: str
    p_fa: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockDriftMonitor:
    """Whether bias and drift of the receiver clock are those of its oscillator.

    The default is the clock of [WFO, Sec. V].

    Attributes
    ----------
    white_s, walk_hz
        Sf = h0/2 and Sg = 2π² h−2 of the oscillator.
    sigma_bias_m, sigma_drift_mps
        Errors of the fix.
    window
        Epochs of the slope, three or more.
    max_gap_s
        Longest step; after a longer one the monitor begins anew.
    p_fa
        False-alarm probability of one epoch, all three tests together.
    """

    white_s: float = 7.115e-24 / 2  # [WFO, Sec. V]
    walk_hz: float = 2 * math.pi**2 * 4.311e-21  # [WFO, Sec. V]
    sigma_bias_m: float = 3.0
    sigma_drift_mps: float = 0.03
    window: int = 10
    max_gap_s: float = 120.0
    p_fa: float = 1e-5

    def __post_init__(self) -> None:
        check_budget(self.p_fa)
        if self.window < 3:
            raise ValueError(f"a slope needs three epochs, found {self.window}")

    @property
    def factor(self) -> float:
        """K of each of the three tests."""
        return two_sided_factor(self.p_fa / 3)

    def innovation_sigma_mps(self, step_s: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the standard deviation of d_k − d_{k−1}."""
        return np.sqrt(SPEED_OF_LIGHT_MPS**2 * self.walk_hz * step_s + 2 * self.sigma_drift_mps**2)

    def consistency_sigma_m(self, step_s: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the standard deviation of b_k − b_{k−1} − ½(d_k + d_{k−1}) Δt."""
        clock = SPEED_OF_LIGHT_MPS**2 * (self.white_s * step_s + self.walk_hz * step_s**3 / 12)
        return np.sqrt(clock + 2 * self.sigma_bias_m**2 + self.sigma_drift_mps**2 * step_s**2 / 2)

    def statistics(
        self, time_s: Float[np.ndarray, " n"], bias_m: Float[np.ndarray, " n"], drift_mps: Float[np.ndarray, " n"]
    ) -> ClockStatistics:
        """Return the three statistics of a block of epochs without gaps.

        Parameters
        ----------
        time_s
            Ascending, from any origin.
        bias_m, drift_mps
            Of the clock.
        """
        step = np.diff(time_s, prepend=np.nan)
        change, mean = np.diff(drift_mps, prepend=np.nan), (drift_mps + np.roll(drift_mps, 1)) / 2
        slope, slope_sigma = self._slopes(time_s, drift_mps)
        return ClockStatistics(
            innovation_mps=change,
            innovation_threshold_mps=self.factor * self.innovation_sigma_mps(step),
            consistency_m=np.diff(bias_m, prepend=np.nan) - mean * step,
            consistency_threshold_m=self.factor * self.consistency_sigma_m(step),
            slope_mps2=slope,
            slope_threshold_mps2=self.factor * slope_sigma,
        )

    def _slopes(
        self, time_s: Float[np.ndarray, " n"], drift_mps: Float[np.ndarray, " n"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        slope, sigma = np.full(time_s.size, np.nan), np.full(time_s.size, np.nan)
        if time_s.size >= self.window:
            t = np.lib.stride_tricks.sliding_window_view(time_s, self.window)
            d = np.lib.stride_tricks.sliding_window_view(drift_mps, self.window)
            centred = t - t.mean(axis=1, keepdims=True)
            weight = centred / np.sum(centred**2, axis=1, keepdims=True)
            slope[self.window - 1 :] = np.sum(weight * d, axis=1)
            # wᵀ min(t_i, t_j) w, as a random walk is the sum of its steps: each step moves all later drifts
            later = np.cumsum(weight[:, ::-1], axis=1)[:, ::-1][:, 1:]
            walk = SPEED_OF_LIGHT_MPS**2 * self.walk_hz * np.sum(later**2 * np.diff(t, axis=1), axis=1)
            sigma[self.window - 1 :] = np.sqrt(walk + self.sigma_drift_mps**2 * np.sum(weight**2, axis=1))
        return slope, sigma

    def probability_of_detection(self, step_mps: Float[np.ndarray, "*n"], interval_s: float) -> Float[np.ndarray, "*n"]:
        """Return the probability that the innovation test sees a step of the drift between two epochs."""
        sigma = self.innovation_sigma_mps(np.asarray([interval_s]))[0]
        return two_sided_detection(step_mps / sigma, self.p_fa / 3)

    def step(
        self, history: tuple[ClockEpoch, ...], epoch: ClockEpoch | None
    ) -> tuple[tuple[ClockEpoch, ...], tuple[CheckResult, ...]]:
        """Return the history with an epoch added, and the three checks of it.

        Parameters
        ----------
        history
            What this function returned before; `()` at first.
        epoch
            None if there is no fix.
        """
        parts = tuple(
            _Part(name, unit, self.p_fa / 3)
            for name, unit in (("clock innovation", "m/s"), ("clock consistency", "m"), ("clock slope", "m/s²"))
        )
        if epoch is None:
            return history, tuple(not_run(part, "no position fix, so no receiver clock") for part in parts)
        if history and not 0 < epoch.time - history[-1].time <= self.max_gap_s:
            history = ()
        history = (*history, epoch)[-self.window :]
        if len(history) == 1:
            return history, tuple(not_run(part, "no epoch shortly before") for part in parts)
        found = self.statistics(
            np.array([one.time - history[0].time for one in history]),
            np.array([one.bias_m for one in history]),
            np.array([one.drift_mps for one in history]),
        )
        pairs = (
            (found.innovation_mps, found.innovation_threshold_mps, "the clock's drift jumped by"),
            (found.consistency_m, found.consistency_threshold_m, "the clock's bias left its drift by"),
            (found.slope_mps2, found.slope_threshold_mps2, "the clock's drift is pulled at"),
        )
        results = []
        for part, (value, limit, what) in zip(parts, pairs, strict=True):
            statistic, threshold = float(value[-1]), float(limit[-1])
            if math.isnan(statistic):
                results.append(not_run(part, f"fewer than {self.window} epochs in a row"))
            else:
                failure = f"{what} {statistic:+.3g} {part.unit}, more than {threshold:.3g} {part.unit}"
                results.append(judged(part, statistic, threshold, failure))
        return history, tuple(results)
