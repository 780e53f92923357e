"""Compute the truth of a line of sight without attacks: geometry, clock, ionosphere, multipath, noise and bias.

The errors are correlated in time and cost little computation, so the errors are drawn in the order of the epochs. The
truth does not depend on the division of the epochs into calls of `advance`. If a model is None, its error is zero.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from vestige.navigation.elevation_model import obliquity, relative_ray_amplitude
from vestige.own_parts import require_numbers
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
from vestige.receiver.sky.elevation import SatelliteGeometry, SatelliteMotion, single_line_of_sight

if TYPE_CHECKING:
    from vestige.receiver.simulation import Simulation

KEPT_EPOCHS = 1000  # largest number of epochs of a block in the cache, 270 kB with three reflections
_KEPT_BLOCKS = 128  # number of blocks in the cache, enough for eight satellites, six seeds and two kinds of receiver


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorModels:
    """Error models of a receiver, each None if the model is absent [WFO, Sec. V]."""

    clock: ClockModel | None = None
    ionosphere: IonosphereModel | None = None
    multipath: MultipathModel | None = None
    e1_tracking: TrackingModel | None = None
    bias: BiasModel | None = None
    # Whether the reflections also disturb E1. [WFO, Sec. V] applies multipath to the E6 samples only.
    e1_multipath: bool = False

    @property
    def n_rays(self) -> int:
        """Number of reflections that a block has space for, at least 1.

        Without a multipath model the single reflection has amplitude 0.
        """
        return 1 if self.multipath is None else self.multipath.n_rays


@dataclass(frozen=True, slots=True, kw_only=True)
class UndisturbedTruth:
    """The truth of n epochs of one satellite without the effects of attacks."""

    time_s: Float[np.ndarray, " n"]  # time of each epoch in s after the scenario's start
    motion: SatelliteMotion
    clock_m: Float[np.ndarray, " n"]  # error of the receiver clock times c
    clock_drift_mps: Float[np.ndarray, " n"]
    # noise of E1 tracking, as long as only the true signal is present
    code_m: Float[np.ndarray, " n"]
    carrier_m: Float[np.ndarray, " n"]
    doppler_hz: Float[np.ndarray, " n"]
    # errors with the same meaning as in `TruthBlock`
    iono_diff_m: Float[np.ndarray, " n"]
    broadcast_ionosphere_e1_m: Float[np.ndarray, " n"]
    bias_m: Float[np.ndarray, " n"]
    rays: RayBlock


class UndisturbedProcess:
    """Process that gives the truth without attacks at the epochs in order."""

    def __init__(self, of: Simulation) -> None:
        models, elevation = of.models, of.elevation
        receiver, own = named_streams(of.seed), named_streams(of.seed, of.svid)
        self._of = of
        self._clock = models.clock and models.clock.process(receiver)
        self._ionosphere = models.ionosphere and models.ionosphere.process(own)
        if self._ionosphere and elevation and hasattr(self._ionosphere, "shared"):
            self._ionosphere.shared(receiver, elevation.ionosphere_common)
        self._multipath = models.multipath and models.multipath.process(own)
        self._tracking = models.e1_tracking and models.e1_tracking.process(own, cn0_dbhz=of.cn0_e1_dbhz)
        self._bias = models.bias and models.bias.process(own, receiver=receiver)

    def advance(self, times_s: Float[np.ndarray, " n"]) -> UndisturbedTruth:
        """Return the truth of the next epochs, at times in s after the scenario's start."""
        count = times_s.size
        zero = np.zeros(count)
        models = self._of.models
        clock_m, drift_mps = _advanced(models.clock, self._clock, times_s, 2) if self._clock else (zero, zero)
        elevation, path = self._of.elevation, self._of.line_of_sight
        if elevation is None:
            motion = single_line_of_sight(path, times_s)
        else:
            motion = elevation.seen(times_s - self._of.clock_offset_s, clock_m)
        geometry = motion.geometry
        code_m, carrier_m, doppler_hz = (
            _advanced(models.e1_tracking, self._tracking, times_s, 3) if self._tracking else (zero, zero, zero)
        )
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
        return UndisturbedTruth(
            time_s=times_s,
            motion=motion,
            clock_m=clock_m,
            clock_drift_mps=drift_mps,
            code_m=code_m,
            carrier_m=carrier_m,
            doppler_hz=doppler_hz,
            iono_diff_m=iono_diff_m,
            broadcast_ionosphere_e1_m=elevation.broadcast_ionosphere_e1_m(times_s, clock_m) if elevation else zero,
            bias_m=_advanced(models.bias, self._bias, times_s) if self._bias else zero,
            rays=rays,
        )

    def _weaker(
        self, geometry: SatelliteGeometry, code_m: Float[np.ndarray, " n"], doppler_hz: Float[np.ndarray, " n"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Return code and Doppler noise at the strength of each epoch, from the noise at the nominal strength."""
        if self._of.models.e1_tracking is None:
            return code_m, doppler_hz
        code, doppler = noise_growth(
            self._of.models.e1_tracking, self._of.cn0_e1_dbhz, 20 * np.log10(geometry.amplitude)
        )
        return code_m * code, doppler_hz * doppler


def kept_truth(of: Simulation, count: int) -> UndisturbedTruth:
    """Return the truth of the first epochs of a simulation without attacks, from the cache if possible.

    If a simulation has arrays or parts that cannot be hashed, the truth is computed anew.
    """
    try:
        return _kept(of, count)
    except TypeError:
        return _begun(of, count)


def _begun(of: Simulation, count: int) -> UndisturbedTruth:
    return UndisturbedProcess(of).advance(np.arange(count) * of.epoch_interval_s)


_kept = lru_cache(maxsize=_KEPT_BLOCKS)(_begun)


def _advanced(model: Any, process: Any, times_s: Float[np.ndarray, " n"], n_errors: int = 1) -> Any:
    """Return the next values of a model's errors, after a check of values from a user's own class."""
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
