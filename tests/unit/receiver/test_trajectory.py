from __future__ import annotations

import numpy as np
import pytest

from vestige.navigation.earth import geodetic_from_ecef, local_axes_at
from vestige.receiver.sky import trajectory as module
from vestige.receiver.sky.trajectory import (
    CircularTrajectory,
    StaticTrajectory,
    Trajectory,
    WaypointTrajectory,
)

WAYPOINTS = np.array(
    [[0.0, 48.0, 11.0, 500.0], [60.0, 48.01, 11.0, 520.0], [90.0, 48.01, 11.02, 480.0], [200.0, 48.0, 11.03, 500.0]]
)
EXAMPLES: list[Trajectory] = [
    StaticTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=500.0),
    CircularTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=500.0, radius_m=100.0, speed_mps=20.0),
    WaypointTrajectory.from_geodetic(WAYPOINTS),
]


def test_every_kind_has_an_example() -> None:
    kinds = {one for one in vars(module).values() if isinstance(one, type) and hasattr(one, "motion")} - {Trajectory}
    assert {type(example) for example in EXAMPLES} == kinds


@pytest.mark.parametrize("trajectory", EXAMPLES, ids=lambda example: type(example).__name__)
@pytest.mark.parametrize("at", [1.0, 59.95, 60.0, 130.0])
def test_velocity_and_acceleration_are_derivatives(trajectory: Trajectory, at: float) -> None:
    motion = trajectory.motion(at + np.array([-0.1, 0.0, 0.1]))
    np.testing.assert_allclose(np.diff(motion.position_m[::2], axis=0)[0] / 0.2, motion.velocity_mps[1], atol=2e-3)
    np.testing.assert_allclose(
        np.diff(motion.velocity_mps[::2], axis=0)[0] / 0.2, motion.acceleration_mps2[1], atol=2e-2
    )


def test_a_circle_is_one() -> None:
    circle = EXAMPLES[1]
    period = 2 * np.pi * 100.0 / 20.0
    motion = circle.motion(np.array([0.0, period / 4, period]))
    axes = local_axes_at(
        StaticTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=500.0).motion(np.zeros(1)).position_m
    )
    centre = EXAMPLES[0].motion(np.zeros(1)).position_m[0]
    np.testing.assert_allclose(
        (motion.position_m - centre) @ axes[0].T, [[100, 0, 0], [0, 100, 0], [100, 0, 0]], atol=1e-6
    )
    np.testing.assert_allclose(np.linalg.norm(motion.velocity_mps, axis=1), 20.0)
    np.testing.assert_allclose(np.linalg.norm(motion.acceleration_mps2, axis=1), 4.0)


def test_waypoints_are_passed_in_time() -> None:
    motion = EXAMPLES[2].motion(WAYPOINTS[:, 0])
    latitude, longitude, height = geodetic_from_ecef(motion.position_m)
    np.testing.assert_allclose(np.degrees(latitude), WAYPOINTS[:, 1], atol=1e-11)
    np.testing.assert_allclose(np.degrees(longitude), WAYPOINTS[:, 2], atol=1e-11)
    np.testing.assert_allclose(height, WAYPOINTS[:, 3], atol=1e-6)
    np.testing.assert_allclose(motion.acceleration_mps2[[0, -1]], 0.0)


def test_two_waypoints_are_uniform_motion() -> None:
    motion = WaypointTrajectory.from_geodetic(WAYPOINTS[:2]).motion(np.linspace(0, 60, 5))
    np.testing.assert_allclose(np.diff(motion.velocity_mps, axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(motion.acceleration_mps2, 0.0)


def test_no_motion_beyond_the_waypoints() -> None:
    with pytest.raises(ValueError, match="expected 0 s to 200 s"):
        EXAMPLES[2].motion(np.array([201.0]))
    with pytest.raises(ValueError, match="ascending"):
        WaypointTrajectory(time_s=np.array([0.0, 0.0]), position_m=np.zeros((2, 3)))
    with pytest.raises(ValueError, match="radius"):
        CircularTrajectory(latitude_deg=0.0, longitude_deg=0.0, radius_m=0.0, speed_mps=1.0)
