from __future__ import annotations

import math

import numpy as np
import pytest

from vestige.acas_processor.checks.check import two_sided_factor
from vestige.acas_processor.checks.inertial import InertialMonitor
from vestige.acas_processor.position.inertial_bridging import delta_velocity_towards_mps
from vestige.campaign.statistics import binomial_test
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import local_axes_at
from vestige.navigation.line_of_sight import LineOfSight, ReceiverMotion, line_of_sight
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.receiver.sky.trajectory import CircularTrajectory, StaticTrajectory
from vestige.streams import stream
from vestige.time import GalileoTime

N = 100_000
LEVEL = 1e-4


@pytest.mark.parametrize("pull_mps", [0.0, 1.5])
def test_rate_of_alarms(pull_mps: float) -> None:
    monitor, interval = InertialMonitor(p_fa=0.01, walk_mps_per_sqrt_s=0.05), 30.0
    sigma_rate_mps = 0.3
    rng = stream(8, "inertial", str(pull_mps))
    z = rng.standard_normal((5, N))
    clock = SPEED_OF_LIGHT_MPS * math.sqrt(monitor.clock_walk_hz * interval) * z[0]
    noise = sigma_rate_mps * (z[1] - z[2])
    sensed = monitor.sigma_bias_mps2 * interval * z[3] + monitor.walk_mps_per_sqrt_s * math.sqrt(interval) * z[4]
    statistic = monitor.statistic(20.0 - 3.0 + clock + noise + pull_mps, np.full(N, 20.0), 3.0 + sensed)
    of_rates = two_sided_factor(monitor.p_fa) * math.sqrt(2) * sigma_rate_mps
    limit = np.hypot(monitor.threshold_mps(np.array([interval]))[0], of_rates)
    alarms = int(np.count_nonzero(np.abs(statistic) > limit))
    expected = float(monitor.probability_of_detection(np.array([pull_mps]), interval, sigma_rate_mps)[0])
    assert binomial_test(alarms, N, expected) > LEVEL
    assert (expected == pytest.approx(0.01)) is (pull_mps == 0.0)


def test_a_circling_receiver_explains_its_own_range_rate() -> None:
    """True motion on a circle: range rates and accelerations of the same trajectory cancel; a standing one predicts."""
    start = GalileoTime(1372, 604_790)
    circle = CircularTrajectory(latitude_deg=45.0, longitude_deg=8.0, radius_m=500.0, speed_mps=20.0)
    times = np.linspace(0.0, 30.0, 3001)
    motion = circle.motion(times)
    sight = line_of_sight(walker_ephemerides(start)[3], start, times, motion)
    standing = StaticTrajectory(latitude_deg=45.0, longitude_deg=8.0).motion(times)
    predicted = line_of_sight(walker_ephemerides(start)[3], start, times, standing)
    gained = motion.velocity_mps[-1] - motion.velocity_mps[0]
    mean = (motion.position_m[-1] - motion.position_m[0]) / 30.0
    towards = np.stack([_towards(sight, motion, end) for end in (0, -1)])
    own = float(delta_velocity_towards_mps(towards[:1], towards[1:], gained, mean)[0])
    change = sight.rate_mps[-1] - sight.rate_mps[0]
    expected = predicted.rate_mps[-1] - predicted.rate_mps[0]
    assert abs(change - expected) > 5.0
    limit = InertialMonitor().threshold_mps(np.array([30.0]))[0]
    found = InertialMonitor().statistic(np.array([change]), np.array([expected]), np.array([own]))
    assert abs(found[0]) < 0.05
    assert limit > 0.05
    reversed_sign = InertialMonitor().statistic(np.array([change]), np.array([expected]), np.array([-own]))
    assert abs(reversed_sign[0]) > limit


def _towards(sight: LineOfSight, motion: ReceiverMotion, end: int) -> np.ndarray:
    azimuth, elevation = sight.azimuth_rad[end], sight.elevation_rad[end]
    flat = np.cos(elevation)
    local = np.array([flat * np.sin(azimuth), flat * np.cos(azimuth), np.sin(elevation)])
    return local @ local_axes_at(motion.position_m)[end]


def test_the_turn_of_the_line_of_sight_counts() -> None:
    """Δ(e·v) of a receiver at constant velocity is Δe·v, of a line of sight that stays e·Δv; together exactly both."""
    rng = stream(3, "turn")
    e_0, e_1, v_0, v_1 = rng.standard_normal((4, 5, 3))
    exact = np.sum(e_1 * v_1, axis=1) - np.sum(e_0 * v_0, axis=1)
    found = delta_velocity_towards_mps(e_0[:, None], e_1[:, None], v_1 - v_0, (v_0 + v_1) / 2)
    np.testing.assert_allclose(found[:, 0], exact, atol=1e-12)
