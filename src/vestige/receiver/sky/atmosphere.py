"""The delays of the atmosphere between a satellite and the receiver of a sky, at any time.

The troposphere delays code and carrier of both bands alike. The ionosphere delays the code and advances the carrier.
The effect on E6 is γ times the effect on E1. Both delays follow the satellite's direction, so they change smoothly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from vestige.constants import DAY_S, HOUR_S
from vestige.navigation.earth import geodetic_from_ecef
from vestige.navigation.inav.ionosphere import NO_IONOSPHERE, BroadcastIonosphere
from vestige.navigation.ntcm_g import delay_e1_m, ntcm_slant_tecu
from vestige.navigation.troposphere import SaastamoinenTroposphere

if TYPE_CHECKING:
    from vestige.receiver.sky.elevation import ElevationEffects, SatelliteRange

_STEP_S = 1.0  # step of the differences; the error from the fourth derivative is below a micrometre per second


@dataclass(frozen=True, slots=True, kw_only=True)
class Atmosphere:
    """Models of the atmosphere; None if a model is absent.

    Attributes
    ----------
    troposphere
        Model of the troposphere.
    ionosphere
        Coefficients of NTCM-G as word 5 of the message carries them.
    """

    troposphere: SaastamoinenTroposphere | None = None
    ionosphere: BroadcastIonosphere | None = None

    @property
    def there(self) -> bool:
        """Whether at least one model is present."""
        return self.troposphere is not None or self.ionosphere is not None

    @property
    def broadcast(self) -> BroadcastIonosphere:
        """Ionosphere model that satellites send in word 5."""
        return self.ionosphere or NO_IONOSPHERE


@dataclass(frozen=True, slots=True, kw_only=True)
class AtmosphericDelay:
    """The atmosphere on the path from one satellite; times are in s after the scenario's start, in system time."""

    atmosphere: Atmosphere
    path: SatelliteRange

    def troposphere_m(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the delay of the troposphere in m."""
        model = self.atmosphere.troposphere
        if model is None:
            return np.zeros_like(t_s)
        latitude_rad, _, height_m = geodetic_from_ecef(self.path.trajectory.motion(t_s).position_m)
        return model.delay_m(self.path.sight(t_s).elevation_rad, latitude_rad, height_m)

    def troposphere_rates(
        self, t_s: Float[np.ndarray, " n"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Return the first and the second derivative of `troposphere_m`, in m/s and m/s²."""
        if self.atmosphere.troposphere is None:
            return np.zeros_like(t_s), np.zeros_like(t_s)
        before_m, now_m, after_m = (self.troposphere_m(t_s + step_s) for step_s in (-_STEP_S, 0.0, _STEP_S))
        return (after_m - before_m) / (2 * _STEP_S), (after_m - 2 * now_m + before_m) / _STEP_S**2

    def ionosphere_e1_m(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the delay of the code on E1 by the ionosphere in m.

        The day of the year is taken at the scenario's start, so that the delay has no step at midnight.
        """
        ionosphere = self.atmosphere.ionosphere
        if ionosphere is None:
            return np.zeros_like(t_s)
        start = self.path.start.utc
        second = start.hour * HOUR_S + start.minute * 60 + start.second
        latitude_rad, longitude_rad, _ = geodetic_from_ecef(self.path.trajectory.motion(t_s).position_m)
        sight = self.path.sight(t_s)
        slant_tecu = ntcm_slant_tecu(
            ionosphere,
            start.timetuple().tm_yday,
            (second + t_s) % DAY_S / HOUR_S,
            latitude_rad,
            longitude_rad,
            sight.azimuth_rad,
            sight.elevation_rad,
        )
        return delay_e1_m(slant_tecu)


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayedRange:
    """Range from a satellite to a receiver with the delay of the troposphere, as in the pseudorange."""

    delay: AtmosphericDelay

    def range_m(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the range at times in s after the scenario's start, in m."""
        return self.delay.path.range_m(t_s) + self.delay.troposphere_m(t_s)

    def rate_mps(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the range rate in m/s."""
        return self.delay.path.rate_mps(t_s) + self.delay.troposphere_rates(t_s)[0]

    def acceleration_mps2(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the second derivative of the range in m/s²."""
        return self.delay.path.acceleration_mps2(t_s) + self.delay.troposphere_rates(t_s)[1]


def through_atmosphere(effects: ElevationEffects, atmosphere: Atmosphere) -> ElevationEffects:
    """Return a satellite whose signals pass an atmosphere; the same satellite without a model."""
    if not atmosphere.there:
        return effects
    return replace(effects, atmosphere=AtmosphericDelay(atmosphere=atmosphere, path=effects.path))
