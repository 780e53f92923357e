"""An attack in a recording: each spoofing signal is an additional satellite in the sky, with its own path.

A spoofing signal has the delay τ at the receiver. The spoofing signal left the satellite together with the true signal
that arrived τ earlier. The receiver's clock is that at the arrival of the spoofing signal:

    P'(t) = s(t − τ) + clock(t) + c τ

The additional phase of the spoofing signal's carrier is in the phasor of its propagation. This phase is zero for a
delay line (`Coherent`), while a locked or slipping carrier diverges from its code. Power and phase follow the attack's
profiles in steps of a stretch, 10 ms. The time of the profiles is that of transmission, as in a run. Signals sent
before the scenario's start have the profile values of the start.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivedSpoofingSignal:
    """One spoofing signal in one band: pseudorange and propagation at a time in s after the scenario's start."""

    true: ReceivedSatellite
    path: ContinuousTruth  # truth of the signal that is repeated
    spoofer: Spoofer
    number: int  # number of the attack in the spoofer
    band: Band
    _motions: dict[int, tuple[float, float]] = field(default_factory=dict, repr=False, compare=False)

    def range_m(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return P'(t) in m."""
        delay_m, _ = self._delay(t_s)
        clock_m = self.path.range_m(t_s) - self.path.line_of_sight.range_m(t_s)
        return self.path.line_of_sight.range_m(t_s - delay_m / SPEED_OF_LIGHT_MPS) + clock_m + delay_m

    def rate_mps(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return dP'/dt in m/s."""
        delay_m, rate_mps = self._delay(t_s)
        geometry = self.path.line_of_sight
        drift_mps = self.path.rate_mps(t_s) - geometry.rate_mps(t_s)
        slower = 1 - rate_mps / SPEED_OF_LIGHT_MPS
        return geometry.rate_mps(t_s - delay_m / SPEED_OF_LIGHT_MPS) * slower + drift_mps + rate_mps

    def acceleration_mps2(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return d²P'/dt² in m/s²; within a stretch the delay contributes only its rate."""
        delay_m, _ = self._delay(t_s)
        geometry = self.path.line_of_sight
        change_mps2 = self.path.acceleration_mps2(t_s) - geometry.acceleration_mps2(t_s)
        return geometry.acceleration_mps2(t_s - delay_m / SPEED_OF_LIGHT_MPS) + change_mps2

    def __call__(self, t_s: float) -> Propagation:
        """Return, for a time, the delay of the repeated signal and the spoofing signal's own phasor."""
        range_m, rate_mps = self._motion_near(t_s)
        effects, k = self._effects_sent(np.array([t_s - range_m / SPEED_OF_LIGHT_MPS])), self.number
        carrier_hz = CARRIER_HZ[self.band]
        cycles = carrier_hz / SPEED_OF_LIGHT_MPS * float(effects.delay_m[0, k])
        turn = effects.phase_rad[0, k] + 2 * np.pi * (cycles % 1.0)
        beyond_hz = effects.doppler_hz[0, k] + carrier_hz / SPEED_OF_LIGHT_MPS * effects.delay_rate_mps[0, k]
        true = self.true.propagation(t_s - float(effects.delay_m[0, k]) / SPEED_OF_LIGHT_MPS)
        return replace(
            true,
            at_s=t_s,
            amplitude=complex(true.amplitude * 10 ** (effects.power_db[0, k] / 20) * np.exp(1j * turn)),
            doppler_hz=true.doppler_hz + float(beyond_hz * (1 - rate_mps / SPEED_OF_LIGHT_MPS)),
            ray_delay_m=np.zeros(0),
            ray_amplitude=np.zeros(0, complex),
            ray_doppler_hz=np.zeros(0),
        )

    def _delay(self, t_s: Float[np.ndarray, " n"]) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        effects = self._effects(t_s)
        return effects.delay_m[:, self.number], effects.delay_rate_mps[:, self.number] * self._kept(t_s)

    def _kept(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the seconds of transmission per second of reception; the profiles run on transmission time."""
        return 1 - self.path.rate_mps(t_s) / SPEED_OF_LIGHT_MPS

    def _motion_near(self, t_s: float) -> tuple[float, float]:
        """Return P(t) and its rate for the phasor, from the middle of the second, with an error of metres (10 ns)."""
        second = int(np.floor(t_s))
        if second not in self._motions:
            middle = np.array([second + 0.5])
            self._motions[second] = float(self.path.range_m(middle)[0]), float(self.path.rate_mps(middle)[0])
        range_m, rate_mps = self._motions[second]
        return range_m + rate_mps * (t_s - second - 0.5), rate_mps

    def _effects(self, t_s: Float[np.ndarray, " n"]) -> BandEffects:
        return self._effects_sent(t_s - self.path.range_m(t_s) / SPEED_OF_LIGHT_MPS)

    def _effects_sent(self, sent_s: Float[np.ndarray, " n"]) -> BandEffects:
        """Return the effects on signals that were sent at some times."""
        return self.spoofer.effects(self.band, self.true.svid, np.maximum(sent_s, 0.0))


def spoofing_satellites(
    true: ReceivedSatellite,
    path: ContinuousTruth,
    spoofer: Spoofer,
    band: Band,
    *,
    forged_chips: Component,
    forged_data: Component,
    seed: int,
) -> Iterator[ReceivedSatellite]:
    """Yield the spoofing signals of a satellite in a band.

    Parameters
    ----------
    true, path, spoofer, band
        The true signal, its truth, the attacker, and the band.
    forged_chips
        Signal that an attacker invents in place of the true one.
    forged_data
        E1-B with an attacker's own data.
    seed
        Seed of an attacker's estimates.
    """
    effects = spoofer.effects(band, true.svid, np.zeros(1))
    for number, attack in enumerate(spoofer.attacks):
        signal = ReceivedSpoofingSignal(true=true, path=path, spoofer=spoofer, number=number, band=band)
        sent = true.components
        if effects.forged_nav_data[number]:
            sent = tuple(forged_data if one.signal is E1B else one for one in sent)
        replayed = tuple(attack.replayed(one, true.svid, seed) for one in sent)
        components = (forged_chips,) if effects.forged_chips[number] else replayed
        yield replace(true, components=components, pseudorange=signal, propagation=signal)


def latest_s(spoofer: Spoofer, svid: int, times_s: Float[np.ndarray, " n"]) -> float:
    """Return the largest delay in s, at least 0, of a spoofing signal that is on air at some times."""
    delays_m = [
        float(np.max(effects.delay_m, initial=0.0, where=effects.power_db > -math.inf))
        for effects in (spoofer.effects(band, svid, times_s) for band in Band)
    ]
    return max(delays_m) / SPEED_OF_LIGHT_MPS
