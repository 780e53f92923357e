"""Compute the multipath power and the obliquity of the path through the ionosphere from the elevation.

The multipath power is −14 dB up to 5°, falls linearly in dB to −18 dB at 30°, and is −22 dB above 30°. At 16.25° the
power is −15.8 dB, as in the paper. The ionosphere is a thin shell at the height h = 350 km above an Earth of radius
R = 6371 km. The obliquity at the elevation e is M(e) = 1/√(1 − (R cos e/(R + h))²).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

_EARTH_M, _SHELL_M = 6_371_000.0, 350_000.0
REFERENCE_OBLIQUITY_DEG = 17.5  # middle of 5 to 30°, the elevations of the ionosphere presets
LOWEST_DEG, HIGH_DEG = 5.0, 30.0
MULTIPATH_DB = (-14.0, -18.0)  # multipath power at LOWEST_DEG and at HIGH_DEG
OPEN_SKY_DB = -22.0
REFERENCE_MULTIPATH_DB = -15.8  # [WFO, Sec. VI-A]
_GRID_DEG = np.arange(0.0, 90.5, 0.5)


def multipath_power_db(elevation_deg: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return the mean power in dB of all reflections together, relative to the power of the direct signal."""
    low_db = np.interp(elevation_deg, [LOWEST_DEG, HIGH_DEG], MULTIPATH_DB)
    return np.where(np.asarray(elevation_deg) > HIGH_DEG, OPEN_SKY_DB, low_db)


def relative_ray_amplitude(elevation_rad: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return the amplitude of reflections relative to the amplitude at −15.8 dB, and 1 where the elevation is NaN."""
    degrees = np.degrees(np.where(np.isfinite(elevation_rad), elevation_rad, 0.0))
    power_db = multipath_power_db(np.maximum(_GRID_DEG, LOWEST_DEG))
    place = np.clip(np.round(degrees * 2), 0, power_db.size - 1).astype(np.int64)
    amplitude = 10 ** ((power_db[place] - REFERENCE_MULTIPATH_DB) / 20)
    return np.where(np.isfinite(elevation_rad), amplitude, 1.0)


def obliquity(elevation_rad: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return the ratio M(e)/M(17.5°) of the obliquities at the elevation e and at 17.5°.

    Elevations below the horizon count as 0°.
    """
    return _mapping(elevation_rad) / _mapping(np.radians(np.array([REFERENCE_OBLIQUITY_DEG])))


def _mapping(elevation_rad: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    across = np.cos(np.maximum(elevation_rad, 0.0)) * _EARTH_M / (_EARTH_M + _SHELL_M)
    return 1 / np.sqrt(1 - across**2)
