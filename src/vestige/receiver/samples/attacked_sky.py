"""Add an attack to a recording, with each spoofing signal as an additional satellite that has its own path.

A spoofing signal has the delay τ relative to the true signal at the receiver. The spoofing signal left the satellite
together with the true signal that arrived τ earlier. The pseudorange P' of the spoofing signal follows from the range s
of the line of sight. clock(t) is the sum of clock error and tropospheric delay at the arrival of the spoofing signal:

    P'(t) = s(t − τ) + clock(t) + c τ

The additional phase of the spoofing signal's carrier is in the phasor of its propagation. The additional phase is
constant for a delay line (`Coherent`), while a locked or slipping carrier diverges from its code. Profiles are
evaluated at the time of transmission, as in a campaign. Signals sent before the scenario's start have the profile
values of the start.

The recorder makes samples in stretches of about 10 ms. In a stretch, delay and phase are parabolas through their values
at the start, the middle and the end of the stretch. The amplitude is a straight line between start and end. So no value
has a step between stretches, even where a profile has a corner. The only exception is the step of the amplitude between
two stretches when a signal is switched on or off.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.samples.continuous import ContinuousTruth
from vestige.receiver.samples.recorder import Propagation, ReceivedSatellite
from vestige.records import Band
from vestige.signal_generator.waveform import Component
from vestige.signals.definitions import CARRIER_HZ, E1B
from vestige.spoofer.spoofer import BandEffects, Spoofer

_SECONDS_KEPT = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivedSpoofingSignal:
    """One spoofing signal in one band: pseudorange and propagation at a time in s after the scenario's start."""

    true: ReceivedSatellite
    path: ContinuousTruth  # truth of the signal that is repeated
    spoofer: Spoofer
    number: int  # index of the attack in `spoofer.attacks`
    band: Band
    stretch_s: float  # duration of a stretch of the recorder in s; all given times are middles of stretches
    _motions: dict[int, tuple[float, float]] = field(default_factory=dict, repr=False, compare=False)
    _delays: dict[bytes, Float[np.ndarray, "3 n"]] = field(default_factory=dict, repr=False, compare=False)

    def range_m(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the pseudorange P'(t) in m."""
        delay_m, _, _ = self._delay(t_s)
        clock_m = self.path.range_m(t_s) - self.path.line_of_sight.range_m(t_s)
        return self.path.line_of_sight.range_m(t_s - delay_m / SPEED_OF_LIGHT_MPS) + clock_m + delay_m

    def rate_mps(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return dP'/dt in m/s, with the mean rate of the delay in the stretch around each time."""
        delay_m, rate_mps, _ = self._delay(t_s)
        geometry = self.path.line_of_sight
        drift_mps = self.path.rate_mps(t_s) - geometry.rate_mps(t_s)
        slower = 1 - rate_mps / SPEED_OF_LIGHT_MPS
        return geometry.rate_mps(t_s - delay_m / SPEED_OF_LIGHT_MPS) * slower + drift_mps + rate_mps

    def acceleration_mps2(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return d²P'/dt² in m/s², with the mean second derivative of the delay in the stretch."""
        delay_m, rate_mps, bend_mps2 = self._delay(t_s)
        geometry, then_s = self.path.line_of_sight, t_s - delay_m / SPEED_OF_LIGHT_MPS
        change_mps2 = self.path.acceleration_mps2(t_s) - geometry.acceleration_mps2(t_s)
        slower = 1 - rate_mps / SPEED_OF_LIGHT_MPS
        own_mps2 = bend_mps2 * (1 - geometry.rate_mps(then_s) / SPEED_OF_LIGHT_MPS)
        return geometry.acceleration_mps2(then_s) * slower**2 + change_mps2 + own_mps2

    def __call__(self, t_s: float) -> Propagation:
        """Return the propagation in the middle of a stretch: the repeated signal's delay and the spoofer's phasor."""
        range_m, rate_mps = self._motion_near(t_s)
        half_s = self.stretch_s / 2 * (1 - rate_mps / SPEED_OF_LIGHT_MPS)
        sent_s = t_s - range_m / SPEED_OF_LIGHT_MPS + half_s * np.array([-1.0, 0.0, 1.0])
        effects, k = self._effects_sent(sent_s), self.number
        delay_m, phase_rad = effects.delay_m[:, k], effects.phase_rad[:, k]
        cycles = CARRIER_HZ[self.band] / SPEED_OF_LIGHT_MPS * delay_m
        turn = phase_rad[1] + 2 * np.pi * (cycles[1] % 1.0)
        turned = self._turned(effects, phase_rad / (2 * np.pi) + cycles % 1.0, half_s)
        strength, growth_per_s = _straight(10 ** (effects.power_db[:, k] / 20), self.stretch_s)
        true = self.true.propagation(t_s - float(delay_m[1]) / SPEED_OF_LIGHT_MPS)
        return replace(
            true,
            at_s=t_s,
            amplitude=complex(true.amplitude * strength * np.exp(1j * turn)),
            growth_per_s=growth_per_s,
            doppler_hz=true.doppler_hz + float(turned[0] + turned[1]) / self.stretch_s,
            doppler_rate_hz_per_s=4 * float(turned[1] - turned[0]) / self.stretch_s**2,
            ray_delay_m=np.zeros(0),
            ray_amplitude=np.zeros(0, complex),
            ray_doppler_hz=np.zeros(0),
        )

    def _turned(self, effects: BandEffects, cycles: Float[np.ndarray, " 3"], half_s: float) -> Float[np.ndarray, " 2"]:
        """Return the carrier's phase change in each half of a stretch in cycles.

        The effect of the pseudorange is not included.

        `cycles` is the carrier phase at the start, the middle and the end of the stretch, without the effect of the
        pseudorange. The whole cycles in `cycles` are arbitrary. The right number of whole cycles is computed either
        from the Doppler of the phase law, or from this Doppler without the effect of the delay's rate. The function
        uses the Doppler that changes less within the stretch, because a corner of the delay makes a step in the other
        Doppler.
        """
        to_cycles, k = CARRIER_HZ[self.band] / SPEED_OF_LIGHT_MPS, self.number
        own_hz = effects.doppler_hz[:, k]
        beyond_hz = own_hz + to_cycles * effects.delay_rate_mps[:, k]
        if np.ptp(beyond_hz) <= np.ptp(own_hz):
            about = (beyond_hz[:-1] + beyond_hz[1:]) / 2 * half_s
        else:
            about = (own_hz[:-1] + own_hz[1:]) / 2 * half_s + to_cycles * np.diff(effects.delay_m[:, k])
        return about + np.remainder(np.diff(cycles) - about + 0.5, 1.0) - 0.5

    def _delay(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, "3 n"]:
        """Return the delay in m at some times, and its mean first and second derivatives around each time."""
        key = t_s.tobytes()
        known = self._delays.get(key)  # range, rate and acceleration are requested for the same times
        if known is None:
            half_s = self.stretch_s / 2
            at_s = np.concatenate([t_s - half_s, t_s, t_s + half_s])
            begin_m, delay_m, end_m = self._effects(at_s).delay_m[:, self.number].reshape(3, -1)
            bend_mps2 = ((end_m - delay_m) - (delay_m - begin_m)) / half_s**2
            known = np.stack([delay_m, (end_m - begin_m) / self.stretch_s, bend_mps2])
            self._delays.clear()
            self._delays[key] = known
        return known

    def _motion_near(self, t_s: float) -> tuple[float, float]:
        """Return the pseudorange P(t) and its rate, extrapolated within a second, with an error of metres (10 ns)."""
        second = int(np.floor(t_s))
        known = self._motions.get(second)
        if known is None:
            middle = np.array([second + 0.5])
            known = float(self.path.range_m(middle)[0]), float(self.path.rate_mps(middle)[0])
            if len(self._motions) >= _SECONDS_KEPT:
                self._motions.clear()
            self._motions[second] = known
        range_m, rate_mps = known
        return range_m + rate_mps * (t_s - second - 0.5), rate_mps

    def _effects(self, t_s: Float[np.ndarray, " n"]) -> BandEffects:
        return self._effects_sent(t_s - self.path.range_m(t_s) / SPEED_OF_LIGHT_MPS)

    def _effects_sent(self, sent_s: Float[np.ndarray, " n"]) -> BandEffects:
        """Return the effects of the attack on signals that were sent at the given times."""
        return self.spoofer.effects(self.band, self.true.svid, np.maximum(sent_s, 0.0))


def _straight(strength: Float[np.ndarray, " 3"], stretch_s: float) -> tuple[float, float]:
    """Return the strength in the middle of a stretch, and its relative growth per s.

    The growth is 0 if the signal is off at the start, in the middle or at the end of the stretch.
    """
    begin, middle, end = (float(one) for one in strength)
    if not (begin and middle and end):
        return middle, 0.0
    mean = (begin + end) / 2
    return mean, (end - begin) / stretch_s / mean


def spoofing_satellites(
    true: ReceivedSatellite,
    path: ContinuousTruth,
    spoofer: Spoofer,
    band: Band,
    *,
    forged_chips: Component,
    forged_data: Component,
    stretch_s: float,
    seed: int,
) -> Iterator[ReceivedSatellite]:
    """Yield the spoofing signals of a satellite in a band.

    Parameters
    ----------
    true, path, spoofer, band
        The true signal, its truth, the attacker, and the band.
    forged_chips
        Component with chips that an attacker invents in place of the true chips.
    forged_data
        E1-B with an attacker's own data.
    stretch_s
        Duration of a stretch of the recorder in s.
    seed
        Seed of the chips that an attacker estimates.
    """
    effects = spoofer.effects(band, true.svid, np.zeros(1))
    for number, attack in enumerate(spoofer.attacks):
        signal = ReceivedSpoofingSignal(
            true=true, path=path, spoofer=spoofer, number=number, band=band, stretch_s=stretch_s
        )
        sent = true.components
        if effects.forged_nav_data[number]:
            sent = tuple(forged_data if one.signal is E1B else one for one in sent)
        replayed = tuple(attack.replayed(one, true.svid, seed) for one in sent)
        components = (forged_chips,) if effects.forged_chips[number] else replayed
        yield replace(true, components=components, pseudorange=signal, propagation=signal)


def latest_s(spoofer: Spoofer, svid: int, times_s: Float[np.ndarray, " n"]) -> float:
    """Return the largest delay in s, at least 0, of all spoofing signals on air at the given times."""
    delays_m = [
        float(np.max(effects.delay_m, initial=0.0, where=effects.power_db > -math.inf))
        for effects in (spoofer.effects(band, svid, times_s) for band in Band)
    ]
    return max(delays_m) / SPEED_OF_LIGHT_MPS
