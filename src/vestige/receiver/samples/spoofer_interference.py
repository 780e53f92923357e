"""Noise and jamming of the attacks in one band of a recording; the phase of a waveform has no breaks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex64

from vestige.receiver.simulation import Simulation
from vestige.records import Band
from vestige.signal_generator.noise_kernel import noise_key
from vestige.spoofer.jammers import power_in_samples
from vestige.spoofer.spoofer import BandEffects

_STREAMS = {Band.E1: 161, Band.E6: 166}  # first stream numbers of the waveforms


@dataclass(frozen=True, kw_only=True)
class SpooferInterference:
    """The noise and jamming that the attacks of a simulation add to a band, the same for all satellites.

    The band has one front end. A repeater adds the noise of its reception once. An SCER attack that decides on the
    chips of several satellites adds the sum of the noise of these decisions (`vestige.spoofer.scer`). This sum is white
    and Gaussian, so the recorder adds the sum to the receiver's own noise.
    """

    simulation: Simulation  # simulation of any satellite of the receiver
    band: Band

    def _effects(self, t_s: float) -> BandEffects:
        return self.simulation.spoofer.effects(self.band, self.simulation.svid, np.array([max(t_s, 0.0)]))

    def white(self, t_s: float) -> float:
        """Return the density of the added white noise over the receiver's noise, at a time in s after the start."""
        return float(self._effects(t_s).white[0])

    def jam(self, samples: Complex64[np.ndarray, " n"], t_s: float, first_sample: int, sample_rate_hz: float) -> None:
        """Add the waveforms of a stretch around a time to samples from number `first_sample` on."""
        for number, one in enumerate(self._effects(t_s).jammers):
            if one.j_over_n[0] > 0:
                power = power_in_samples(one.waveform, float(one.j_over_n[0]), one.noise_bandwidth_hz, sample_rate_hz)
                key = noise_key(self.simulation.seed, 0, _STREAMS[self.band] + number)
                one.waveform.add(samples, power, sample_rate_hz, key, first_sample)
