"""Inertial bridging: whether the range rate changes between two RECS as the accelerometers say.

Theory of operation
-------------------
Between two epochs the rate of the pseudorange changes by the satellite's motion, which the ephemeris predicts for a
receiver that does not accelerate, by the receiver's acceleration along the line of sight, and by its clock:

    ρ̇₁ − ρ̇₀ = Δ_satellite − Δ(e·v) + Δdrift        e: unit vector to the satellite, v: velocity against the Earth
    Δ(e·v) = ē·∫a dt + Δe·v̄                         ē, v̄: means over the interval, a: acceleration

so the difference of both sides is bounded by what is left of each:

    variance = 2 σ_ρ̇² + (σ_bias T)² + N² T + c² Sg T

with σ_bias the accelerometers' bias, N their velocity random walk and Sg that of the receiver's oscillator. The test
fails beyond K standard deviations. A pull-off that stays below the oscillator's and the accelerometers' drift, and one
that is over before the next epoch with the rate back where it was, are not seen.

Accelerations are kinematic: the second derivative of the place against the Earth, gravity taken off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.monitors.judgement import (
    check_budget,
    judged,
    two_sided_detection,
    two_sided_factor,
)
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records import CheckResult


def gained_towards_mps(
    before: Float[np.ndarray, "*n m 3"],
    now: Float[np.ndarray, "*n m 3"],
    gained_mps: Float[np.ndarray, "*n 3"],
    mean_mps: Float[np.ndarray, "*n 3"],
) -> Float[np.ndarray, "*n m"]:
    """Return the velocity gained towards satellites, Δ(e·v) = ē·Δv + Δe·v̄: who moves sees the line of sight turn.

    Parameters
    ----------
    before, now
        e, unit vectors to the satellites at both ends.
    gained_mps, mean_mps
        Δv = ∫ a dt and the mean velocity of the receiver, all in one system of axes.
    """
    own = np.einsum("...mi,...i->...m", (before + now) / 2, gained_mps)
    return own + np.einsum("...mi,...i->...m", now - before, mean_mps)


@dataclass(frozen=True, slots=True, kw_only=True)
class InertialMonitor:
    """Whether the range rate between two RECS changed as accelerometers and ephemeris say.

    Attributes
    ----------
    sigma_rate_mps
        Error of a range rate.
    sigma_bias_mps2
        Bias of the accelerometers along the line of sight, 1σ.
    walk_mps_per_sqrt_s
        N, their velocity random walk.
    clock_walk_hz
        Sg = 2π² h−2 of the receiver's oscillator; 0 for differences between satellites.
    p_fa
        False-alarm probability of one test of one satellite.
    """

    sigma_rate_mps: float = 0.03
    sigma_bias_mps2: float = 0.01  # 1 mg, a consumer's sensor
    walk_mps_per_sqrt_s: float = 0.002
    clock_walk_hz: float = 2 * math.pi**2 * 4.311e-21  # [WFO, Sec. V]
    p_fa: float = 1e-6

    def __post_init__(self) -> None:
        check_budget(self.p_fa)

    @property
    def name(self) -> str:
        """Name in `CheckResult`."""
        return "inertial range rate"

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""
        return "m/s"

    def sigma_mps(self, interval_s: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the standard deviation of the statistic after an interval T."""
        walk = self.walk_mps_per_sqrt_s**2 + SPEED_OF_LIGHT_MPS**2 * self.clock_walk_hz
        return np.sqrt(2 * self.sigma_rate_mps**2 + (self.sigma_bias_mps2 * interval_s) ** 2 + walk * interval_s)

    def threshold_mps(self, interval_s: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the largest |statistic| that passes after an interval T."""
        return two_sided_factor(self.p_fa) * self.sigma_mps(interval_s)

    def statistic(
        self,
        rate_change_mps: Float[np.ndarray, "*n"],
        satellite_change_mps: Float[np.ndarray, "*n"],
        gained_mps: Float[np.ndarray, "*n"],
    ) -> Float[np.ndarray, "*n"]:
        """Return measured minus expected change of the range rate.

        Parameters
        ----------
        rate_change_mps
            Of the pseudorange.
        satellite_change_mps
            What it would be without acceleration of the receiver.
        gained_mps
            Velocity gained towards the satellite, Δ(e·v).
        """
        return rate_change_mps - satellite_change_mps + gained_mps

    def probability_of_detection(self, pull_mps: Float[np.ndarray, "*n"], interval_s: float) -> Float[np.ndarray, "*n"]:
        """Return the probability that a change of the range rate by an attacker is seen after an interval."""
        return two_sided_detection(pull_mps / self.sigma_mps(np.asarray([interval_s]))[0], self.p_fa)

    def check(
        self, rate_change_mps: float, satellite_change_mps: float, gained_mps: float, interval_s: float
    ) -> CheckResult:
        """Return the check of one satellite.

        Parameters
        ----------
        rate_change_mps, satellite_change_mps, gained_mps
            As for `statistic`.
        interval_s
            T.
        """
        threshold = float(self.threshold_mps(np.array([interval_s]))[0])
        change = rate_change_mps - satellite_change_mps + gained_mps
        failure = f"the range rate changed by {change:+.2f} m/s more than the motion explains"
        return judged(self, change, threshold, failure)
