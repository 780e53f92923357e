"""Compute standard deviations of a receiver's E1 observations from C/N0 and elevation.

    σ² = σ_code²(C/N0) + σ_ionosphere² M(e)² + σ_multipath² A(e)² + σ_floor²        variance of a pseudorange
    σ_ρ̇ = λ σ_f(C/N0)                                                                standard deviation of a range rate

σ_code and σ_f are the standard deviations of the noise of the receiver's loops (`thermal_noise`, [KAPLAN06, 5.6.2]). λ
is the wavelength of E1. The obliquity M and the relative multipath A at the elevation e come from `elevation_model`. A
part of the ionospheric error is common to all satellites. The covariance of the fix allows for this correlation of the
errors, but the weights of the fix do not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.navigation.elevation_model import obliquity, relative_ray_amplitude

_GRID_DBHZ = np.arange(10.0, 75.5, 1.0)


@runtime_checkable
class LoopNoise(Protocol):
    """Thermal noise of the receiver's tracking loops: standard deviations against C/N0 in dBHz.

    A model must support hashing, comparison and pickling, as a frozen dataclass does.
    """

    def __hash__(self) -> int:
        """Return a hash of the model, which is equal for equal models."""

    def code_sigma_m(self, cn0_dbhz: float) -> float:
        """Return the standard deviation of a pseudorange in m."""

    def doppler_sigma_hz(self, cn0_dbhz: float) -> float:
        """Return the standard deviation of a Doppler in Hz."""


_NEGLIGIBLE_M = 0.01  # largest error that is negligible compared with the noise of a loop


@dataclass(frozen=True, slots=True, kw_only=True)
class PseudorangeErrors:
    """Standard deviations of E1 observations."""

    floor_m: float = 5.0  # all errors that no other field describes
    ionosphere_m: float = 0.0  # residual of the ionosphere on E1 at 17.5° elevation
    ionosphere_common: float = 0.5  # share of the variance of the ionospheric error that is common to all satellites
    multipath_m: float = 0.0  # error of multipath at 16° elevation
    rate_mps: float = 0.1  # error of a range rate, used if `loops` is None
    loops: LoopNoise | None = None  # noise of the tracking loops; None if `floor_m` includes this noise

    @property
    def needs_elevation(self) -> bool:
        """Whether the standard deviations depend on the elevation."""
        return bool(self.ionosphere_m or self.multipath_m)

    @property
    def is_bound(self) -> bool:
        """Whether the standard deviations are upper limits; False if they contain the noise of the loops only."""
        return self.loops is None or self.needs_elevation or self.floor_m > _NEGLIGIBLE_M

    def range_m(
        self, cn0_dbhz: Float[np.ndarray, "n m"], elevation_rad: Float[np.ndarray, "n m"]
    ) -> Float[np.ndarray, "n m"]:
        """Return the standard deviation of pseudoranges; NaN where a needed C/N0 or elevation is unknown."""
        code_m = np.zeros(cn0_dbhz.shape) if self.loops is None else _sigma(self.loops, "code_sigma_m", cn0_dbhz)
        if not self.needs_elevation:
            return np.sqrt(code_m**2 + self.floor_m**2)
        ionosphere_m = self.ionosphere_m * obliquity(elevation_rad)
        multipath_m = self.multipath_m * relative_ray_amplitude(elevation_rad)
        return np.sqrt(code_m**2 + ionosphere_m**2 + multipath_m**2 + self.floor_m**2)

    def common_m(self, elevation_rad: Float[np.ndarray, "n m"]) -> Float[np.ndarray, "n m"] | None:
        """Return σ of the common ionospheric error in each pseudorange; None if the ionosphere is not modelled."""
        if not self.ionosphere_m:
            return None
        return math.sqrt(self.ionosphere_common) * self.ionosphere_m * obliquity(elevation_rad)

    def rate_sigma_mps(self, cn0_dbhz: Float[np.ndarray, "n m"]) -> Float[np.ndarray, "n m"]:
        """Return the standard deviation of range rates."""
        if self.loops is None:
            return np.full(cn0_dbhz.shape, self.rate_mps)
        return _sigma(self.loops, "doppler_sigma_hz", cn0_dbhz) * SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ


def _sigma(loops: LoopNoise, name: str, cn0_dbhz: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return a standard deviation of `loops`, interpolated between whole dBHz from 10 to 75 dBHz.

    The logarithm is interpolated. For `BetzTrackingNoise` the relative error is below 1e-3 from 15 to 60 dBHz.
    """
    return np.exp(np.interp(cn0_dbhz, _GRID_DBHZ, _log_sigma(loops, name)))


@lru_cache(maxsize=32)
def _log_sigma(loops: LoopNoise, name: str) -> Float[np.ndarray, " k"]:
    return np.log([getattr(loops, name)(float(cn0_dbhz)) for cn0_dbhz in _GRID_DBHZ])
