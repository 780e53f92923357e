from __future__ import annotations

import numpy as np
import pytest

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import ROTATION_RADPS, ecef_from_geodetic
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.line_of_sight import line_of_sight
from vestige.navigation.orbit import satellite_state
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.receiver.sky.trajectory import CircularTrajectory, StaticTrajectory
from vestige.time import GalileoTime

START = GalileoTime(1373, 0)
SATELLITES = walker_ephemerides(GalileoTime(1372, 604_200))
CIRCLE = CircularTrajectory(latitude_deg=41.3, longitude_deg=2.1, radius_m=200.0, speed_mps=40.0)


@pytest.mark.parametrize("satellite", SATELLITES[::5])
def test_rate_and_acceleration_are_derivatives_of_the_range(satellite: Ephemeris) -> None:
    times = 100.0 + np.array([-0.05, 0.0, 0.05])
    sight = line_of_sight(satellite, START, times, CIRCLE.motion(times))
    assert np.diff(sight.range_m[::2])[0] / 0.1 == pytest.approx(sight.rate_mps[1], abs=1e-3)
    assert np.diff(sight.rate_mps[::2])[0] / 0.1 == pytest.approx(sight.acceleration_mps2[1], abs=2e-3)
    assert np.diff(sight.satellite_clock_m[::2])[0] / 0.1 == pytest.approx(sight.satellite_clock_mps[1], abs=1e-6)


@pytest.mark.parametrize("satellite", SATELLITES[::5])
def test_light_goes_straight_in_space(satellite: Ephemeris) -> None:
    """Range = c · flight time, between the points in space, whatever way the Earth turns."""
    times = np.array([0.0])
    motion = StaticTrajectory(latitude_deg=-33.0, longitude_deg=151.0).motion(times)
    sight = line_of_sight(satellite, START, times, motion)
    flight = sight.range_m / SPEED_OF_LIGHT_MPS
    sent = satellite_state(satellite, START, -flight).position_m[0]
    angle = -ROTATION_RADPS * flight[0]  # back to how the Earth stood at transmission
    c, s = np.cos(angle), np.sin(angle)
    received = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ motion.position_m[0]
    assert np.linalg.norm(received - sent) == pytest.approx(sight.range_m[0], abs=1e-7)
    sagnac = ROTATION_RADPS / SPEED_OF_LIGHT_MPS * (sent[0] * received[1] - sent[1] * received[0])
    assert np.linalg.norm(motion.position_m[0] - sent) + sagnac == pytest.approx(sight.range_m[0], abs=1e-3)


def test_a_satellite_overhead() -> None:
    """A receiver put below the satellite sees it at the zenith and at its height; there the range hardly changes."""
    at = satellite_state(SATELLITES[0], START, np.array([-0.078])).position_m
    longitude, reach = np.arctan2(at[0, 1], at[0, 0]), np.linalg.norm(at)
    latitude = np.arcsin(at[0, 2] / reach)
    place = ecef_from_geodetic(np.array([latitude]), np.array([longitude]), np.zeros(1))
    motion = StaticTrajectory(latitude_deg=float(np.degrees(latitude)), longitude_deg=float(np.degrees(longitude)))
    sight = line_of_sight(SATELLITES[0], START, np.zeros(1), motion.motion(np.zeros(1)))
    assert np.degrees(sight.elevation_rad[0]) > 89.0  # geodetic and geocentric vertical differ by up to 0.2°, times 1.3
    assert sight.range_m[0] == pytest.approx(reach - np.linalg.norm(place), rel=1e-4)
    assert abs(sight.rate_mps[0]) < 30
