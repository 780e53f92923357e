"""Define the tables `[constellation]` for satellites, `[trajectory]` for the receiver, and `[position]` for the fix."""

from __future__ import annotations

import hashlib
from abc import abstractmethod
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field, PrivateAttr, computed_field, field_validator

from vestige.constants import MAX_SVID
from vestige.navigation.ephemeris import FIT_INTERVAL_S, Ephemeris, nearest_ephemerides
from vestige.receiver.sky.constellation import ElevationCn0, walker_ephemerides
from vestige.receiver.sky.elevation import ElevationEffects, SatelliteRange
from vestige.receiver.sky.trajectory import CircularTrajectory, StaticTrajectory, Trajectory, WaypointTrajectory
from vestige.recording.navigation.rinex_navigation import read_rinex_navigation
from vestige.recording.numeric_csv import WAYPOINTS, read_numeric_csv
from vestige.scenario.toml.toml_file import InconsistentSettingsError, Section
from vestige.time import GalileoTime

# Interval in s of the times at which elevations are compared with the mask; longer if the run needs more than
# `_MOST_TIMES` times. A satellite that is above the mask for less than an interval may be left out.
_GRID_S = 60.0
_MOST_TIMES = 3000
_LARGEST_SPEED_MPS = 1000.0
_LARGEST_ACCELERATION_MPS2 = 100.0  # 10 times the acceleration of gravity
_AFTER_S = 1.0  # duration in s of the trajectory after the last epoch, longer than the travel time of the signals

Degrees = Annotated[float, Field(ge=-360, le=360)]
Latitude = Annotated[float, Field(ge=-90, le=90)]
Height = Annotated[float, Field(ge=-1e4, le=1e6)]


class Constellation(Section):
    """Base class of the tables `[constellation]` of all kinds.

    Attributes
    ----------
    mask_deg
        Elevation mask in degrees.
    cn0_fall_db
        Decrease in dB of the C/N0 from the zenith to the horizon, on E1 and E6; `receiver.cn0_e1_dbhz` and
        `receiver.cn0_dbhz` are the C/N0 at the zenith.
    ionosphere_common
        Share of the variance of the ionospheric error that all satellites have in common.
    svids
        SVIDs of the satellites to simulate; an empty list means all satellites of the constellation.
    """

    mask_deg: Annotated[float, Field(ge=0, le=89)] = 5.0
    cn0_fall_db: Annotated[float, Field(ge=0, le=40)] = 9.0
    ionosphere_common: Annotated[float, Field(ge=0, le=1)] = 0.5
    svids: tuple[Annotated[int, Field(ge=1, le=MAX_SVID)], ...] = ()

    @abstractmethod
    def ephemerides(self, start: GalileoTime) -> tuple[Ephemeris, ...]:
        """Return the ephemeris that each satellite broadcasts at `start`."""

    def _why_missing(self, svid: int) -> str:
        """Return the SVID and the reason why a satellite has no ephemeris, for an error message."""
        return f"{svid}, which is not in the constellation"

    def chosen(self, start: GalileoTime) -> tuple[Ephemeris, ...]:
        """Return the ephemerides of the satellites to simulate, by ascending SVID."""
        if len(set(self.svids)) < len(self.svids):
            raise InconsistentSettingsError("constellation.svids", list(self.svids), "each satellite once")
        found = {one.svid: one for one in self.ephemerides(start)}
        missing = sorted(set(self.svids) - set(found))
        if missing:
            raise InconsistentSettingsError(
                "constellation.svids",
                self._why_missing(missing[0]),
                f"satellites among {' '.join(map(str, sorted(found)))}",
            )
        return tuple(found[svid] for svid in sorted(set(self.svids) or found))


class WalkerConstellation(Constellation):
    """Reference constellation of Galileo, Walker 24/3/1."""

    kind: Literal["walker"]

    def ephemerides(self, start: GalileoTime) -> tuple[Ephemeris, ...]:
        """Return the ephemeris of each satellite of the Walker constellation."""
        return walker_ephemerides(start)


