"""Misses averaged over fading by rays."""

from __future__ import annotations

import numpy as np
import pytest

from vestige.theory.fading import faded_miss_probability
from vestige.theory.thresholds import miss_probability, threshold


def test_without_rays_it_is_the_steady_signal() -> None:
    cn0_dbhz = np.array([28.0, 33.0, 38.0])
    steady = miss_probability(cn0_dbhz, 16e-3, 1e-7)
    assert faded_miss_probability(cn0_dbhz, 16e-3, 1e-7, -np.inf) == pytest.approx(steady, rel=1e-12)


def test_it_is_the_average_over_the_fading() -> None:
    """Drawn: 400,000 rays and noises. Four standard deviations of a count: P < 1e-4."""
    rng, n, power = np.random.default_rng(3), 400_000, 10**-1.58
    amplitude = np.sqrt(2 * 10**3.3 * 16e-3)
    ray, noise = ((rng.standard_normal((2, n)) * scale) for scale in (np.sqrt(power / 2), 1.0))
    missed = np.hypot(amplitude * (1 + ray[0]) + noise[0], amplitude * ray[1] + noise[1]) < threshold(1e-7)
    expected = n * faded_miss_probability(33.0, 16e-3, 1e-7, -15.8)
    assert abs(np.count_nonzero(missed) - expected) < 4 * np.sqrt(expected)
