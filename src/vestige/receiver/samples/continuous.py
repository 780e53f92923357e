"""Interpolate the truth of a simulation between its epochs, for recordings without gaps.

A `Simulation` has errors at every epoch t_k. The epoch is the time at which chips are sent: the chips of a RECS, if the
epoch has a RECS. The simulation applies the errors of the epoch when these chips are received. A recording covers all
epochs without a gap:

    P(t) = s(t) + clock(t) + troposphere(t)      s: exact geometry; clock: cubic through the t_k with the drift as slope
    E1:  code later by I, carrier earlier by I   ionosphere I = iono_diff/(γ − 1) + broadcast model, only under a sky
         reflections, if the scenario lets them disturb E1
    E6:  code later by γ I + bias + (γ − 1) c BGD, carrier earlier by γ I
         reflections

On a single line of sight, iono_diff replaces γ I in E6. If the ionosphere model has `code_only`, the residual does not
advance the carriers.

In the middle of the reception of an epoch's chips, delays and strengths have the values of the epoch and a rate near
zero. Between two epochs delays and strengths change to the values of the next epoch without a step, along half a
cosine. The phase of a reflection follows the cubic that begins and ends with the phases and Dopplers of the two epochs.
The signal of a RECS in the recording therefore equals the signal in `LineOfSightSamples`, except for the carrier phase
and for micrometres of range. So tracking loops receive a signal without jumps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from vestige.constants import E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.samples.recorder import Propagation
from vestige.receiver.sky.atmosphere import AtmosphericDelay
from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.signal_generator.range_model import RangeHistory
from vestige.signals.definitions import CARRIER_HZ


@dataclass(frozen=True, slots=True, kw_only=True)
class ContinuousTruth:
    """The truth of one satellite at any time."""

    line_of_sight: RangeHistory
    truth: TruthBlock  # truth at two or more epochs, which enclose all requested times
    e1_multipath: bool  # whether the reflections are also in E1
    # delay of E6 relative to E1 in m that the receiver knows, in addition to the truth's residuals
    group_delay_m: float = 0.0
    atmosphere: AtmosphericDelay | None = None  # atmosphere with the troposphere of P(t); None for no atmosphere
    sky: bool = False  # whether the line of sight belongs to a sky, which has system time and an ionosphere

    def range_m(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the pseudorange P(t) in m."""
        clock_m = self._clock(t_s)[0]
        range_m = self.line_of_sight.range_m(self._system_time(t_s, clock_m)) + clock_m
        return range_m if self.atmosphere is None else range_m + self.troposphere_m(t_s)

    def troposphere_m(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the delay of the troposphere in P(t), in m."""
        if self.atmosphere is None:
            return np.zeros_like(t_s)
        return self.atmosphere.troposphere_m(self._system_time(t_s, self.clock_m(t_s)))

    def clock_m(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return c times the receiver clock's error, in m, at times `t_s`."""
        return self._clock(t_s)[0]

    def clock_drift_mps(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the derivative of `clock_m` in m/s."""
        return self._clock(t_s)[1]

    def rate_mps(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the rate dP/dt of the pseudorange in m/s."""
        clock_m, drift_mps, _ = self._clock(t_s)
        system_s = self._system_time(t_s, clock_m)
        rate_mps = self.line_of_sight.rate_mps(system_s) + drift_mps
        return rate_mps if self.atmosphere is None else rate_mps + self.atmosphere.troposphere_rates(system_s)[0]

    def acceleration_mps2(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the acceleration d²P/dt² of the pseudorange in m/s²."""
        clock_m, _, change_mps2 = self._clock(t_s)
        system_s = self._system_time(t_s, clock_m)
        bend_mps2 = self.line_of_sight.acceleration_mps2(system_s) + change_mps2
        return bend_mps2 if self.atmosphere is None else bend_mps2 + self.atmosphere.troposphere_rates(system_s)[1]

    def _system_time(self, t_s: Float[np.ndarray, " n"], clock_m: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the time at which orbits are evaluated: system time if `sky` is true, otherwise receiver time."""
        return t_s - clock_m / SPEED_OF_LIGHT_MPS if self.sky else t_s

    def ionosphere_m(self, band: Band) -> Float[np.ndarray, " n"]:
        """Return the delay of a band's code by the ionosphere at the epochs, in m."""
        return self.truth.ionosphere_m(band)

    def carrier_advance_m(self, band: Band) -> Float[np.ndarray, " n"]:
        """Return the advance of a band's carrier by the ionosphere at the epochs, in m."""
        return self.truth.carrier_advance_m(band)

    def delay_m(self, band: Band) -> Float[np.ndarray, " n"]:
        """Return the delay of a band's code relative to the pseudorange at the epochs, in m."""
        own_m = 0.0 if band is Band.E1 else self.truth.bias_m + self.group_delay_m
        return self.ionosphere_m(band) + own_m

    def received_s(self, band: Band = Band.E6) -> Float[np.ndarray, " n"]:
        """Return the receiver time at which the first chip of each epoch arrives on a band: t = t_k + P(t)/c.

        P is the range of the band's code.
        """
        sent_s = self.truth.time_s
        t_s = sent_s
        for _ in range(4):  # P changes by less than 1 km/s · 0.1 s, so each step gains five decimals
            t_s = sent_s + (self.range_m(t_s) + self.delay_m(band)) / SPEED_OF_LIGHT_MPS
        return t_s

    def propagation(self, band: Band, duration_s: float) -> ContinuousPropagation:
        """Return the propagation in a band.

        In the middle of the reception of a RECS, the propagation has the values of the epoch of the RECS. `duration_s`
        is the duration of a RECS.
        """
        return ContinuousPropagation(band=band, truth=self, received_s=self.received_s(), duration_s=duration_s)

    def _clock(self, t_s: Float[np.ndarray, " n"]) -> tuple[Float[np.ndarray, " n"], ...]:
        """Return the receiver clock error in m and its two derivatives, from the Hermite cubic between two epochs."""
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


@dataclass(frozen=True, kw_only=True)
class ContinuousPropagation:
    """Propagation in one band as a function of receiver time, without steps."""

    band: Band
    truth: ContinuousTruth
    received_s: Float[np.ndarray, " n"]  # arrival of the first chip of each epoch
    duration_s: float  # duration of a RECS

    # The values of all epochs are cached, because a recording asks for the propagation a hundred times per second.

    @cached_property
    def _knots_s(self) -> Float[np.ndarray, " n"]:
        return self.received_s + self.duration_s / 2

    @cached_property
    def _delay_m(self) -> Float[np.ndarray, " n"]:
        return self.truth.delay_m(self.band)

    @cached_property
    def _carrier_advance_m(self) -> Float[np.ndarray, " n"]:
        return self.truth.carrier_advance_m(self.band)

    def __call__(self, t_s: float) -> Propagation:
        """Return the propagation at a receiver time in s after the scenario's start."""
        knots = self._knots_s
        left = min(max(int(np.searchsorted(knots, t_s, side="right")) - 1, 0), knots.size - 2)
        span_s = float(knots[left + 1] - knots[left])
        place = (t_s - float(knots[left])) / span_s
        u = min(max(place, 0.0), 1.0)  # before the first and after the last epoch, only the phases change
        share, slope = (1 - np.cos(np.pi * u)) / 2, np.pi / 2 * np.sin(np.pi * u) / span_s
        to_cycles = CARRIER_HZ[self.band] / SPEED_OF_LIGHT_MPS

        def between(values: Float[np.ndarray, "n ..."]) -> Any:
            return values[left] + share * (values[left + 1] - values[left])

        delay_m, advance_m = self._delay_m, self._carrier_advance_m
        earlier_m = between(advance_m)
        return Propagation(
            delay_m=float(between(delay_m)),
            delay_rate_mps=float(slope * (delay_m[left + 1] - delay_m[left])),
            at_s=t_s,
            amplitude=complex(
                between(self.truth.truth.geometry.amplitude) * np.exp(2j * np.pi * ((earlier_m * to_cycles) % 1.0))
            ),
            doppler_hz=float(to_cycles * slope * (advance_m[left + 1] - advance_m[left])),
            growth_per_s=0.0,
            doppler_rate_hz_per_s=0.0,
            **self._rays(left, u, place - u, span_s, share),
        )

    def _rays(
        self, left: int, u: float, beyond: float, span_s: float, share: float
    ) -> dict[str, Float[np.ndarray, " k"]]:
        """Return the reflections at the fraction `u` of the interval after knot `left`.

        Outside the knots, the phases of the reflections are extrapolated by `beyond` intervals.
        """
        rays, e1 = self.truth.truth.rays, self.band is Band.E1
        if e1 and not self.truth.e1_multipath:
            nothing = np.zeros(0)
            return {"ray_delay_m": nothing, "ray_amplitude": nothing + 0j, "ray_doppler_hz": nothing}
        both = slice(left, left + 2)
        amplitude = (rays.amplitude_e1 if e1 else rays.amplitude)[both]
        doppler_hz = rays.doppler_hz[both] * (CARRIER_HZ[self.band] / E6_CARRIER_HZ)
        # cycles at the two knots; the mean Doppler gives the whole cycles between them
        start, end = np.angle(amplitude) / (2 * np.pi) + doppler_hz * self.duration_s / 2
        mean = np.mean(doppler_hz, axis=0) * span_s
        rise = mean + np.remainder(end - start - mean + 0.5, 1.0) - 0.5
        first, last = doppler_hz * span_s
        quadratic, cubic = 3 * rise - 2 * first - last, first + last - 2 * rise
        cycles = start + u * (first + u * (quadratic + u * cubic)) + beyond * (first if beyond < 0 else last)
        strength, delay_m = np.abs(amplitude), rays.delay_m[both]
        return {
            "ray_delay_m": delay_m[0] + share * (delay_m[1] - delay_m[0]),
            "ray_amplitude": (strength[0] + share * (strength[1] - strength[0])) * np.exp(2j * np.pi * cycles),
            "ray_doppler_hz": (first + u * (2 * quadratic + u * 3 * cubic)) / span_s,
        }
