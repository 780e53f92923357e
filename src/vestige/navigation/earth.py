"""Convert between Earth-centred, Earth-fixed (ECEF), geodetic and local coordinates of the rotating Earth.

Positions are ECEF in the Galileo Terrestrial Reference Frame (GTRF), in m. Latitude and height refer to the WGS 84
ellipsoid, which differs from the GTRF ellipsoid by about 0.1 mm. Local axes are east, north, up. Azimuth is counted
from north towards east.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

GRAVITATION_M3PS2 = 3.986004418e14  # μ [OS-ICD, 5.1.1]
ROTATION_RADPS = 7.2921151467e-5  # ω_E, rotation rate of the Earth [OS-ICD, 5.1.1]
SEMI_MAJOR_AXIS_M = 6_378_137.0  # a [WGS84]
FLATTENING = 1 / 298.257223563  # f [WGS84]

_SEMI_MINOR_AXIS_M = SEMI_MAJOR_AXIS_M * (1 - FLATTENING)
_E2 = FLATTENING * (2 - FLATTENING)  # first eccentricity squared
_SECOND_E2 = _E2 / (1 - _E2)
_BOWRING_STEPS = 4  # 4 steps keep the latitude error below 1e-15 rad from the ground to beyond Galileo's orbit


def ecef_from_geodetic(
    latitude_rad: Float[np.ndarray, " n"], longitude_rad: Float[np.ndarray, " n"], height_m: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3"]:
    """Return the ECEF positions in m of points with geodetic coordinates.

    Parameters
    ----------
    latitude_rad, longitude_rad
        Geodetic latitude and longitude in rad, positive north and east.
    height_m
        Height above the ellipsoid in m.
    """
    sine, cosine = np.sin(latitude_rad), np.cos(latitude_rad)
    radius = SEMI_MAJOR_AXIS_M / np.sqrt(1 - _E2 * sine**2)
    across = (radius + height_m) * cosine
    return np.stack(
        (across * np.cos(longitude_rad), across * np.sin(longitude_rad), (radius * (1 - _E2) + height_m) * sine),
        axis=-1,
    )


def geodetic_from_ecef(
    position_m: Float[np.ndarray, "n 3"],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return geodetic latitude and longitude in rad and height in m of ECEF positions, by Bowring's iteration.

    The iteration is valid at distances of 100 km and more from the Earth's centre. Latitude and height are exact at the
    poles too.

    Parameters
    ----------
    position_m
        ECEF positions in m.
    """
    x, y, z = np.moveaxis(position_m, -1, 0)
    across = np.hypot(x, y)
    reduced = np.arctan2(z * SEMI_MAJOR_AXIS_M, across * _SEMI_MINOR_AXIS_M)
    latitude = reduced
    for _ in range(_BOWRING_STEPS):
        latitude = np.arctan2(
            z + _SECOND_E2 * _SEMI_MINOR_AXIS_M * np.sin(reduced) ** 3,
            across - _E2 * SEMI_MAJOR_AXIS_M * np.cos(reduced) ** 3,
        )
        reduced = np.arctan2((1 - FLATTENING) * np.sin(latitude), np.cos(latitude))
    sine = np.sin(latitude)
    height = across * np.cos(latitude) + z * sine - SEMI_MAJOR_AXIS_M * np.sqrt(1 - _E2 * sine**2)
    return latitude, np.arctan2(y, x), height


def local_axes(
    latitude_rad: Float[np.ndarray, " n"], longitude_rad: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3 3"]:
    """Return the matrix with rows east, north, up, which rotates ECEF differences into local axes."""
    sine, cosine = np.sin(latitude_rad), np.cos(latitude_rad)
    sine_east, cosine_east = np.sin(longitude_rad), np.cos(longitude_rad)
    zero = np.zeros_like(sine + sine_east)
    east = np.stack((-sine_east + zero, cosine_east + zero, zero), axis=-1)
    north = np.stack((-sine * cosine_east, -sine * sine_east, cosine + zero), axis=-1)
    up = np.stack((cosine * cosine_east, cosine * sine_east, sine + zero), axis=-1)
    return np.stack((east, north, up), axis=-2)


def local_axes_at(position_m: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Return the local axes (rows east, north, up) at ECEF positions.

    If all positions are equal, the axes are computed only once.
    """
    if position_m.ndim == 2 and position_m.shape[0] > 1 and np.array_equal(position_m[1:], position_m[:-1]):
        return np.repeat(local_axes_at(position_m[:1]), position_m.shape[0], axis=0)
    latitude, longitude, _ = geodetic_from_ecef(position_m)
    return local_axes(latitude, longitude)


def azimuth_elevation(
    local: Float[np.ndarray, "n 3"],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return azimuth in [0, 2π) and elevation in rad of a direction in local coordinates (east, north, up)."""
    east, north, up = local[..., 0], local[..., 1], local[..., 2]
    return np.arctan2(east, north) % (2 * np.pi), np.arctan2(up, np.hypot(east, north))


def turned_with_earth(
    vector: Float[np.ndarray, "*n 3"], elapsed_s: Float[np.ndarray, "*n"]
) -> Float[np.ndarray, "*n 3"]:
    """Return the ECEF coordinates, `elapsed_s` later, of a vector that is fixed in space while the Earth rotates.

    The rotation is the Sagnac correction if the vector is a satellite's position at transmission, and `elapsed_s` is
    the travel time.
    """
    x, y = vector[..., 0], vector[..., 1]
    cosine, sine = np.cos(ROTATION_RADPS * elapsed_s), np.sin(ROTATION_RADPS * elapsed_s)
    turned = vector.copy()
    turned[..., 0] = cosine * x + sine * y
    turned[..., 1] = cosine * y - sine * x
    return turned


def carried_by_earth(vector: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Return ω × v, which is the velocity due to the rotation of the Earth if v is an ECEF position."""
    carried = np.zeros_like(vector)
    carried[..., 0] = -ROTATION_RADPS * vector[..., 1]
    carried[..., 1] = ROTATION_RADPS * vector[..., 0]
    return carried
