"""The truth of a simulated line of sight, epoch after epoch: every term of every error.

The errors have memory and are cheap, so they are drawn in order; the cut of the epochs into calls makes no difference.
A model that is None is absent: its term is zero.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from vestige.constants import E1_CARRIER_HZ, GAMMA_E1_E6, SPEED_OF_LIGHT_MPS
from vestige.navigation.elevation_model import obliquity, relative_ray_amplitude
from vestige.own_parts import require_numbers
from vestige.receiver.correlators.e1_loop import E1Loop, E1Tracking
from vestige.receiver.errors.error_process import (
    BiasModel,
    ClockModel,
    IonosphereModel,
    MultipathModel,
    TrackingModel,
    named_streams,
)
from vestige.receiver.errors.multipath import RayBlock
from vestige.receiver.errors.tracking_noise import noise_growth
from vestige.receiver.sky.elevation import SatelliteGeometry, single_line_of_sight
from vestige.receiver.sky.replayed_past import SpooferUnderSky
from vestige.records import Band
from vestige.spoofer.spoofer import BandEffects

if TYPE_CHECKING:
    from vestige.receiver.simulation import Simulation

_WORST_NOISE = 10.0  # noise of a loop that is about to lose lock, over that of an undisturbed loop


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorModels:
    """The error models of a receiver; None for an absent model [WFO, Sec. V]."""

    clock: ClockModel | None = None
    ionosphere: IonosphereModel | None = None
    multipath: MultipathModel | None = None
    e1_tracking: TrackingModel | None = None
    bias: BiasModel | None = None
    # Whether the reflections disturb E1 too. [WFO, Sec. V] applies multipath to the E6 samples only.
    e1_multipath: bool = False

    @property
    def n_rays(self) -> int:
        """Number of reflections that a block has space for; at least 1, which may have amplitude 0."""
        return 1 if self.multipath is None else self.multipath.n_rays


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthBlock:
    """The truth of a block of epochs of one satellite."""

    time_s: Float[np.ndarray, " n"]  # in s after the scenario's start
    range_m: Float[np.ndarray, " n"]  # geometric range, with the troposphere if there is one
    rate_mps: Float[np.ndarray, " n"]
    acceleration_mps2: Float[np.ndarray, " n"]
    clock_m: Float[np.ndarray, " n"]  # receiver clock times c
    clock_drift_mps: Float[np.ndarray, " n"]
    iono_diff_m: Float[np.ndarray, " n"]  # delay of E6 relative to E1 that the prediction does not contain
    ionosphere_e1_m: Float[np.ndarray, " n"]  # the ionosphere's residual on E1; 0 on a single line of sight
    # ionosphere on E1 that the message describes; both bands have it
    broadcast_ionosphere_e1_m: Float[np.ndarray, " n"]
    iono_on_carrier: Float[np.ndarray, " n"]  # 1 if the ionosphere advances the carriers, 0 if it delays the code only
    bias_m: Float[np.ndarray, " n"]  # delay of the code of E6 relative to that of E1, in addition to iono_diff_m
    e1_noise_m: Float[np.ndarray, " n"]  # error of the pseudorange that E1 delivers
    e1_phase_noise_m: Float[np.ndarray, " n"]  # error of the carrier phase, times the wavelength
    e1_rate_noise_mps: Float[np.ndarray, " n"]  # error of the range rate
    e1: E1Tracking  # effect of an attack on E1 tracking
    e1_attack: BandEffects  # spoofing signals, noise and jamming that an attack adds to E1
    e6: BandEffects  # the same for E6
    rays: RayBlock
    geometry: SatelliteGeometry

    def ionosphere_m(self, band: Band) -> Float[np.ndarray, " n"]:
        """Return the delay of the code by the ionosphere on a band in m, residual and broadcast model."""
        return self._residual_m(band) + self._modelled_m(band)

    def carrier_advance_m(self, band: Band) -> Float[np.ndarray, " n"]:
        """Return the advance of the carrier of a band by the ionosphere, in m."""
        return self._residual_m(band) * self.iono_on_carrier + self._modelled_m(band)

    def _residual_m(self, band: Band) -> Float[np.ndarray, " n"]:
        return self.ionosphere_e1_m if band is Band.E1 else self.ionosphere_e1_m + self.iono_diff_m

    def _modelled_m(self, band: Band) -> Float[np.ndarray, " n"]:
        return self.broadcast_ionosphere_e1_m * (1.0 if band is Band.E1 else GAMMA_E1_E6)


class TruthProcess:
    """Process that steps through the epochs in order."""

    def __init__(self, of: Simulation) -> None:
        models, elevation, cn0_dbhz = of.models, of.elevation, of.cn0_e1_dbhz
        receiver, own = named_streams(of.seed), named_streams(of.seed, of.svid)
        self._of = of
        self._interval_s = of.interval_s if of.truth_interval_s is None else of.truth_interval_s
        self._clock = models.clock and models.clock.process(receiver)
        self._ionosphere = models.ionosphere and models.ionosphere.process(own)
        if self._ionosphere and elevation and hasattr(self._ionosphere, "shared"):
            self._ionosphere.shared(receiver, elevation.ionosphere_common)
        self._multipath = models.multipath and models.multipath.process(own)
        self._tracking = models.e1_tracking and models.e1_tracking.process(own, cn0_dbhz=cn0_dbhz)
        self._loop = E1Loop(
            of.spoofer,
            of.svid,
            interval_s=self._interval_s,
            cn0_dbhz=cn0_dbhz,
            loop_bandwidth_hz=models.e1_tracking.loop_bandwidth_hz if models.e1_tracking else 1.0,
            reacquisition_s=of.reacquisition_s,
        )
        self._bias = models.bias and models.bias.process(own, receiver=receiver)

    def advance(self, first: int, count: int) -> TruthBlock:
        """Return the truth of the next epochs, first … first + count − 1."""
        times_s = (first + np.arange(count)) * self._interval_s
        zero = np.zeros(count)
        models = self._of.models
        clock_m, drift_mps = _advanced(models.clock, self._clock, times_s, 2) if self._clock else (zero, zero)
        elevation, path = self._of.elevation, self._of.line_of_sight
        if elevation is None:
            seen = single_line_of_sight(path, times_s)
        else:
            seen = elevation.seen(times_s - self._of.clock_offset_s, clock_m)
        geometry = seen.geometry
        code_m, carrier_m, doppler_hz = (
            _advanced(models.e1_tracking, self._tracking, times_s, 3) if self._tracking else (zero, zero, zero)
        )
        spoofer, e1 = self._of.spoofer_as_received, self._loop.advance(first, count)
        if isinstance(spoofer, SpooferUnderSky):
            e1 = spoofer.tracked(times_s, e1)
        noisier = np.minimum(1 / np.sqrt(e1.gain), _WORST_NOISE)
        iono_diff_m = _advanced(models.ionosphere, self._ionosphere, times_s) if self._ionosphere else zero
        rays = (
            _advanced(models.multipath, self._multipath, times_s) if self._multipath else _no_rays(count, models.n_rays)
        )
        if elevation:
            code_m, doppler_hz = self._weaker(geometry, code_m, doppler_hz)
            carrier_m = carrier_m / geometry.amplitude
            iono_diff_m = iono_diff_m * obliquity(geometry.elevation_rad)
            scale = relative_ray_amplitude(geometry.elevation_rad)[:, None]
            rays = replace(rays, amplitude=rays.amplitude * scale, amplitude_e1=rays.amplitude_e1 * scale)
        return TruthBlock(
            time_s=times_s,
            range_m=seen.range_m,
            rate_mps=seen.rate_mps,
            acceleration_mps2=seen.acceleration_mps2,
            clock_m=clock_m,
            clock_drift_mps=drift_mps,
            iono_diff_m=iono_diff_m,
            ionosphere_e1_m=iono_diff_m / (GAMMA_E1_E6 - 1) if elevation else np.zeros(count),
            broadcast_ionosphere_e1_m=elevation.broadcast_ionosphere_e1_m(times_s, clock_m) if elevation else zero,
            iono_on_carrier=np.full(count, 0.0 if getattr(models.ionosphere, "code_only", False) else 1.0),
            bias_m=_advanced(models.bias, self._bias, times_s) if self._bias else zero,
            e1_noise_m=code_m * noisier,
            e1_phase_noise_m=carrier_m * noisier,
            e1_rate_noise_mps=-doppler_hz * noisier * SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ,
            e1=e1,
            e1_attack=spoofer.effects(Band.E1, self._of.svid, times_s),
            e6=spoofer.effects(Band.E6, self._of.svid, times_s),
            rays=rays,
            geometry=geometry,
        )

    def _weaker(
        self, geometry: SatelliteGeometry, code_m: Float[np.ndarray, " n"], doppler_hz: Float[np.ndarray, " n"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Return the tracking noise at the strength of each epoch, from the noise at the nominal strength."""
        if self._of.models.e1_tracking is None:
            return code_m, doppler_hz
        code, doppler = noise_growth(
            self._of.models.e1_tracking, self._of.cn0_e1_dbhz, 20 * np.log10(geometry.amplitude)
        )
        return code_m * code, doppler_hz * doppler


def _advanced(model: Any, process: Any, times_s: Float[np.ndarray, " n"], n_errors: int = 1) -> Any:
    """Return the next errors of a model; their shape is checked, because the model may be a user's class."""
    values = process.advance(times_s)
    if isinstance(values, RayBlock):
        for field in fields(values):
            require_numbers(model, f"advance.{field.name}", getattr(values, field.name), (times_s.size, model.n_rays))
    else:
        require_numbers(model, "advance", values, (n_errors, times_s.size)[n_errors == 1 :])
    return values


def _no_rays(count: int, n_rays: int) -> RayBlock:
    nothing = np.zeros((count, n_rays))
    return RayBlock(delay_m=nothing, amplitude=nothing + 0j, amplitude_e1=nothing + 0j, doppler_hz=nothing)
