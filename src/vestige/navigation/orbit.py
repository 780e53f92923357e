"""Compute position, velocity, acceleration and clock of a satellite from its ephemeris [OS-ICD, 5.1.1, 5.1.3].

    E − e sin E = M0 + (√(μ/A³) + Δn) t,   t = time − toe           Kepler's equation, by Newton's method
    φ = ν + ω,   ν from E                                           argument of latitude
    u = φ + Cus sin 2φ + Cuc cos 2φ                                 r and i are corrected in the same way
    Ω = Ω0 + (Ω̇ − ω_E) t − ω_E · (toe's second of the week)         longitude of the node
    x = R_z(Ω) R_x(i) (r cos u, r sin u, 0)

Velocity and acceleration are the exact derivatives of the equations above in the rotating frame. The clock error for a
user of the pair (E1, E5b) is

    Δt = af0 + af1 t_c + af2 t_c² + F e √A sin E,   t_c = time − toc,   F = −2√μ/c²    [OS-ICD, 5.1.4]

A user of E1 alone subtracts BGD(E1,E5b) [OS-ICD, 5.1.5]. The equations use differences of `GalileoTime`, so the end of
a week needs no special case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import GRAVITATION_M3PS2, ROTATION_RADPS
from vestige.navigation.ephemeris import Ephemeris
from vestige.time import GalileoTime

RELATIVITY_S_PER_SQRT_M = (
    -2 * np.sqrt(GRAVITATION_M3PS2) / SPEED_OF_LIGHT_MPS**2
)  # F = −4.442807309e-10 [OS-ICD, 5.1.4]
_NEWTON_STEPS = 10  # 4 steps are enough for Galileo with e < 0.01, and 10 steps for e up to 0.9

_Curve = tuple[Float[np.ndarray, " n"], ...]  # value of a quantity, with or without its first two derivatives


@dataclass(frozen=True, slots=True, kw_only=True)
class SatelliteState:
    """State of a satellite at n times, in the rotating frame of each time.

    Attributes
    ----------
    position_m, velocity_mps, acceleration_mps2
        Position in m, velocity in m/s and acceleration in m/s² in ECEF coordinates.
    clock_s, clock_drift
        Satellite clock minus system time in s, for a user of E1 alone, and rate of this difference in s/s.
    """

    position_m: Float[np.ndarray, "n 3"]
    velocity_mps: Float[np.ndarray, "n 3"]
    acceleration_mps2: Float[np.ndarray, "n 3"]
    clock_s: Float[np.ndarray, " n"]
    clock_drift: Float[np.ndarray, " n"]


def eccentric_anomaly(mean_rad: Float[np.ndarray, " n"], eccentricity: float) -> Float[np.ndarray, " n"]:
    """Return the eccentric anomaly E with E − e sin E = M, in rad.

    Parameters
    ----------
    mean_rad
        Mean anomaly M in rad.
    eccentricity
        Eccentricity e, 0 to 0.9.
    """
    anomaly = mean_rad + eccentricity * np.sin(mean_rad)
    for _ in range(_NEWTON_STEPS):
        step = (anomaly - eccentricity * np.sin(anomaly) - mean_rad) / (1 - eccentricity * np.cos(anomaly))
        anomaly = anomaly - step
        if np.max(np.abs(step), initial=0.0) < 1e-14:
            break
    return anomaly


def satellite_state(ephemeris: Ephemeris, start: GalileoTime, elapsed_s: Float[np.ndarray, " n"]) -> SatelliteState:
    """Return the state of the satellite at `start` + `elapsed_s` in system time.

    Parameters
    ----------
    ephemeris
        Broadcast ephemeris of the satellite.
    start
        Any time from which `elapsed_s` counts.
    elapsed_s
        Time after `start` in s, positive or negative.
    """
    (position, velocity, acceleration), (sine, cosine, anomaly_1) = _orbit(
        ephemeris, start, elapsed_s, derivatives=True
    )
    orbit, t_clock = ephemeris, (start - ephemeris.toc) + elapsed_s
    return SatelliteState(
        position_m=position,
        velocity_mps=velocity,
        acceleration_mps2=acceleration,
        clock_s=_clock_s(ephemeris, t_clock, sine),
        clock_drift=orbit.af1 + 2 * orbit.af2_per_s * t_clock + _relativity_s(orbit) * cosine * anomaly_1,
    )


def satellite_position(
    ephemeris: Ephemeris, start: GalileoTime, elapsed_s: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, " n"]]:
    """Return `position_m` and `clock_s` of `satellite_state` with the same bits, in a shorter computing time.

    Parameters
    ----------
    ephemeris, start, elapsed_s
        Parameters of `satellite_state`.
    """
    (position,), (sine, _, _) = _orbit(ephemeris, start, elapsed_s, derivatives=False)
    return position, _clock_s(ephemeris, (start - ephemeris.toc) + elapsed_s, sine)


def _clock_s(orbit: Ephemeris, t: Float[np.ndarray, " n"], sine: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the error of the satellite clock for E1 alone, in s, at times `t` in s after toc; `sine` is sin E."""
    aging = (orbit.af1 + orbit.af2_per_s * t) * t
    return orbit.af0_s + aging + _relativity_s(orbit) * sine - orbit.bgd_e1_e5b_s


