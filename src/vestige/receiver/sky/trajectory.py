"""Define the trajectories of the receiver: static, on a circle, or through waypoints.

Every trajectory gives consistent position, velocity and acceleration at each time that the trajectory covers. So range,
range rate and range acceleration are also consistent. A natural cubic spline joins the waypoints without a jump in the
acceleration. Two waypoints give uniform motion along a straight line.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from scipy.linalg import solve_banded

from vestige.navigation.earth import ecef_from_geodetic, local_axes
from vestige.navigation.line_of_sight import ReceiverMotion


@runtime_checkable
class Trajectory(Protocol):
    """Position of the antenna as a function of time."""

    def motion(self, elapsed_s: Float[np.ndarray, " n"]) -> ReceiverMotion:
        """Return ECEF position, velocity and acceleration at times in s after the scenario's start."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticTrajectory:
    """Trajectory of a static receiver.

    Attributes
    ----------
    latitude_deg, longitude_deg, height_m
        Geodetic position on the WGS 84 ellipsoid.
    """

    latitude_deg: float
    longitude_deg: float
    height_m: float = 0.0
    kind: Literal["static"] = "static"

    def motion(self, elapsed_s: Float[np.ndarray, " n"]) -> ReceiverMotion:
        """Return ECEF position, velocity and acceleration at times in s after the scenario's start."""
        position, _ = _place(self.latitude_deg, self.longitude_deg, self.height_m)
        nothing = np.zeros((elapsed_s.size, 3))
        return ReceiverMotion(position_m=nothing + position, velocity_mps=nothing, acceleration_mps2=nothing)


@dataclass(frozen=True, slots=True, kw_only=True)
class CircularTrajectory:
    """Trajectory of a receiver on a circle in the horizontal plane of the circle's centre, from east to north.

    Attributes
    ----------
    latitude_deg, longitude_deg, height_m
        Geodetic position of the centre.
    radius_m, speed_mps
        Radius of the circle in m, and speed along the circle in m/s. The receiver starts east of the centre.
    """

    latitude_deg: float
    longitude_deg: float
    height_m: float = 0.0
    radius_m: float
    speed_mps: float
    kind: Literal["circle"] = "circle"

    def __post_init__(self) -> None:
        if not self.radius_m > 0:
            raise ValueError(f"the radius of a circle must be positive, found {self.radius_m}")

    def motion(self, elapsed_s: Float[np.ndarray, " n"]) -> ReceiverMotion:
        """Return ECEF position, velocity and acceleration at times in s after the scenario's start."""
        centre, axes = _place(self.latitude_deg, self.longitude_deg, self.height_m)
        rate = self.speed_mps / self.radius_m
        cosine, sine = np.cos(rate * elapsed_s)[:, None], np.sin(rate * elapsed_s)[:, None]
        outward, along = cosine * axes[0] + sine * axes[1], cosine * axes[1] - sine * axes[0]
        return ReceiverMotion(
            position_m=centre + self.radius_m * outward,
            velocity_mps=self.speed_mps * along,
            acceleration_mps2=-self.speed_mps * rate * outward,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WaypointTrajectory:
    """Trajectory of a receiver on a natural cubic spline through waypoints.

    Attributes
    ----------
    time_s
        Times of the waypoints in s after the scenario's start, ascending.
    position_m
        ECEF positions of the waypoints in m.
    """

    time_s: Float[np.ndarray, " k"]
    position_m: Float[np.ndarray, "k 3"]

    def __post_init__(self) -> None:
        if self.time_s.size < 2 or not np.all(np.diff(self.time_s) > 0):
            raise ValueError("a trajectory needs two waypoints or more, at ascending times")

    @classmethod
    def from_geodetic(cls, waypoints: Float[np.ndarray, "k 4"]) -> WaypointTrajectory:
        """Return the trajectory through rows of time in s, latitude and longitude in degrees, and height in m."""
        time_s, latitude, longitude, height_m = waypoints.T
        return cls(time_s=time_s, position_m=ecef_from_geodetic(np.radians(latitude), np.radians(longitude), height_m))

    def motion(self, elapsed_s: Float[np.ndarray, " n"]) -> ReceiverMotion:
        """Return ECEF position, velocity and acceleration at times in s after the scenario's start.

        The function raises `ValueError` if a time is before the first or after the last waypoint.
        """
        if np.any(elapsed_s < self.time_s[0]) or np.any(elapsed_s > self.time_s[-1]):
            raise ValueError(
                f"times: expected {self.time_s[0]:g} s to {self.time_s[-1]:g} s, the span of the waypoints"
            )
        bend = self._accelerations()
        leg = np.clip(np.searchsorted(self.time_s, elapsed_s, side="right") - 1, 0, self.time_s.size - 2)
        length = (self.time_s[leg + 1] - self.time_s[leg])[:, None]
        b = (elapsed_s - self.time_s[leg])[:, None] / length
        a = 1 - b
        p, q, p_2, q_2 = self.position_m[leg], self.position_m[leg + 1], bend[leg], bend[leg + 1]
        return ReceiverMotion(
            position_m=a * p + b * q + ((a**3 - a) * p_2 + (b**3 - b) * q_2) * length**2 / 6,
            velocity_mps=(q - p) / length + ((3 * b**2 - 1) * q_2 - (3 * a**2 - 1) * p_2) * length / 6,
            acceleration_mps2=a * p_2 + b * q_2,
        )

    def _accelerations(self) -> Float[np.ndarray, "k 3"]:
        """Return the acceleration at each waypoint in m/s², which is 0 at the first and the last waypoint."""
        h = np.diff(self.time_s)
        bend = np.zeros_like(self.position_m)
        if h.size > 1:
            bands = np.zeros((3, h.size - 1))
            bands[0, 1:], bands[1], bands[2, :-1] = h[1:-1] / 6, (h[:-1] + h[1:]) / 3, h[1:-1] / 6
            bend[1:-1] = solve_banded((1, 1), bands, np.diff(np.diff(self.position_m, axis=0) / h[:, None], axis=0))
        return bend


@lru_cache(maxsize=16)
def _place(
    latitude_deg: float, longitude_deg: float, height_m: float
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, "3 3"]]:
    """Return the ECEF position and the local axes of a geodetic position."""
    latitude, longitude = np.radians([[latitude_deg], [longitude_deg]])
    position_m = ecef_from_geodetic(latitude, longitude, np.array([height_m]))[0]
    axes = local_axes(latitude, longitude)[0]
    position_m.flags.writeable = axes.flags.writeable = False
    return position_m, axes
