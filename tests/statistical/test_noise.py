"""The counter-based noise against the standard normal law.

Fixed seeds, two-sided. About 50 decisions; each has an error of at most 6e-7 (5 standard deviations) or 1e-6
(Kolmogorov and Smirnov), so that a good generator with other seeds would fail once in 30,000 runs.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from vestige.signal_generator.noise_kernel import noise_key, normal_pairs

N = 2_000_000
SIGMAS = 5.0


@pytest.fixture(scope="module")
def pairs() -> np.ndarray:
    return normal_pairs(noise_key(2025, 3, 1), 0, N).astype(np.float64)


def ks_statistic(cdf: np.ndarray) -> float:
    """√n · sup |F_n − F| of values already mapped through their distribution function."""
    cdf = np.sort(cdf)
    steps = np.arange(cdf.size + 1) / cdf.size
    return float(np.sqrt(cdf.size) * max(np.max(steps[1:] - cdf), np.max(cdf - steps[:-1])))


KS_LIMIT = float(special.kolmogi(1e-6))


@pytest.mark.parametrize("part", [0, 1])
def test_moments(pairs: np.ndarray, part: int) -> None:
    x = pairs[:, part]
    assert abs(np.mean(x)) < SIGMAS / np.sqrt(N)
    assert abs(np.mean(x**2) - 1) < SIGMAS * np.sqrt(2 / N)
    assert abs(np.mean(x**3)) < SIGMAS * np.sqrt(15 / N)
    assert abs(np.mean(x**4) - 3) < SIGMAS * np.sqrt(96 / N)


@pytest.mark.judged(by="theory", what="noise generator", figure="2,000,000 numbers, Kolmogorov-Smirnov test at 1e-6")
@pytest.mark.parametrize("part", [0, 1])
def test_distribution(pairs: np.ndarray, part: int) -> None:
    x = pairs[:, part]
    assert ks_statistic(special.ndtr(x)) < KS_LIMIT


def test_angle_is_uniform_and_radius_is_rayleigh(pairs: np.ndarray) -> None:
    angle = np.arctan2(pairs[:, 1], pairs[:, 0])
    assert ks_statistic(angle / (2 * np.pi) + 0.5) < KS_LIMIT
    square = np.sum(pairs**2, axis=1)
    assert ks_statistic(-np.expm1(-square / 2)) < KS_LIMIT
    octants = np.bincount(((angle + np.pi) / (np.pi / 4)).astype(int).clip(0, 7), minlength=8)
    assert np.max(np.abs(octants - N / 8)) < SIGMAS * np.sqrt(N * 7 / 64)


@pytest.mark.parametrize("limit", [3.0, 4.0, 4.75])
def test_tails(pairs: np.ndarray, limit: float) -> None:
    """Counts on each side of each part; beyond 4.75 about 2 are expected, so at most 18 (Poisson, 1e-10)."""
    p = float(special.ndtr(-limit))
    for tail in (pairs[:, 0] > limit, pairs[:, 0] < -limit, pairs[:, 1] > limit, pairs[:, 1] < -limit):
        count = int(np.count_nonzero(tail))
        below, above = special.bdtr(count, N, p), special.bdtrc(count - 1, N, p)
        assert min(below, above) > 3e-7


def test_nothing_is_correlated(pairs: np.ndarray) -> None:
    """Parts of a pair, neighbours, neighbouring epochs, bands and seeds; numbers and their squares."""
    re, im = pairs.T
    others = [normal_pairs(noise_key(*key), 0, N)[:, 0] for key in ((2025, 4, 1), (2025, 3, 2), (2026, 3, 1))]
    couples = [(re, im), *((re[lag:], re[:-lag]) for lag in (1, 2, 3, 1024)), (re[1:], im[:-1])]
    couples += [(re, other) for other in others]
    for a, b in couples:
        assert abs(np.mean(a * b)) < SIGMAS / np.sqrt(a.size)
        assert abs(np.mean((a**2 - 1) * (b**2 - 1))) < SIGMAS * 2 / np.sqrt(a.size)
