"""The truth of a simulation between its epochs, for recordings that run on.

`Simulation` knows its errors at every epoch t_k, the transmission of a RECS, and moves them over its reception. A
recording goes through all epochs in one piece:

    P(t) = s(t) + clock(t)                       geometry as it is; clock: the cubic through t_k with the drift as slope
    E6:  iono_diff + bias + (γ − 1) c BGD        group delay of the code, held
         rays                                    delay, strength and Doppler held, phase turning with the Doppler
    E1:  rays, if the scenario lets them disturb E1; no group delay

What is held changes at once half an interval before and after the reception of each RECS. So a RECS meets the
signal of `Simulation.snapshot`, but for the carrier phase and micrometres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.samples.recorder import Propagation, straight
from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.signal_generator.range_model import RangeHistory


@dataclass(frozen=True, slots=True, kw_only=True)
class ContinuousTruth:
    """A truth at any time."""

    line_of_sight: RangeHistory
    truth: TruthBlock  # at the epochs, at least two, and beyond the times that are asked for
    e1_multipath: bool  # whether the rays are in E1 too
    # delay of E6 against E1 beyond the truth's residuals, which the receiver is told of, in m
    group_delay_m: float = 0.0

    def range_m(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return P(t) in m."""
        return self.line_of_sight.range_m(t_s) + self._clock(t_s)[0]

    def rate_mps(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return dP/dt in m/s."""
        return self.line_of_sight.rate_mps(t_s) + self._clock(t_s)[1]

    def acceleration_mps2(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return d²P/dt² in m/s²."""
        return self.line_of_sight.acceleration_mps2(t_s) + self._clock(t_s)[2]

    def e6_delay_m(self) -> Float[np.ndarray, " n"]:
        """Return by how much E6 is later than E1 at the epochs, in m."""
        return self.truth.iono_diff_m + self.truth.bias_m + self.group_delay_m

    def received_s(self) -> Float[np.ndarray, " n"]:
        """Return the receiver time at which the first chip of each epoch arrives on E6: t = t_k + P6(t)/c."""
        sent_s = self.truth.time_s
        t_s = sent_s
        for _ in range(4):  # P changes by < 1 km/s · 0.1 s: each step gains five decimals
            t_s = sent_s + (self.range_m(t_s) + self.e6_delay_m()) / SPEED_OF_LIGHT_MPS
        return t_s

    def propagation(self, band: Band, duration_s: float) -> HeldPropagation:
        """Return what holds in a band, RECS of `duration_s` standing in the middle of their stretches."""
        return HeldPropagation(band=band, truth=self, received_s=self.received_s(), duration_s=duration_s)

    def _clock(self, t_s: Float[np.ndarray, " n"]) -> tuple[Float[np.ndarray, " n"], ...]:
        """Return receiver clock in m with its first and second derivative: the Hermite cubic between two epochs."""
        knots, clock_m, drift = self.truth.time_s, self.truth.clock_m, self.truth.clock_drift_mps
        left = np.clip(np.searchsorted(knots, t_s, side="right") - 1, 0, knots.size - 2)
        step = knots[left + 1] - knots[left]
        u = (t_s - knots[left]) / step
        rise, a, b = clock_m[left + 1] - clock_m[left], drift[left] * step, drift[left + 1] * step
        quadratic, cubic = 3 * rise - 2 * a - b, a + b - 2 * rise
        return (
            clock_m[left] + u * (a + u * (quadratic + u * cubic)),
            (a + u * (2 * quadratic + u * 3 * cubic)) / step,
            (2 * quadratic + 6 * cubic * u) / step**2,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldPropagation:
    """What holds in one band at a receiver time: that of the RECS nearest to it."""

    band: Band
    truth: ContinuousTruth
    received_s: Float[np.ndarray, " n"]
    duration_s: float

    def __call__(self, t_s: float) -> Propagation:
        """Return what holds at a time in s after the start."""
        row = int(np.argmin(np.abs(self.received_s + self.duration_s / 2 - t_s)))
        rays = self.truth.truth.rays
        if self.band is Band.E1 and not self.truth.e1_multipath:
            return straight()
        e1 = self.band is Band.E1
        return Propagation(
            delay_m=0.0 if e1 else float(self.truth.e6_delay_m()[row]),
            at_s=float(self.received_s[row]),
            ray_delay_m=rays.delay_m[row],
            ray_amplitude=(rays.amplitude_e1 if e1 else rays.amplitude)[row],
            ray_doppler_hz=rays.doppler_hz[row] * (E1_CARRIER_HZ / E6_CARRIER_HZ if e1 else 1.0),
        )
