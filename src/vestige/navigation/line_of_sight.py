"""Compute the range from a satellite to a receiver, the derivatives of the range, and the direction to the satellite.

Theory of operation
-------------------
The formulas use a frame that is at rest in space and coincides with ECEF at reception. r is the position of the
receiver, s is the position of the satellite, τ is the travel time, and c is the speed of light:

    d = r(t) − s(t − τ),   ρ = |d| = c τ,   u = d/ρ
    ρ̇ = u·(ṙ − ṡ) / (1 − u·ṡ/c)                                        exact: s is taken at t − τ, and τ changes too
    ρ̈ = [ (|ḋ|² − ρ̇²)/ρ + u·(r̈ − s̈ (1 − τ̇)²) ] / (1 − u·ṡ/c),   ḋ = ṙ − ṡ(1 − τ̇)

The satellite's state at t − τ is in the ECEF axes of the time t − τ. The Earth, with the rotation rate ω_E, rotates by
ω_E τ until reception (Sagnac effect, up to about 45 m of range).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import azimuth_elevation, carried_by_earth, local_axes_at, turned_with_earth
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.orbit import satellite_position, satellite_state
from vestige.time import GalileoTime

_TYPICAL_FLIGHT_S = 0.08
_LIGHT_TIME_STEPS = 3  # each step multiplies the error by ρ̇/c < 3e-6, so 0.02 s becomes 60 ns, 0.2 ps and 1e-18 s


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceiverMotion:
    """Motion of a receiver's antenna at n times: ECEF position and its derivatives in the rotating frame."""

    position_m: Float[np.ndarray, "n 3"]
    velocity_mps: Float[np.ndarray, "n 3"]
    acceleration_mps2: Float[np.ndarray, "n 3"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LineOfSight:
    """Line of sight from a receiver to one satellite, at n times of reception.

    Attributes
    ----------
    range_m, rate_mps, acceleration_mps2
        Geometric range in m along the light's path, and its first and second derivatives, positive when the range
        grows.
    azimuth_rad, elevation_rad
        Azimuth and elevation of the satellite in rad.
    satellite_clock_m, satellite_clock_mps
        Error of the satellite clock on E1 at transmission, times c, in m, and the rate of this product in m/s. A
        positive error shortens the pseudorange.
    """

    range_m: Float[np.ndarray, " n"]
    rate_mps: Float[np.ndarray, " n"]
    acceleration_mps2: Float[np.ndarray, " n"]
    azimuth_rad: Float[np.ndarray, " n"]
    elevation_rad: Float[np.ndarray, " n"]
    satellite_clock_m: Float[np.ndarray, " n"]
    satellite_clock_mps: Float[np.ndarray, " n"]


def line_of_sight(
    ephemeris: Ephemeris, start: GalileoTime, elapsed_s: Float[np.ndarray, " n"], receiver: ReceiverMotion
) -> LineOfSight:
    """Return the line of sight to one satellite at reception times `start` + `elapsed_s` in system time.

    Parameters
    ----------
    ephemeris
        Orbit and clock of the satellite, which are assumed to be true.
    start, elapsed_s
        Times of reception `start` + `elapsed_s` in system time.
    receiver
        Motion of the receiver at the times of reception.
    """
    flight_s = _flight_s(ephemeris, start, elapsed_s, receiver)
    state = satellite_state(ephemeris, start, elapsed_s - flight_s)
    s, s_1, s_2 = (
        turned_with_earth(vector, flight_s)
        for vector in at_rest_in_space(state.position_m, state.velocity_mps, state.acceleration_mps2)
    )
    r, r_1, r_2 = at_rest_in_space(receiver.position_m, receiver.velocity_mps, receiver.acceleration_mps2)
    d = r - s
    rho = _length(d)
    u = d / rho[:, None]
    slowed = 1 - _dot(u, s_1) / SPEED_OF_LIGHT_MPS
    rate = _dot(u, r_1 - s_1) / slowed
    kept = 1 - rate / SPEED_OF_LIGHT_MPS  # seconds of transmission in a second of reception, 1 − τ̇
    d_1 = r_1 - s_1 * kept[:, None]
    bend = (_dot(d_1, d_1) - rate**2) / rho
    azimuth, elevation = azimuth_elevation(np.einsum("nij,nj->ni", local_axes_at(receiver.position_m), -d))
    return LineOfSight(
        range_m=rho,
        rate_mps=rate,
        acceleration_mps2=(bend + _dot(u, r_2 - s_2 * kept[:, None] ** 2)) / slowed,
        azimuth_rad=azimuth,
        elevation_rad=elevation,
        satellite_clock_m=SPEED_OF_LIGHT_MPS * state.clock_s,
        satellite_clock_mps=SPEED_OF_LIGHT_MPS * state.clock_drift * kept,
    )


def range_less_clock_m(
    ephemeris: Ephemeris, start: GalileoTime, elapsed_s: Float[np.ndarray, " n"], receiver: ReceiverMotion
) -> Float[np.ndarray, " n"]:
    """Return `range_m` − `satellite_clock_m` of `line_of_sight`, in about half the computing time."""
    flight_s = _flight_s(ephemeris, start, elapsed_s, receiver)
    position_m, clock_s = satellite_position(ephemeris, start, elapsed_s - flight_s)
    return _length(receiver.position_m - turned_with_earth(position_m, flight_s)) - SPEED_OF_LIGHT_MPS * clock_s


def _flight_s(
    ephemeris: Ephemeris, start: GalileoTime, elapsed_s: Float[np.ndarray, " n"], receiver: ReceiverMotion
) -> Float[np.ndarray, " n"]:
    """Return the travel time from the satellite to the receiver in s for signals received at the given times."""
    flight_s = np.full_like(elapsed_s, _TYPICAL_FLIGHT_S)
    for _ in range(_LIGHT_TIME_STEPS):
        position_m, _clock_s = satellite_position(ephemeris, start, elapsed_s - flight_s)
        flight_s = _length(receiver.position_m - turned_with_earth(position_m, flight_s)) / SPEED_OF_LIGHT_MPS
    return flight_s


def at_rest_in_space(
    position_m: Float[np.ndarray, "*n 3"],
    velocity_mps: Float[np.ndarray, "*n 3"],
    acceleration_mps2: Float[np.ndarray, "*n 3"],
) -> tuple[Float[np.ndarray, "*n 3"], Float[np.ndarray, "*n 3"], Float[np.ndarray, "*n 3"]]:
    """Return position, velocity and acceleration in the frame at rest that momentarily coincides with ECEF."""
    carried = carried_by_earth(position_m)
    coriolis = 2 * carried_by_earth(velocity_mps)
    return position_m, velocity_mps + carried, acceleration_mps2 + coriolis + carried_by_earth(carried)


def _dot(a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    return np.einsum("ni,ni->n", a, b)


def _length(a: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    return np.sqrt(_dot(a, a))
