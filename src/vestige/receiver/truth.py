"""Compute the truth of a simulated line of sight, epoch after epoch: all errors, and the effects of an attack.

The errors are correlated in time and cost little computation, so the errors are drawn in the order of the epochs. The
truth does not depend on the division of the epochs into calls of `advance`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from vestige.constants import E1_CARRIER_HZ, GAMMA_E1_E6, SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.e1_loop import E1Loop, E1Tracking
from vestige.receiver.errors.multipath import RayBlock
from vestige.receiver.sky.elevation import SatelliteGeometry
from vestige.receiver.sky.replayed_past import SpooferUnderSky
from vestige.receiver.undisturbed_truth import KEPT_EPOCHS, UndisturbedProcess, UndisturbedTruth, kept_truth
from vestige.records import Band
from vestige.spoofer.spoofer import NO_SPOOFER, BandEffects

if TYPE_CHECKING:
    from vestige.receiver.simulation import Simulation

_WORST_NOISE = 10.0  # upper limit of the tracking noise, divided by the noise of an undisturbed loop


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthBlock:
    """The truth of a block of epochs of one satellite."""

    time_s: Float[np.ndarray, " n"]  # time of each epoch in s after the scenario's start
    range_m: Float[np.ndarray, " n"]  # geometric range plus the delay of the troposphere (0 without a troposphere)
    rate_mps: Float[np.ndarray, " n"]
    acceleration_mps2: Float[np.ndarray, " n"]
    clock_m: Float[np.ndarray, " n"]  # error of the receiver clock times c, positive if the clock is ahead
    clock_drift_mps: Float[np.ndarray, " n"]
    iono_diff_m: Float[np.ndarray, " n"]  # ionospheric delay of E6 relative to E1 that the prediction does not contain
    ionosphere_e1_m: Float[np.ndarray, " n"]  # the ionosphere's residual on E1; 0 on a single line of sight
    # ionospheric delay on E1 that the message describes; E6 has γ times this delay
    broadcast_ionosphere_e1_m: Float[np.ndarray, " n"]
    iono_on_carrier: Float[np.ndarray, " n"]  # 1 if the ionosphere's residual advances the carriers, 0 if not
    bias_m: Float[np.ndarray, " n"]  # delay of the E6 code relative to the E1 code, in addition to iono_diff_m
    e1_noise_m: Float[np.ndarray, " n"]  # noise of the pseudorange on E1
    e1_phase_noise_m: Float[np.ndarray, " n"]  # noise of the carrier phase on E1, times the wavelength
    e1_rate_noise_mps: Float[np.ndarray, " n"]  # noise of the range rate from the E1 Doppler
    e1: E1Tracking  # effect of an attack on E1 tracking
    e1_attack: BandEffects  # spoofing signals, noise and jamming that an attack adds to E1
    e6: BandEffects  # spoofing signals, noise and jamming that an attack adds to E6
    rays: RayBlock
    geometry: SatelliteGeometry

    def ionosphere_m(self, band: Band) -> Float[np.ndarray, " n"]:
        """Return the ionospheric delay of a band's code in m, the sum of broadcast model and residual."""
        return self._residual_m(band) + self._modelled_m(band)

    def carrier_advance_m(self, band: Band) -> Float[np.ndarray, " n"]:
        """Return the ionospheric advance of a band's carrier in m."""
        return self._residual_m(band) * self.iono_on_carrier + self._modelled_m(band)

    def _residual_m(self, band: Band) -> Float[np.ndarray, " n"]:
        return self.ionosphere_e1_m if band is Band.E1 else self.ionosphere_e1_m + self.iono_diff_m

    def _modelled_m(self, band: Band) -> Float[np.ndarray, " n"]:
        return self.broadcast_ionosphere_e1_m * (1.0 if band is Band.E1 else GAMMA_E1_E6)


class TruthProcess:
    """Process that gives the truth of one satellite at the epochs in order."""

    def __init__(self, of: Simulation) -> None:
        models = of.models
        self._of = of
        self._undisturbed = replace(of, spoofer=NO_SPOOFER, longest_delay_s=0.0)
        self._process: UndisturbedProcess | None = None
        self._interval_s = of.epoch_interval_s
        self._loop = E1Loop(
            of.spoofer,
            of.svid,
            interval_s=self._interval_s,
            cn0_dbhz=of.cn0_e1_dbhz,
            loop_bandwidth_hz=models.e1_tracking.loop_bandwidth_hz if models.e1_tracking else 1.0,
            reacquisition_s=of.reacquisition_s,
        )

    def advance(self, first: int, count: int) -> TruthBlock:
        """Return the truth of the next epochs, `first` to `first + count − 1`."""
        free = self._without_attack(first, count)
        times_s, geometry, rays = free.time_s, free.motion.geometry, free.rays
        models, elevation = self._of.models, self._of.elevation
        code_m, carrier_m, doppler_hz, iono_diff_m = free.code_m, free.carrier_m, free.doppler_hz, free.iono_diff_m
        spoofer, e1 = self._of.spoofer_as_received, self._loop.advance(first, count)
        if isinstance(spoofer, SpooferUnderSky):
            e1 = spoofer.tracked(times_s, e1)
        noisier = np.minimum(1 / np.sqrt(e1.gain), _WORST_NOISE)
        return TruthBlock(
            time_s=times_s,
            range_m=free.motion.range_m,
            rate_mps=free.motion.rate_mps,
            acceleration_mps2=free.motion.acceleration_mps2,
            clock_m=free.clock_m,
            clock_drift_mps=free.clock_drift_mps,
            iono_diff_m=iono_diff_m,
            ionosphere_e1_m=iono_diff_m / (GAMMA_E1_E6 - 1) if elevation else np.zeros(count),
            broadcast_ionosphere_e1_m=free.broadcast_ionosphere_e1_m,
            iono_on_carrier=np.full(count, 0.0 if getattr(models.ionosphere, "code_only", False) else 1.0),
            bias_m=free.bias_m,
            e1_noise_m=code_m * noisier,
            e1_phase_noise_m=carrier_m * noisier,
            e1_rate_noise_mps=-doppler_hz * noisier * SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ,
            e1=e1,
            e1_attack=spoofer.effects(Band.E1, self._of.svid, times_s),
            e6=spoofer.effects(Band.E6, self._of.svid, times_s),
            rays=rays,
            geometry=geometry,
        )

    def _without_attack(self, first: int, count: int) -> UndisturbedTruth:
        """Return the part of the truth that no attack changes.

        The simulations of a threat table differ only in their attack, so the truth without attacks of a short run is
        cached.
        """
        if first == 0 and count <= KEPT_EPOCHS:
            return kept_truth(self._undisturbed, count)
        if self._process is None:
            self._process = UndisturbedProcess(self._undisturbed)
            if first:
                self._process.advance(np.arange(first) * self._interval_s)
        return self._process.advance((first + np.arange(count)) * self._interval_s)
