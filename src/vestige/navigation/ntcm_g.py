"""Compute the ionospheric delay from Galileo's broadcast coefficients by the closed formulas of NTCM-G [NTCM-G].

The European Commission publishes NTCM-G as an alternative to NeQuick-G for receivers. NTCM-G uses the three
coefficients of word 5, as NeQuick-G does, and 12 coefficients of its own in place of NeQuick's profile. The vertical
electron content is computed at the point where the line of sight pierces a shell at 450 km. The vertical electron
content is a product of five factors. The factors describe the effects of local time and season, the day of the year,
the geomagnetic latitude, the equatorial anomaly, and the solar activity. A mapping function converts the vertical
electron content to the slant electron content.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from vestige.constants import E1_CARRIER_HZ
from vestige.navigation.inav.ionosphere import BroadcastIonosphere

_EARTH_M, _SHELL_M = 6_371_000.0, 450_000.0
_DELAY_PER_TECU = 40.3e16  # m Hz² per TECU [NTCM-G]
_POLE_RAD = np.radians(79.74), np.radians(-71.78)  # latitude and longitude of the geomagnetic pole
_DEFAULT_ACTIVITY = 63.7  # solar activity in sfu if the message has no coefficients [OS-ICD, 5.1.6]
_LOCAL_TIME = (0.92519, 0.16951, 0.00443, 0.06626, 0.00899)
_YEAR = (0.21289, -0.15414)
_GEOMAGNETIC = -0.38439
# strength of each crest of the equatorial anomaly, and its geomagnetic latitude and width in degrees
_CRESTS = ((1.14023, 16.0, 12.0), (1.20556, -10.0, 13.0))
_ACTIVITY = (1.41808, 0.13985)


def ntcm_slant_tecu(
    ionosphere: BroadcastIonosphere,
    day_of_year: int,
    ut_hours: Float[np.ndarray, " n"],
    latitude_rad: Float[np.ndarray, " n"],
    longitude_rad: Float[np.ndarray, " n"],
    azimuth_rad: Float[np.ndarray, " n"],
    elevation_rad: Float[np.ndarray, " n"],
) -> Float[np.ndarray, " n"]:
    """Return the slant electron content from a receiver to a satellite in TECU, 10¹⁶ electrons/m².

    Parameters
    ----------
    ionosphere
        Coefficients of word 5. If all coefficients are zero, the solar activity is taken as 63.7 sfu. The disturbance
        flags are not used.
    day_of_year
        Day of the year, 1 to 366.
    ut_hours
        Universal time in hours. Multiples of 24 h may be added.
    latitude_rad, longitude_rad
        Latitude and longitude of the receiver in rad.
    azimuth_rad, elevation_rad
        Azimuth and elevation of the satellite in rad. A negative elevation counts as 0.

    Examples
    --------
    >>> one = np.ones(1)
    >>> low = BroadcastIonosphere(ai0_sfu=64.0)
    >>> round(float(ntcm_slant_tecu(low, 105, 12 * one, 0.8 * one, 0.2 * one, 0 * one, 1.5 * one)[0]), 1)
    17.7
    """
    elevation_rad = np.maximum(elevation_rad, 0.0)
    latitude, longitude = _pierce_point(latitude_rad, longitude_rad, azimuth_rad, elevation_rad)
    local_hours = ut_hours + np.degrees(longitude) / 15
    vertical = (
        _of_local_time(local_hours, latitude, day_of_year)
        * _of_year(day_of_year)
        * _of_geomagnetic_latitude(latitude, longitude)
        * (_ACTIVITY[0] + _ACTIVITY[1] * _activity(ionosphere))
    )
    across = _EARTH_M / (_EARTH_M + _SHELL_M) * np.sin(0.9782 * (np.pi / 2 - elevation_rad))
    return vertical / np.sqrt(1 - across**2)


def delay_e1_m(slant_tecu: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the delay of the code on E1 in m for a slant electron content.

    The carrier on E1 is advanced by as much as the code is delayed. On E6 delay and advance are `constants.GAMMA_E1_E6`
    times larger.

    Examples
    --------
    >>> round(float(delay_e1_m(np.array([10.0]))[0]), 3)
    1.624
    """
    return _DELAY_PER_TECU / E1_CARRIER_HZ**2 * slant_tecu


def _pierce_point(
    latitude_rad: Float[np.ndarray, " n"],
    longitude_rad: Float[np.ndarray, " n"],
    azimuth_rad: Float[np.ndarray, " n"],
    elevation_rad: Float[np.ndarray, " n"],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return latitude and longitude in rad of the point where the line of sight pierces the shell at 450 km."""
    angle = np.pi / 2 - elevation_rad - np.arcsin(_EARTH_M / (_EARTH_M + _SHELL_M) * np.cos(elevation_rad))
    latitude = np.arcsin(
        np.sin(latitude_rad) * np.cos(angle) + np.cos(latitude_rad) * np.sin(angle) * np.cos(azimuth_rad)
    )
    east = np.arcsin(np.clip(np.sin(angle) * np.sin(azimuth_rad) / np.cos(latitude), -1.0, 1.0))
    return latitude, longitude_rad + east


def _of_local_time(
    local_hours: Float[np.ndarray, " n"], latitude: Float[np.ndarray, " n"], day_of_year: int
) -> Float[np.ndarray, " n"]:
    """Return F1, the factor of local time and season, from the sun's elevation at noon and waves of 24, 12 and 8 h."""
    declination = np.radians(23.44) * np.sin(np.radians(0.9856 * (day_of_year - 80.7)))
    height = np.cos(latitude - declination)
    day, half, third = (
        2 * np.pi * hours / period for hours, period in ((local_hours - 14, 24), (local_hours, 12), (local_hours, 8))
    )
    a, b, c, d, e = _LOCAL_TIME
    waves = a * np.cos(day) + b * np.cos(half) + c * np.sin(half) + d * np.cos(third) + e * np.sin(third)
    return height + 0.4 + (height - 2 / np.pi * latitude * np.sin(declination)) * waves


def _of_year(day_of_year: int) -> float:
    """Return F2, the factor of the day of the year."""
    once, twice = ((day_of_year - day) * 2 * np.pi * n / 365.25 for n, day in ((1, 18), (2, 6)))
    return float(1 + _YEAR[0] * np.cos(once) + _YEAR[1] * np.cos(twice))


def _of_geomagnetic_latitude(
    latitude: Float[np.ndarray, " n"], longitude: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return F3 · F4, the factors of the geomagnetic latitude and of the two crests of the equatorial anomaly."""
    pole, pole_longitude = _POLE_RAD
    sine = np.sin(latitude) * np.sin(pole) + np.cos(latitude) * np.cos(pole) * np.cos(longitude - pole_longitude)
    magnetic = np.arcsin(np.clip(sine, -1.0, 1.0))
    crests = 1.0 + sum(
        strength * np.exp(-((np.degrees(magnetic) - at_deg) ** 2) / (2 * width_deg**2))
        for strength, at_deg, width_deg in _CRESTS
    )
    return (1 + _GEOMAGNETIC * np.cos(magnetic)) * crests


def _activity(ionosphere: BroadcastIonosphere) -> float:
    """Return the effective solar activity in sfu."""
    a0, a1, a2 = ionosphere.ai0_sfu, ionosphere.ai1_sfu_per_deg, ionosphere.ai2_sfu_per_deg2
    if a0 == a1 == a2 == 0:
        a0 = _DEFAULT_ACTIVITY
    return float(np.sqrt(a0**2 + 1633.33 * a1**2 + 4_802_000 * a2**2 + 3266.67 * a0 * a2))
