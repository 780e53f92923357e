"""Model the range as s(t) = s0 + v t + a t²/2 + A sin ωt [WFO, Eq. 3], and define the protocol of all range models."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float


@runtime_checkable
class RangeHistory(Protocol):
    """Protocol of a range as a function of time, for any geometry."""

    def range_m(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the range at times in s after the scenario's start, in m."""
        ...

    def rate_mps(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the range rate in m/s."""
        ...

    def acceleration_mps2(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the second derivative of the range in m/s²."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class RangeModel:
    """Range or pseudorange s(t) as a function of time, with its first and second derivatives.

    Attributes
    ----------
    s0_m, v_mps, a_mps2
        Range in m, range rate in m/s and acceleration in m/s² at t = 0, without the sinusoidal part.
    amplitude_m, omega_radps
        A in m and ω in rad/s of the sinusoidal part A sin ωt.
    """

    s0_m: float = 0.0
    v_mps: float = 0.0
    a_mps2: float = 0.0
    amplitude_m: float = 0.0
    omega_radps: float = 0.0

    def range_m(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the range s(t) in m."""
        swing = self.amplitude_m * np.sin(self.omega_radps * t_s)
        return self.s0_m + self.v_mps * t_s + 0.5 * self.a_mps2 * t_s**2 + swing

    def rate_mps(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the range rate ds/dt in m/s."""
        return self.v_mps + self.a_mps2 * t_s + self.amplitude_m * self.omega_radps * np.cos(self.omega_radps * t_s)

    def acceleration_mps2(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the second derivative d²s/dt² of the range in m/s²."""
        return self.a_mps2 - self.amplitude_m * self.omega_radps**2 * np.sin(self.omega_radps * t_s)
