"""Make the noise and the jamming waveforms that attacks add to one band of a recording.

A jamming waveform continues from one stretch of samples to the next without a jump in phase.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex64

from vestige.receiver.simulation import Simulation
from vestige.records import Band
from vestige.signal_generator.noise_kernel import noise_key
from vestige.spoofer.jammers import power_in_samples
from vestige.spoofer.spoofer import BandEffects

_STREAMS = {Band.E1: 161, Band.E6: 166}  # number of the random stream of the first jamming waveform in each band


@dataclass(frozen=True, kw_only=True)
class SpooferInterference:
    """The noise and jamming that the attacks of a simulation add to a band, the same for all satellites.

    All satellites share the front end of the band. A repeater adds the noise of its reception once. An SCER attack that
    decides on the chips of several satellites adds the sum of the noise of these decisions (`vestige.spoofer.scer`).
    The sum of the noise is white and Gaussian, so the recorder adds this sum to the receiver's own noise.
    """

    simulation: Simulation  # simulation of any satellite of the receiver
    band: Band

    def _effects(self, t_s: float) -> BandEffects:
        return self.simulation.spoofer.effects(self.band, self.simulation.svid, np.array([max(t_s, 0.0)]))

    def white(self, t_s: float) -> float:
        """Return the density of the attacks' white noise at a time, divided by the density of the receiver's noise.

        `t_s` is in s after the scenario's start.
        """
        return float(self._effects(t_s).white[0])

    def jam(self, samples: Complex64[np.ndarray, " n"], t_s: float, first_sample: int, sample_rate_hz: float) -> None:
        """Add the jamming waveforms at the time `t_s` to samples, the first of which has the number `first_sample`."""
        for number, one in enumerate(self._effects(t_s).jammers):
            if one.j_over_n[0] > 0:
                power = power_in_samples(one.waveform, float(one.j_over_n[0]), one.noise_bandwidth_hz, sample_rate_hz)
                key = noise_key(self.simulation.seed, 0, _STREAMS[self.band] + number)
                one.waveform.add(samples, power, sample_rate_hz, key, first_sample)
