"""Compute the effects of a satellite's elevation on signal strength, multipath and ionospheric delay.

Theory of operation
-------------------
    strength      C/N0(e) of the antenna at the elevation e (`ElevationCn0`). The nominal C/N0 is the C/N0 at the first
                  epoch. The amplitude of the line of sight is the square root of the gain relative to the first epoch.
    reflections   relative amplitude of `navigation.elevation_model`
    ionosphere    obliquity M(e)/M(17.5°) of `navigation.elevation_model`

The ionospheric residuals eᵢ of a receiver's satellites have a common part. z₀ is the Gauss-Markov process of the
receiver, zᵢ is the process of satellite i, and ρ is the share of the common part in the variance:

    eᵢ = M(e)/M(17.5°) · F⁻¹(Φ(√ρ z₀ + √(1 − ρ) zᵢ))

The symbol Φ is the distribution function of the standard normal distribution. F is the distribution function of the
residual of a single satellite at the elevation 17.5°. The common part does not change F.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.line_of_sight import LineOfSight, line_of_sight, range_less_clock_m
from vestige.receiver.sky.atmosphere import AtmosphericDelay, DelayedRange
from vestige.receiver.sky.constellation import ElevationCn0
from vestige.receiver.sky.trajectory import StaticTrajectory, Trajectory
from vestige.signal_generator.range_model import RangeHistory
from vestige.time import GalileoTime

# largest number of times in a cached line of sight, because more times take megabytes for each satellite
_KEPT_TIMES = 5000
# largest number of times in a cached call of `_kept_range_m`
_KEPT_RANGES = 128
# number of cached lines of sight, of which a delayed signal in a troposphere needs six for range, rate and acceleration
_KEPT_SIGHTS = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class SatelliteGeometry:
    """Direction and signal strength of a satellite at n epochs.

    A single line of sight is always in view, with the nominal strength.
    """

    # receiver's clock minus the time to which the line of sight refers, in s
    clock_offset_s: Float[np.ndarray, " n"]
    amplitude: Float[np.ndarray, " n"]  # amplitude of the line of sight, divided by the nominal amplitude
    azimuth_rad: Float[np.ndarray, " n"]  # azimuth; NaN on a single line of sight
    elevation_rad: Float[np.ndarray, " n"]  # elevation; NaN on a single line of sight
    in_view: Bool[np.ndarray, " n"]  # whether the satellite is above the elevation mask

    @classmethod
    def single(cls, n: int) -> SatelliteGeometry:
        """Return the geometry of a single line of sight at `n` epochs."""
        unknown = np.full(n, np.nan)
        return cls(
            clock_offset_s=np.zeros(n),
            amplitude=np.ones(n),
            azimuth_rad=unknown,
            elevation_rad=unknown,
            in_view=np.ones(n, bool),
        )


class SatelliteMotion(NamedTuple):
    """Direction, signal strength, range, range rate and range acceleration of a satellite."""

    geometry: SatelliteGeometry
    range_m: Float[np.ndarray, " n"]
    rate_mps: Float[np.ndarray, " n"]
    acceleration_mps2: Float[np.ndarray, " n"]


def single_line_of_sight(line_of_sight: RangeHistory, time_s: Float[np.ndarray, " n"]) -> SatelliteMotion:
    """Return range, rate and acceleration of a single line of sight at times on the receiver's clock."""
    return SatelliteMotion(
        SatelliteGeometry.single(time_s.size),
        line_of_sight.range_m(time_s),
        line_of_sight.rate_mps(time_s),
        line_of_sight.acceleration_mps2(time_s),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SatelliteRange:
    """Range from a satellite to a receiver, less the satellite's clock error, at reception times in system time."""

    ephemeris: Ephemeris  # orbit and clock, taken as true
    start: GalileoTime  # start of the scenario
    trajectory: Trajectory  # motion of the receiver
    # the latest lines of sight, cached by the bytes of their times, because range, rate and acceleration need the same
    # line of sight
    _last: dict[bytes, LineOfSight] = field(init=False, default_factory=dict, repr=False, compare=False)

    def sight(self, t_s: Float[np.ndarray, " n"]) -> LineOfSight:
        """Return the line of sight at times in s after the scenario's start."""
        if t_s.size > _KEPT_TIMES:
            return line_of_sight(self.ephemeris, self.start, t_s, self.trajectory.motion(t_s))
        times = t_s.tobytes()
        found = self._last.get(times)
        if found is None:
            found = line_of_sight(self.ephemeris, self.start, t_s, self.trajectory.motion(t_s))
            if len(self._last) >= _KEPT_SIGHTS:
                self._last.clear()
            self._last[times] = found
        return found

    def range_m(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the range at times in s after the scenario's start, in m."""
        known = self._last.get(t_s.tobytes()) if t_s.size <= _KEPT_TIMES else None
        if known is not None:
            return known.range_m - known.satellite_clock_m
        if t_s.size > _KEPT_RANGES or not isinstance(self.trajectory, StaticTrajectory):
            return range_less_clock_m(self.ephemeris, self.start, t_s, self.trajectory.motion(t_s))
        return _kept_range_m(self, t_s.tobytes()).copy()

    def rate_mps(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the range rate in m/s."""
        sight = self.sight(t_s)
        return sight.rate_mps - sight.satellite_clock_mps

    def acceleration_mps2(self, t_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the second derivative of the range in m/s²."""
        return self.sight(t_s).acceleration_mps2


@lru_cache(maxsize=4096)
def _kept_range_m(path: SatelliteRange, times: bytes) -> Float[np.ndarray, " n"]:
    """Return the ranges of a satellite in m from a cache, because the runs of a sky repeat the same times.

    `times` holds the bytes of an array of times in s after the scenario's start.
    """
    t_s = np.frombuffer(times)
    return range_less_clock_m(path.ephemeris, path.start, t_s, path.trajectory.motion(t_s))


@dataclass(frozen=True, slots=True, kw_only=True)
class ElevationEffects:
    """Effects of the elevation on the signals of one satellite of a sky."""

    path: SatelliteRange
    mask_deg: float  # lowest elevation at which the satellite is received
    first_rad: float  # elevation at the first epoch, at which the C/N0 is nominal
    antenna: ElevationCn0 = field(default_factory=ElevationCn0)  # C/N0 as a function of elevation
    ionosphere_common: float = 0.0  # ρ, share of the variance of the ionosphere that all satellites have in common
    atmosphere: AtmosphericDelay | None = None  # troposphere and broadcast ionosphere; None for no atmosphere

    @property
    def line_of_sight(self) -> RangeHistory:
        """Range that the pseudoranges of both bands contain, including the delay of the scenario's troposphere."""
        return self.path if self.atmosphere is None else DelayedRange(delay=self.atmosphere)

    @property
    def nominal_db(self) -> float:
        """Nominal C/N0 relative to the C/N0 at the zenith, in dB."""
        return float(self.antenna.cn0_dbhz(np.array([self.first_rad]))[0]) - self.antenna.zenith_dbhz

    def seen(self, time_s: Float[np.ndarray, " n"], clock_m: Float[np.ndarray, " n"]) -> SatelliteMotion:
        """Return the satellite's motion and signal strength at epochs on the receiver's clock.

        The clock has the error `clock_m` in m.
        """
        clock_offset_s = clock_m / SPEED_OF_LIGHT_MPS
        sight = self.path.sight(time_s - clock_offset_s)
        gain_db = self.antenna.cn0_dbhz(sight.elevation_rad) - self.antenna.zenith_dbhz - self.nominal_db
        geometry = SatelliteGeometry(
            clock_offset_s=clock_offset_s,
            amplitude=10 ** (gain_db / 20),
            azimuth_rad=sight.azimuth_rad,
            elevation_rad=sight.elevation_rad,
            in_view=sight.elevation_rad >= np.radians(self.mask_deg),
        )
        range_m = sight.range_m - sight.satellite_clock_m
        rate_mps, acceleration_mps2 = sight.rate_mps - sight.satellite_clock_mps, sight.acceleration_mps2
        if self.atmosphere is not None:
            slope_mps, bend_mps2 = self.atmosphere.troposphere_rates(time_s - clock_offset_s)
            range_m = range_m + self.atmosphere.troposphere_m(time_s - clock_offset_s)
            rate_mps, acceleration_mps2 = rate_mps + slope_mps, acceleration_mps2 + bend_mps2
        return SatelliteMotion(geometry, range_m, rate_mps, acceleration_mps2)

    def broadcast_ionosphere_e1_m(
        self, time_s: Float[np.ndarray, " n"], clock_m: Float[np.ndarray, " n"]
    ) -> Float[np.ndarray, " n"]:
        """Return the ionospheric delay on E1 that follows from the message, in m, at epochs on the receiver's clock."""
        if self.atmosphere is None:
            return np.zeros_like(time_s)
        return self.atmosphere.ionosphere_e1_m(time_s - clock_m / SPEED_OF_LIGHT_MPS)
