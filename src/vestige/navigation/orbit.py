"""Satellite position, velocity, acceleration and clock from a broadcast ephemeris [OS-ICD, 5.1.1, 5.1.3].

    E − e sin E = M0 + (√(μ/A³) + Δn) t,   t = time − toe           Kepler's equation, by Newton's method
    φ = ν + ω,   ν from E                                           argument of latitude
    u = φ + Cus sin 2φ + Cuc cos 2φ,  r, i alike
    Ω = Ω0 + (Ω̇ − ω_E) t − ω_E · (toe's second of the week)         longitude of the node
    x = R_z(Ω) R_x(i) (r cos u, r sin u, 0)

Velocity and acceleration are the exact derivatives of these equations in the rotating frame. The clock is

    Δt = af0 + af1 t_c + af2 t_c² + F e √A sin E,   t_c = time − toc,   F = −2√μ/c²    [OS-ICD, 5.1.4]

for a user of the pair (E1, E5b); a user of E1 alone subtracts BGD(E1,E5b) [OS-ICD, 5.1.5]. Times enter as differences
of `GalileoTime`, so the end of a week is a time like any other.
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
_NEWTON_STEPS = 10  # quadratic: 4 for the e < 0.01 of Galileo, 10 up to e = 0.9

_Curve = tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"], Float[np.ndarray, " n"]]  # value and two derivatives


@dataclass(frozen=True, slots=True, kw_only=True)
class SatelliteState:
    """A satellite at n times, in the rotating frame of each time.

    Attributes
    ----------
    position_m, velocity_mps, acceleration_mps2
        ECEF.
    clock_s, clock_drift
        Satellite clock minus system time, for a user of E1 alone, and its rate in s/s.
    """

    position_m: Float[np.ndarray, "n 3"]
    velocity_mps: Float[np.ndarray, "n 3"]
    acceleration_mps2: Float[np.ndarray, "n 3"]
    clock_s: Float[np.ndarray, " n"]
    clock_drift: Float[np.ndarray, " n"]


def eccentric_anomaly(mean_rad: Float[np.ndarray, " n"], eccentricity: float) -> Float[np.ndarray, " n"]:
    """Return E with E − e sin E = M, in rad.

    Parameters
    ----------
    mean_rad
        M.
    eccentricity
        e, 0 … 0.9.
    """
    anomaly = mean_rad + eccentricity * np.sin(mean_rad)
    for _ in range(_NEWTON_STEPS):
        step = (anomaly - eccentricity * np.sin(anomaly) - mean_rad) / (1 - eccentricity * np.cos(anomaly))
        anomaly = anomaly - step
        if np.max(np.abs(step), initial=0.0) < 1e-14:
            break
    return anomaly


def satellite_state(ephemeris: Ephemeris, start: GalileoTime, elapsed_s: Float[np.ndarray, " n"]) -> SatelliteState:
    """Return the satellite at `start` + `elapsed_s` in system time.

    Parameters
    ----------
    ephemeris
        Its broadcast ephemeris.
    start
        Any time.
    elapsed_s
        Seconds after it, of any sign.
    """
    orbit, t = ephemeris, (start - ephemeris.toe) + elapsed_s
    axis, e = orbit.sqrt_a**2, orbit.eccentricity
    motion = np.sqrt(GRAVITATION_M3PS2 / axis**3) + orbit.delta_n_radps

    anomaly = eccentric_anomaly(orbit.m0_rad + motion * t, e)
    sine, cosine = np.sin(anomaly), np.cos(anomaly)
    near = 1 - e * cosine
    anomaly_1 = motion / near
    anomaly_2 = -e * sine * anomaly_1**2 / near
    root = np.sqrt(1 - e**2)
    latitude: _Curve = (
        np.arctan2(root * sine, cosine - e) + orbit.omega_rad,
        root * anomaly_1 / near,
        root * (anomaly_2 - e * sine * anomaly_1**2 / near) / near,
    )
    u = _sum(latitude, _harmonic(orbit.cus_rad, orbit.cuc_rad, latitude))
    kepler: _Curve = (axis * near, axis * e * sine * anomaly_1, axis * e * (cosine * anomaly_1**2 + sine * anomaly_2))
    r = _sum(kepler, _harmonic(orbit.crs_m, orbit.crc_m, latitude))
    straight: _Curve = (orbit.i0_rad + orbit.i_dot_radps * t, orbit.i_dot_radps + 0 * t, 0 * t)
    i = _sum(straight, _harmonic(orbit.cis_rad, orbit.cic_rad, latitude))

    toe_s = orbit.toe.second + orbit.toe.fraction
    node_rate = orbit.omega_dot_radps - ROTATION_RADPS
    node = orbit.omega0_rad + node_rate * t - ROTATION_RADPS * toe_s
    position, velocity, acceleration = _turned(*_tilted(_polar(r, u), i), node, node_rate)

    t_clock = (start - ephemeris.toc) + elapsed_s
    relativity = RELATIVITY_S_PER_SQRT_M * e * orbit.sqrt_a
    return SatelliteState(
        position_m=position,
        velocity_mps=velocity,
        acceleration_mps2=acceleration,
        clock_s=orbit.af0_s
        + (orbit.af1 + orbit.af2_per_s * t_clock) * t_clock
        + relativity * sine
        - orbit.bgd_e1_e5b_s,
        clock_drift=orbit.af1 + 2 * orbit.af2_per_s * t_clock + relativity * cosine * anomaly_1,
    )


def _harmonic(sine_term: float, cosine_term: float, angle: _Curve) -> _Curve:
    """Return S sin 2φ + C cos 2φ and its derivatives."""
    phi, phi_1, phi_2 = angle
    sine, cosine = np.sin(2 * phi), np.cos(2 * phi)
    value = sine_term * sine + cosine_term * cosine
    slope = 2 * (sine_term * cosine - cosine_term * sine)
    return value, slope * phi_1, slope * phi_2 - 4 * value * phi_1**2


def _sum(a: _Curve, b: _Curve) -> _Curve:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _product(a: _Curve, b: _Curve) -> _Curve:
    return a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2 * a[1] * b[1] + a[0] * b[2]


def _circle(angle: _Curve) -> tuple[_Curve, _Curve]:
    """Return cosine and sine of an angle."""
    cosine, sine = np.cos(angle[0]), np.sin(angle[0])
    rate2 = angle[1] ** 2
    return (
        (cosine, -sine * angle[1], -sine * angle[2] - cosine * rate2),
        (sine, cosine * angle[1], cosine * angle[2] - sine * rate2),
    )


def _polar(radius: _Curve, angle: _Curve) -> tuple[_Curve, _Curve]:
    """Return the point in the orbital plane."""
    cosine, sine = _circle(angle)
    return _product(radius, cosine), _product(radius, sine)


def _tilted(plane: tuple[_Curve, _Curve], inclination: _Curve) -> tuple[_Curve, _Curve, _Curve]:
    """Return the point turned about the line of nodes."""
    x, y = plane
    cosine, sine = _circle(inclination)
    return x, _product(y, cosine), _product(y, sine)


def _turned(
    x: _Curve, y: _Curve, z: _Curve, angle: Float[np.ndarray, " n"], rate: float
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    """Return position, velocity and acceleration of the point turned about the Earth's axis."""
    cosine, sine = _circle((angle, np.full_like(angle, rate), np.zeros_like(angle)))
    minus_sine: _Curve = (-sine[0], -sine[1], -sine[2])
    east = _sum(_product(x, cosine), _product(y, minus_sine))
    north = _sum(_product(x, sine), _product(y, cosine))
    position, velocity, acceleration = (np.stack((east[k], north[k], z[k]), axis=-1) for k in range(3))
    return position, velocity, acceleration
