from __future__ import annotations

import math

import numpy as np
import pytest

from vestige.acas_processor.monitors.inertial import InertialMonitor, integrated_acceleration_mps
from vestige.campaign.statistics import binomial_test
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import local_axes_at
from vestige.navigation.line_of_sight import line_of_sight
from vestige.receiver.constellation import walker_ephemerides
from vestige.receiver.trajectory import CircularTrajectory, StaticTrajectory
from vestige.records import Outcome
from vestige.streams import stream
from vestige.time import GalileoTime

N = 100_000
LEVEL = 1e-4


@pytest.mark.parametrize("pull_mps", [0.0, 1.5])
def test_rate_of_alarms(pull_mps: float) -> None:
    monitor, interval = InertialMonitor(p_fa=0.01, sigma_rate_mps=0.3, walk_mps_per_sqrt_s=0.05), 30.0
    rng = stream(8, "inertial", str(pull_mps))
    z = rng.standard_normal((5, N))
    clock = SPEED_OF_LIGHT_MPS * math.sqrt(monitor.clock_walk_hz * interval) * z[0]
    noise = monitor.sigma_rate_mps * (z[1] - z[2])
    sensed = monitor.sigma_bias_mps2 * interval * z[3] + monitor.walk_mps_per_sqrt_s * math.sqrt(interval) * z[4]
    statistic = monitor.statistic(20.0 - 3.0 + clock + noise + pull_mps, np.full(N, 20.0), 3.0 + sensed)
    alarms = int(np.count_nonzero(np.abs(statistic) > monitor.threshold_mps(np.array([interval]))[0]))
    expected = float(monitor.probability_of_detection(np.array([pull_mps]), interval)[0])
    assert binomial_test(alarms, N, expected) > LEVEL
    assert (expected == pytest.approx(0.01)) is (pull_mps == 0.0)


def test_integral() -> None:
    """A linear acceleration integrates exactly, also from between its samples."""
    time_s = np.arange(0.0, 11.0)
    acceleration = np.stack((time_s, -2 * time_s, np.ones(11)), axis=1)
    gained = integrated_acceleration_mps(time_s, acceleration, 2.5, 7.25)
    assert gained is not None
    half = (7.25**2 - 2.5**2) / 2
    np.testing.assert_allclose(gained, [half, -2 * half, 4.75])
    assert integrated_acceleration_mps(time_s, acceleration, -0.1, 5.0) is None
    assert integrated_acceleration_mps(time_s, acceleration, 5.0, 10.1) is None
    assert integrated_acceleration_mps(time_s[:1], acceleration[:1], 0.0, 0.0) is None
    still = integrated_acceleration_mps(time_s, acceleration, 3.0, 3.0)
    assert still is not None
    np.testing.assert_array_equal(still, 0.0)


def test_a_circling_receiver_explains_its_own_range_rate() -> None:
    """True motion on a circle: range rates and accelerations of the same trajectory cancel; a standing one predicts."""
    start = GalileoTime(1372, 604_790)
    circle = CircularTrajectory(latitude_deg=45.0, longitude_deg=8.0, radius_m=500.0, speed_mps=20.0)
    times = np.linspace(0.0, 30.0, 3001)
    motion = circle.motion(times)
    sight = line_of_sight(walker_ephemerides(start)[3], start, times, motion)
    standing = StaticTrajectory(latitude_deg=45.0, longitude_deg=8.0).motion(times)
    predicted = line_of_sight(walker_ephemerides(start)[3], start, times, standing)
    axes = local_axes_at(standing.position_m[:1])[0]
    gained = integrated_acceleration_mps(times, motion.acceleration_mps2 @ axes.T, 0.0, 30.0)
    azimuth, elevation = sight.azimuth_rad[1500], sight.elevation_rad[1500]
    flat = np.cos(elevation)
    towards = np.array([flat * np.sin(azimuth), flat * np.cos(azimuth), np.sin(elevation)])
    change = sight.rate_mps[-1] - sight.rate_mps[0]
    expected = predicted.rate_mps[-1] - predicted.rate_mps[0]
    assert abs(change - expected) > 5.0
    check = InertialMonitor().check(change, expected, gained, towards, 30.0)
    assert check.outcome is Outcome.PASS
    assert abs(check.statistic) < 0.1
    turned = InertialMonitor().check(change, expected, -gained if gained is not None else None, towards, 30.0)
    assert turned.outcome is Outcome.FAIL
    assert "more than the motion explains" in turned.reason


def test_checks_that_cannot_run() -> None:
    monitor, up = InertialMonitor(), np.array([0.0, 0.0, 1.0])
    assert monitor.check(0.0, 0.0, None, up, 30.0).reason.startswith("no accelerations")
    assert monitor.check(math.nan, 0.0, np.zeros(3), up, 30.0).reason == "no range rate at both ends"
