"""Check whether the range rate changes between two RECS as the accelerometers predict (inertial bridging).

Theory of operation
-------------------
Three causes change the pseudorange rate between two epochs: the satellite's motion, the receiver's motion, and the
receiver's clock. The ephemeris predicts Δ_satellite, the change for a receiver at rest:

    ρ̇₁ − ρ̇₀ = Δ_satellite − Δ(e·v) + Δdrift        e: unit vector to the satellite, v: velocity relative to the Earth
    Δ(e·v) = ē·∫a dt + Δe·v̄                         ē, v̄: means of the values at both ends, a: acceleration

The statistic of the test is ρ̇₁ − ρ̇₀ − Δ_satellite + Δ(e·v). Without an attack the statistic has the variance

    variance = σ_ρ̇,0² + σ_ρ̇,1² + (σ_bias T)² + N² T + c² Sg T

σ_ρ̇,0 and σ_ρ̇,1 are the standard deviations of the two range rates, and T is the time between the epochs. The standard
deviation of the accelerometers' bias is σ_bias, and the velocity random walk of the accelerometers is N. The frequency
random walk of the receiver's oscillator is Sg. The test fails if the magnitude of the statistic exceeds K standard
deviations, and K follows from `p_fa`. The test does not detect a pull-off that stays below the drift of oscillator and
accelerometers. The test also does not detect a pull-off after which the range rate has its earlier value at the next
epoch.

In this check an acceleration is the second derivative of the position relative to the Earth, without gravity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.checks.check import Monitor, series_of, two_sided_detection, two_sided_factor
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.monitoring.memory import CheckMemory
from vestige.acas_processor.position.inertial_bridging import rate_steps, remembered_rates
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records.checks import CheckName, CheckSeries


@dataclass(frozen=True, slots=True, kw_only=True)
class InertialMonitor(Monitor):
    """Monitor that compares the measured change of the range rate between two RECS with the expected change."""

    name: ClassVar = CheckName.INERTIAL_RANGE_RATE
    unit: ClassVar = "m/s"
    # standard deviation of the bias of the accelerometers along the line of sight
    sigma_bias_mps2: float = 0.01  # 1 mg, which is usual for a consumer sensor
    walk_mps_per_sqrt_s: float = 0.002  # N, velocity random walk of the accelerometers
    # Sg = 2π² h−2, frequency random walk of the receiver's oscillator; 0 if differences between satellites are tested
    clock_walk_hz: float = 2 * math.pi**2 * 4.311e-21  # [WFO, Sec. V]
    p_fa: float = 1e-6

    def sigma_mps(self, interval_s: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the standard deviation of the statistic after an interval T, as if the range rates had no errors."""
        walk = self.walk_mps_per_sqrt_s**2 + SPEED_OF_LIGHT_MPS**2 * self.clock_walk_hz
        return np.sqrt((self.sigma_bias_mps2 * interval_s) ** 2 + walk * interval_s)

    def threshold_mps(self, interval_s: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the largest |statistic| that passes after an interval T, as if the range rates had no errors."""
        return two_sided_factor(self.p_fa) * self.sigma_mps(interval_s)

    def statistic(
        self,
        rate_change_mps: Float[np.ndarray, "*n"],
        satellite_change_mps: Float[np.ndarray, "*n"],
        delta_velocity_mps: Float[np.ndarray, "*n"],
    ) -> Float[np.ndarray, "*n"]:
        """Return the measured minus the expected change of the range rate.

        `satellite_change_mps` is Δ_satellite, the change for a receiver at rest. `delta_velocity_mps` is Δ(e·v).
        """
        return rate_change_mps - satellite_change_mps + delta_velocity_mps

    def probability_of_detection(
        self, pull_mps: Float[np.ndarray, "*n"], interval_s: float, sigma_rate_mps: float
    ) -> Float[np.ndarray, "*n"]:
        """Return the probability that the monitor detects an attacker's change of the range rate after an interval."""
        sigma = np.hypot(self.sigma_mps(np.asarray([interval_s]))[0], math.sqrt(2) * sigma_rate_mps)
        return two_sided_detection(pull_mps / sigma, self.p_fa)

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results for a block; a result compares two consecutive epochs that have RECS and a position."""
        statistic, threshold = np.full((2, *evidence.shape), np.nan)
        steps = rate_steps(evidence)
        changes = steps.rate_change_mps, steps.static_change_mps, steps.delta_velocity_mps
        statistic[steps.epoch] = self.statistic(*changes)
        of_rates = two_sided_factor(self.p_fa) * steps.sigma_change_mps
        threshold[steps.epoch] = np.hypot(self.threshold_mps(steps.interval_s)[:, None], of_rates)

        def explain(epoch: int, satellite: int) -> str:
            if evidence.measured.snapshots.increments is None:
                return "no accelerations of inertial sensors"
            if np.isnan(statistic[epoch, satellite]):
                return steps.reasons.get(
                    epoch, "the range rate is not known at the beginning or the end of the interval"
                )
            return f"the range rate changed by {statistic[epoch, satellite]:+.2f} m/s more than the motion explains"

        return series_of(self, statistic, np.where(np.isnan(statistic), np.nan, threshold), explain)

    def remember(self, evidence: Evidence) -> CheckMemory:
        """Return the range rates at the last RECS, and the increments of velocity since the last RECS."""
        return remembered_rates(evidence)
