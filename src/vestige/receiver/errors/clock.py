"""Simulate a receiver clock of two states with white and random-walk frequency noise [WFO, Sec. V].

Theory of operation
-------------------
The one-sided spectrum of the fractional frequency is S_y(f) = h0 + h−2/f². The state x = (bias in s, fractional
frequency) changes over a step T by [GALLEANI08]

    x ← [[1, T], [0, 1]] x + n,    cov n = Q = [[Sf T + Sg T³/3, Sg T²/2], [Sg T²/2, Sg T]]
    Sf = h0/2,    Sg = 2π² h−2
    σ_y²(τ) = h0/(2τ) + (2π²/3) h−2 τ                Allan variance

The noises of both states are correlated. With u, w ~ N(0, 1) and the frequency first, the Cholesky factor of Q gives

    n_frequency = √(Sg T) u,    n_bias = (T/2) n_frequency + √(Sf T + Sg T³/12) w

The factor needs no division and is 0 for T = 0. The composition of steps is exact, so the distribution of the state at
a time does not depend on the number of steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.errors.error_process import Streams, steps_s


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoStateClock:
    """A clock with white and random-walk frequency noise, without error at the scenario's start.

    The default is the clock of [WFO, Sec. V], a good TCXO. The range error of this clock grows to 5 cm (1σ) in 1 s and
    to 8.3 m in 30 s. `ClockProcess.advance` returns the receiver clock's error times c, which every pseudorange
    contains. A clock that is ahead makes ranges longer.

    Attributes
    ----------
    h0_s
        h0, white frequency noise, in 1/Hz = s.
    h_minus_2_hz
        h−2, random-walk frequency noise, in Hz.
    """

    h0_s: float = 7.115e-24  # [WFO, Sec. V]
    h_minus_2_hz: float = 4.311e-21  # [WFO, Sec. V]
    kind: Literal["two-state"] = "two-state"

    def __post_init__(self) -> None:
        if not (self.h0_s >= 0 and self.h_minus_2_hz >= 0):
            raise ValueError("noise coefficients that are not negative")

    @property
    def white_s(self) -> float:
        """Sf = h0/2 in s: the bias variance that white frequency noise adds in a second, in s²/s."""
        return self.h0_s / 2

    @property
    def walk_hz(self) -> float:
        """Sg = 2π² h−2 in 1/s: the variance that the fractional frequency gains in a second."""
        return 2 * np.pi**2 * self.h_minus_2_hz

    def covariance(self, step_s: float) -> Float[np.ndarray, "2 2"]:
        """Return Q, the covariance of (bias in s, fractional frequency) that a step of `step_s` seconds adds."""
        sf, sg, t = self.white_s, self.walk_hz, step_s
        return np.array([[sf * t + sg * t**3 / 3, sg * t**2 / 2], [sg * t**2 / 2, sg * t]])

    def process(self, streams: Streams) -> ClockProcess:
        """Return a realisation of this clock from the receiver's streams."""
        return ClockProcess(self, streams)


class ClockProcess:
    """One realisation of a `TwoStateClock`."""

    def __init__(self, model: TwoStateClock, streams: Streams) -> None:
        self._model = model
        self._frequency_rng, self._bias_rng = streams("clock.frequency"), streams("clock.bias")
        self._last_s = self._bias_m = self._drift_mps = 0.0

    def advance(self, times_s: Float[np.ndarray, " n"]) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Return the clock error in m and the rate of the clock error in m/s at the given times.

        The error is positive if the clock is ahead. At the scenario's start, error and rate are 0. The function raises
        `ValueError` if a time is negative, or earlier than the previous time in this call or in the previous call.
        """
        if times_s.size == 0:
            return np.zeros(0), np.zeros(0)
        t = steps_s(self._last_s, times_s)
        sf, sg = self._model.white_s, self._model.walk_hz
        kick = SPEED_OF_LIGHT_MPS * np.sqrt(sg * t) * self._frequency_rng.standard_normal(t.size)
        white = SPEED_OF_LIGHT_MPS * np.sqrt(sf * t + sg * t**3 / 12) * self._bias_rng.standard_normal(t.size)
        drift = np.add.accumulate(np.concatenate(([self._drift_mps], kick)))
        bias = np.add.accumulate(np.concatenate(([self._bias_m], t * (drift[:-1] + kick / 2) + white)))
        self._last_s, self._bias_m, self._drift_mps = float(times_s[-1]), float(bias[-1]), float(drift[-1])
        return bias[1:], drift[1:]
