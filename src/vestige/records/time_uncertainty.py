"""Compute the upper limit of the receiver's clock error, for searches and for the comparison with the disclosure."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from vestige.records.times import GalileoTimes
from vestige.time import GalileoTime
from vestige.valid_numbers import require_finite, require_time_uncertainty

FIXED_S = 1e-6  # upper limit of the clock error in s (300 m) after a position from authenticated pseudoranges


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeUncertainty:
    """Upper limit of the error of the receiver's clock as a function of time."""

    initial_s: float = 15.0  # upper limit of the clock error before the first authentic fix
    # upper limit of the relative frequency error of the oscillator
    frequency_error: float = 2e-6  # value of a temperature-compensated crystal oscillator, over temperature and age
    fixed_at: GalileoTime | None = None  # time of the last authentic fix
    fixed_s: float = FIXED_S  # upper limit of the clock error at `fixed_at`

    def __post_init__(self) -> None:
        require_time_uncertainty(self.initial_s)
        require_finite("time uncertainty", frequency_error=self.frequency_error, fixed_s=self.fixed_s)

    def at(self, time: GalileoTime) -> float:
        """Return the upper limit of the clock error at a time, in s."""
        if self.fixed_at is None:
            return self.initial_s
        return min(self.fixed_s + self.frequency_error * abs(time - self.fixed_at), self.initial_s)

    def over(self, times: GalileoTimes) -> Float[np.ndarray, "*n"]:
        """Return the upper limit of the clock error at many times, in s, with exactly the values of `at`."""
        if self.fixed_at is None:
            return np.full(times.shape, self.initial_s)
        return np.minimum(self.fixed_s + self.frequency_error * np.abs(times.since(self.fixed_at)), self.initial_s)

    def after_fix(self, time: GalileoTime, fixed_s: float = FIXED_S) -> TimeUncertainty:
        """Return the time uncertainty after an authentic fix at a time."""
        return replace(self, fixed_at=time, fixed_s=fixed_s)