def _relativity_s(orbit: Ephemeris) -> float:
    return float(RELATIVITY_S_PER_SQRT_M * orbit.eccentricity * orbit.sqrt_a)


def _orbit(
    orbit: Ephemeris, start: GalileoTime, elapsed_s: Float[np.ndarray, " n"], *, derivatives: bool
) -> tuple[tuple[Float[np.ndarray, "n 3"], ...], tuple[Float[np.ndarray, " n"], ...]]:
    """Return the position, with or without its first two derivatives, and sin E, cos E and the derivative of E."""
    t = (start - orbit.toe) + elapsed_s
    axis, e = orbit.sqrt_a**2, orbit.eccentricity
    motion = np.sqrt(GRAVITATION_M3PS2 / axis**3) + orbit.delta_n_radps

    anomaly = eccentric_anomaly(orbit.m0_rad + motion * t, e)
    sine, cosine = np.sin(anomaly), np.cos(anomaly)
    near = 1 - e * cosine
    root = np.sqrt(1 - e**2)
    node_rate = orbit.omega_dot_radps - ROTATION_RADPS
    toe_s = orbit.toe.second + orbit.toe.fraction
    latitude: _Curve = (np.arctan2(root * sine, cosine - e) + orbit.omega_rad,)
    kepler: _Curve = (axis * near,)
    straight: _Curve = (orbit.i0_rad + orbit.i_dot_radps * t,)
    node: _Curve = (orbit.omega0_rad + node_rate * t - ROTATION_RADPS * toe_s,)
    anomaly_1 = motion / near
    if derivatives:
        anomaly_2 = -e * sine * anomaly_1**2 / near
        latitude += (root * anomaly_1 / near, root * (anomaly_2 - e * sine * anomaly_1**2 / near) / near)
        kepler += (axis * e * sine * anomaly_1, axis * e * (cosine * anomaly_1**2 + sine * anomaly_2))
        straight += (orbit.i_dot_radps + 0 * t, 0 * t)
        node += (np.full_like(t, node_rate), np.zeros_like(t))
    twice = np.sin(2 * latitude[0]), np.cos(2 * latitude[0])
    u = _sum(latitude, _harmonic(orbit.cus_rad, orbit.cuc_rad, latitude, twice))
    r = _sum(kepler, _harmonic(orbit.crs_m, orbit.crc_m, latitude, twice))
    i = _sum(straight, _harmonic(orbit.cis_rad, orbit.cic_rad, latitude, twice))
    return _turned(*_tilted(_polar(r, u), i), node), (sine, cosine, anomaly_1)


def _harmonic(sine_term: float, cosine_term: float, angle: _Curve, twice: _Curve) -> _Curve:
    """Return S sin 2φ + C cos 2φ, with derivatives if `angle` has derivatives.

    S is `sine_term`, C is `cosine_term`, φ is `angle`, and `twice` contains sin 2φ and cos 2φ.
    """
    sine, cosine = twice
    value = sine_term * sine + cosine_term * cosine
    if len(angle) == 1:
        return (value,)
    slope = 2 * (sine_term * cosine - cosine_term * sine)
    return value, slope * angle[1], slope * angle[2] - 4 * value * angle[1] ** 2


def _sum(a: _Curve, b: _Curve) -> _Curve:
    return tuple(one + other for one, other in zip(a, b, strict=True))


def _product(a: _Curve, b: _Curve) -> _Curve:
    if len(a) == 1:
        return (a[0] * b[0],)
    return a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2 * a[1] * b[1] + a[0] * b[2]


def _circle(angle: _Curve) -> tuple[_Curve, _Curve]:
    """Return cosine and sine of an angle, with derivatives if `angle` has derivatives."""
    cosine, sine = np.cos(angle[0]), np.sin(angle[0])
    if len(angle) == 1:
        return (cosine,), (sine,)
    rate2 = angle[1] ** 2
    return (
        (cosine, -sine * angle[1], -sine * angle[2] - cosine * rate2),
        (sine, cosine * angle[1], cosine * angle[2] - sine * rate2),
    )


def _polar(radius: _Curve, angle: _Curve) -> tuple[_Curve, _Curve]:
    """Return the two coordinates in the orbital plane of a point with a given radius and angle."""
    cosine, sine = _circle(angle)
    return _product(radius, cosine), _product(radius, sine)


def _tilted(plane: tuple[_Curve, _Curve], inclination: _Curve) -> tuple[_Curve, _Curve, _Curve]:
    """Return the three coordinates of a point in the orbital plane after a rotation about the line of nodes."""
    x, y = plane
    cosine, sine = _circle(inclination)
    return x, _product(y, cosine), _product(y, sine)


def _turned(x: _Curve, y: _Curve, z: _Curve, angle: _Curve) -> tuple[Float[np.ndarray, "n 3"], ...]:
    """Return the coordinates of a point, and their derivatives, after a rotation by `angle` about the Earth's axis."""
    cosine, sine = _circle(angle)
    minus_sine = tuple(-one for one in sine)
    east = _sum(_product(x, cosine), _product(y, minus_sine))
    north = _sum(_product(x, sine), _product(y, cosine))
    return tuple(np.stack(axes, axis=-1) for axes in zip(east, north, z, strict=True))
