"""Accelerometers: true gain of velocity on a circle, errors of the stated size, the same for any cut."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import chdtri

from vestige.receiver.errors.accelerometer import Accelerometers
from vestige.receiver.sky.trajectory import CircularTrajectory, StaticTrajectory

PERFECT = Accelerometers(sigma_bias_mps2=0.0, walk_mps_per_sqrt_s=0.0)
STATIC = StaticTrajectory(latitude_deg=45.0, longitude_deg=8.0)


def test_half_a_circle_turns_the_velocity_round() -> None:
    """From the east of its centre a receiver goes north; at 20 m/s on 500 m half a round takes 78.5 s."""
    circle = CircularTrajectory(latitude_deg=45.0, longitude_deg=8.0, radius_m=500.0, speed_mps=20.0)
    step_s = np.pi * 500.0 / 20.0 / 100
    time_s = step_s * np.arange(101)
    gained = PERFECT.delta_velocity_mps(circle, time_s, step_s, seed=1, first=0)
    assert np.isnan(gained[0]).all()
    assert gained[1:].sum(axis=0) == pytest.approx([0.0, -40.0, 0.0], abs=0.02)
    quarter = gained[1:51].sum(axis=0)
    assert quarter == pytest.approx([-20.0, -20.0, 0.0], abs=0.02)


def test_errors_are_of_the_stated_size() -> None:
    sensor = Accelerometers(sigma_bias_mps2=0.0, walk_mps_per_sqrt_s=0.3)
    time_s = 4.0 * np.arange(1001)
    noise = sensor.delta_velocity_mps(STATIC, time_s, 4.0, seed=2, first=0)[1:] / (0.3 * 2.0)
    for total in np.sum(noise**2, axis=0):
        assert chdtri(1000, 1 - 5e-6) < total < chdtri(1000, 5e-6)
    biased = Accelerometers(sigma_bias_mps2=0.01, walk_mps_per_sqrt_s=0.0)
    found = np.array([biased.delta_velocity_mps(STATIC, time_s[:3], 4.0, seed=seed, first=0) for seed in range(300)])
    assert np.array_equal(found[:, 1], found[:, 2])
    total = float(np.sum((found[:, 1] / 0.04) ** 2))
    assert chdtri(900, 1 - 5e-6) < total < chdtri(900, 5e-6)


def test_any_cut_gives_the_same_bits() -> None:
    time_s = np.arange(1200.0)
    whole = Accelerometers().delta_velocity_mps(STATIC, time_s, 1.0, seed=5, first=0)
    piece = Accelerometers().delta_velocity_mps(STATIC, time_s[470:1010], 1.0, seed=5, first=470)
    assert whole[470:1010].tobytes() == piece.tobytes()


def test_impossible_errors_are_refused() -> None:
    with pytest.raises(ValueError, match="sigma_bias_mps2"):
        Accelerometers(sigma_bias_mps2=-1.0)