class RinexConstellation(Constellation):
    """Satellites of a RINEX navigation file; a relative path starts at the folder of the scenario file.

    Satellites are left out if the file marks E1-B or the data of E1-B as not usable, because no receiver uses these
    satellites. Satellites without an ephemeris within 4 h of the start are left out, too.
    """

    kind: Literal["rinex"]
    path: Annotated[str, Field(min_length=1)]

    _ephemerides: tuple[Ephemeris, ...] = PrivateAttr()

    def model_post_init(self, context: Any) -> None:
        """Read the RINEX file; `context` gives the folder of the scenario file."""
        self._ephemerides = read_rinex_navigation((context["folder"] if context else Path()) / self.path)

    @computed_field  # type: ignore[prop-decorator]
    @cached_property
    def ephemerides_sha256(self) -> str:
        """SHA-256 digest of the ephemerides, which are part of the scenario's identity."""
        return hashlib.sha256(repr(self._ephemerides).encode()).hexdigest()

    def ephemerides(self, start: GalileoTime) -> tuple[Ephemeris, ...]:
        """Return for each healthy satellite the ephemeris whose toe is nearest to `start`."""
        near = nearest_ephemerides(self._ephemerides, start).values()
        found = tuple(one for one in near if one.healthy)
        if not found:
            toes = sorted(one.toe for one in self._ephemerides)
            what = "no healthy satellite" if near else "ephemerides"
            raise InconsistentSettingsError(
                "constellation.path",
                f"{what} from {_to_minutes(toes[0])} to {_to_minutes(toes[-1])}",
                f"a RINEX file of the day of the scenario, within {FIT_INTERVAL_S / 3600:g} h of {_to_minutes(start)}",
            )
        return found

    def _why_missing(self, svid: int) -> str:
        in_file = any(one.svid == svid for one in self._ephemerides)
        name = Path(self.path).name
        return f"{svid}, " + (
            f"out of service or of another time in {name}" if in_file else f"without an ephemeris in {name}"
        )


def _to_minutes(time: GalileoTime) -> str:
    """Return a time as a short text without seconds."""
    return f"{time.calendar:%Y-%m-%d %H:%M} GST"


AnyConstellation = Annotated[WalkerConstellation | RinexConstellation, Field(discriminator="kind")]


class StaticTable(Section):
    """Static receiver, given by latitude and longitude in degrees and by height above the ellipsoid in m."""

    kind: Literal["static"]
    latitude_deg: Latitude
    longitude_deg: Degrees
    height_m: Height = 0.0

    def trajectory(self, first_s: float, last_s: float) -> Trajectory:  # noqa: ARG002  (the receiver does not move)
        """Return the trajectory of the static receiver."""
        return StaticTrajectory(
            latitude_deg=self.latitude_deg, longitude_deg=self.longitude_deg, height_m=self.height_m
        )


class CircleTable(Section):
    """Receiver that moves on a circle at constant height and speed."""

    kind: Literal["circle"]
    latitude_deg: Latitude
    longitude_deg: Degrees
    height_m: Height = 0.0
    radius_m: Annotated[float, Field(ge=0.1, le=1e6)]
    speed_mps: Annotated[float, Field(ge=0, le=_LARGEST_SPEED_MPS)]

    @field_validator("speed_mps")
    @classmethod
    def _possible(cls, speed_mps: float, info: Any) -> float:
        radius_m = info.data.get("radius_m")
        if radius_m and speed_mps**2 / radius_m > _LARGEST_ACCELERATION_MPS2:
            raise ValueError(f"a speed with at most {_LARGEST_ACCELERATION_MPS2:g} m/s² on this circle")
        return speed_mps

    def trajectory(self, first_s: float, last_s: float) -> Trajectory:  # noqa: ARG002  (a circle has no end)
        """Return the trajectory on the circle."""
        return CircularTrajectory(
            latitude_deg=self.latitude_deg,
            longitude_deg=self.longitude_deg,
            height_m=self.height_m,
            radius_m=self.radius_m,
            speed_mps=self.speed_mps,
        )


