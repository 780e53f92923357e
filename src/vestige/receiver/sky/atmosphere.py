"""Compute the delays of the atmosphere between a satellite and the receiver of a sky, at any time.

The troposphere delays code and carrier of both bands by the same length. The ionosphere delays the code and advances
the carrier. The effect of the ionosphere on E6 is γ = (f1/f6)² times the effect on E1. Tropospheric and ionospheric
delay depend on the satellite's direction, which changes smoothly. So both delays change smoothly.
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

_STEP_S = 1.0  # step in s of the central differences, whose error in the rate is below 1 µm/s


@dataclass(frozen=True, slots=True, kw_only=True)
class Atmosphere:
    """Models of troposphere and ionosphere, each None if the model is absent.

    Attributes
    ----------
    troposphere
        Model of the troposphere.
    ionosphere
        Coefficients of the ionosphere model NTCM-G, as in word 5 of the message.
    """

    troposphere: SaastamoinenTroposphere | None = None
    ionosphere: BroadcastIonosphere | None = None

    @property
    def there(self) -> bool:
        """Whether the atmosphere has at least one model."""
        return self.troposphere is not None or self.ionosphere is not None

    @property
    def broadcast(self) -> BroadcastIonosphere:
        """Coefficients of the ionosphere model that satellites send in word 5 of the message."""
        return self.ionosphere or NO_IONOSPHERE


@dataclass(frozen=True, slots=True, kw_only=True)
class AtmosphericDelay:
    """Delays of the atmosphere on the path from one satellite to the receiver.

    All times `t_s` are in s after the scenario's start, in system time.
    """

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
        """Return the ionospheric delay of the code on E1 in m.

        The model uses the day of the year at the scenario's start, so that the delay has no step at midnight.
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
    """Range from a satellite to a receiver, including the delay of the troposphere."""

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
    """Return the effects of the elevation on the signals of a satellite, with the delays of an atmosphere.

    If the atmosphere has no model, `effects` is returned unchanged.
    """
    if not atmosphere.there:
        return effects
    return replace(effects, atmosphere=AtmosphericDelay(atmosphere=atmosphere, path=effects.path))