class WaypointsTable(Section):
    """Receiver that moves through the waypoints of a CSV file; a relative path starts at the scenario file's folder."""

    kind: Literal["waypoints"]
    path: Annotated[str, Field(min_length=1)]

    _points: Float[np.ndarray, "k 4"] = PrivateAttr()

    def model_post_init(self, context: Any) -> None:
        """Read the CSV file of waypoints; `context` gives the folder of the scenario file."""
        self._points = read_numeric_csv((context["folder"] if context else Path()) / self.path, WAYPOINTS)

    @computed_field  # type: ignore[prop-decorator]
    @cached_property
    def points_sha256(self) -> str:
        """SHA-256 digest of the waypoints, which are part of the scenario's identity."""
        return hashlib.sha256(self._points.tobytes()).hexdigest()

    def trajectory(self, first_s: float, last_s: float) -> Trajectory:
        """Return the trajectory through the waypoints.

        The function raises `InconsistentSettingsError` if the waypoints do not cover the time from `first_s` to
        `last_s`, or if the speed or the acceleration is too high.
        """
        begin_s, end_s = float(self._points[0, 0]), float(self._points[-1, 0])
        if begin_s > first_s or end_s < last_s:
            raise InconsistentSettingsError(
                "trajectory.path",
                f"waypoints from {begin_s:g} to {end_s:g} s",
                f"from {first_s + 0.0:g} to {last_s:g} s",
            )
        way = WaypointTrajectory.from_geodetic(self._points)
        middles_s = (way.time_s[1:] + way.time_s[:-1]) / 2
        for name, value, limit, unit in (
            ("speed", way.motion(middles_s).velocity_mps, _LARGEST_SPEED_MPS, "m/s"),
            ("acceleration", way.motion(way.time_s).acceleration_mps2, _LARGEST_ACCELERATION_MPS2, "m/s²"),
        ):
            size = np.linalg.norm(value, axis=1)
            worst = int(np.argmax(size))
            if size[worst] > limit:
                found = f"{name} {size[worst]:.3g} {unit} at waypoint {worst + 1}"
                raise InconsistentSettingsError("trajectory.path", found, f"at most {limit:g} {unit}")
        return way


class PositionTable(Section):
    """Assumed errors of E1 pseudoranges in addition to the tracking noise.

    Attributes
    ----------
    ionosphere_sigma_m
        Standard deviation of the ionospheric residual on E1 in m at 17.5° elevation.
    ionosphere_common
        Share of the variance of the ionospheric error that the covariance of the fix assumes to be common to all
        satellites.
    multipath_sigma_m
        Standard deviation of multipath in m at 16° elevation; the value at other elevations follows from the power of
        the reflections.
    floor_sigma_m
        Standard deviation of all other errors in m.
    p_fa
        Value without effect. The false-alarm probability of RAIM follows from the number of false alarms a day that the
        level may raise. The key remains so that older scenarios and results can be read.
    """

    ionosphere_sigma_m: Annotated[float, Field(ge=0, le=1000)] = 0.0
    ionosphere_common: Annotated[float, Field(ge=0, le=1)] = 0.5
    multipath_sigma_m: Annotated[float, Field(ge=0, le=1000)] = 0.0
    floor_sigma_m: Annotated[float, Field(ge=1e-3, le=1000)] = 0.1
    p_fa: Annotated[float, Field(ge=1e-12, le=0.1)] = 1e-5


AnyTrajectory = Annotated[StaticTable | CircleTable | WaypointsTable, Field(discriminator="kind")]


def satellites_in_view(
    constellation: Constellation, table: AnyTrajectory, start: GalileoTime, *, duration_s: float, longest_delay_s: float
) -> tuple[ElevationEffects, ...]:
    """Return the satellites that are above the mask at some time of a run, by ascending SVID.

    The elevation is tested every minute, or less often in long runs.

    `longest_delay_s` is the longest delay in s with which an attacker replays signals. The function raises
    `InconsistentSettingsError` if no satellite is in view, or the trajectory does not cover the whole run.
    """
    trajectory = table.trajectory(-longest_delay_s, duration_s + _AFTER_S)
    # the scenarios of a threat table need the same elevations many times, so the elevations are cached
    elevations_rad = _kept_elevations_rad if isinstance(trajectory, StaticTrajectory) else _elevations_rad
    antenna = ElevationCn0(zenith_dbhz=0.0, fall_db=constellation.cn0_fall_db)
    found = []
    for ephemeris in constellation.chosen(start):
        path = SatelliteRange(ephemeris=ephemeris, start=start, trajectory=trajectory)
        first_rad, highest_rad = elevations_rad(path, duration_s)
        if highest_rad >= np.radians(constellation.mask_deg):
            found.append(
                ElevationEffects(
                    path=path,
                    mask_deg=constellation.mask_deg,
                    first_rad=first_rad,
                    antenna=antenna,
                    ionosphere_common=constellation.ionosphere_common,
                )
            )
    if not found:
        raise InconsistentSettingsError("constellation", "no satellite in view", "at least one")
    return tuple(found)


def _elevations_rad(path: SatelliteRange, duration_s: float) -> tuple[float, float]:
    """Return the elevation of a satellite at the beginning of a run, and its highest elevation."""
    times_s = np.linspace(0.0, duration_s, int(np.clip(np.ceil(duration_s / _GRID_S) + 1, 2, _MOST_TIMES)))
    elevation_rad = path.sight(times_s).elevation_rad
    return float(elevation_rad[0]), float(np.max(elevation_rad))


_kept_elevations_rad = lru_cache(maxsize=256)(_elevations_rad)
