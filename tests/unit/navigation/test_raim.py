"""RAIM in the eight-satellite geometry whose numbers were computed beforehand, and its laws."""

from __future__ import annotations

import numpy as np
import pytest

from exact_sky import geometry_of_sky
from vestige.navigation.position_fix import dilution
from vestige.navigation.raim import (
    NOT_EXCLUDED,
    Redundancy,
    chi_square_statistic,
    chi_square_threshold,
    exclude_one,
    missed_detection,
    redundancy,
    separation_factor,
    solution_separation,
)
from vestige.streams import stream

SKY_DEG = np.array([(0, 80), (45, 30), (100, 55), (150, 20), (200, 60), (255, 25), (300, 45), (340, 15)], dtype=float)
GEOMETRY = geometry_of_sky(*np.radians(SKY_DEG.T)[:, None])
SIGMA_M = 5.0
WEIGHT = np.full((1, 8), SIGMA_M**-2)
PARTS = redundancy(GEOMETRY, WEIGHT)


def _residuals(y: np.ndarray, geometry: np.ndarray = GEOMETRY, weight: np.ndarray = WEIGHT) -> np.ndarray:
    parts = redundancy(np.broadcast_to(geometry, (len(y), *geometry.shape[1:])), np.broadcast_to(weight, y.shape))
    return y - np.einsum("nmi,nik,nk->nm", np.broadcast_to(geometry, (len(y), 8, 4)), parts.gain, y)


def _repeated(n: int) -> tuple[Redundancy, np.ndarray]:
    weight = np.repeat(WEIGHT, n, axis=0)
    return redundancy(np.repeat(GEOMETRY, n, axis=0), weight), weight


def test_dilutions() -> None:
    dop = dilution(GEOMETRY)
    values = [dop.geometric, dop.position, dop.horizontal, dop.vertical, dop.time]
    np.testing.assert_allclose(np.ravel(values), [1.9732, 1.7266, 0.9614, 1.4343, 0.9551], atol=5e-5)


def test_redundancy() -> None:
    expected = [0.5719, 0.4743, 0.6416, 0.2158, 0.6358, 0.4229, 0.6645, 0.3731]
    np.testing.assert_allclose(PARTS.unexplained[0], expected, atol=5.1e-5)
    assert PARTS.unexplained.sum() == pytest.approx(4)


@pytest.mark.parametrize(("p_fa", "threshold"), [(1e-3, 18.467), (1e-5, 28.473), (1e-7, 38.240)])
def test_chi_square_threshold(p_fa: float, threshold: float) -> None:
    assert chi_square_threshold(np.array([4]), p_fa)[0] == pytest.approx(threshold, abs=5e-4)


@pytest.mark.parametrize(
    ("satellite", "bias_m", "noncentrality", "p_md"),
    [(3, 40.0, 13.813, 0.5801), (3, 60.0, 31.079, 0.0564), (7, 60.0, 53.72, 4.87e-4)],
)
def test_missed_detection(satellite: int, bias_m: float, noncentrality: float, p_md: float) -> None:
    at = slice(satellite, satellite + 1)
    value = bias_m**2 * WEIGHT[0, at] * PARTS.unexplained[0, at]  # λ = b² w Pᵢᵢ
    assert value[0] == pytest.approx(noncentrality, rel=1e-4)
    assert missed_detection(value, 4, 1e-3)[0] == pytest.approx(p_md, rel=1e-3)


def test_missed_detection_without_a_fault() -> None:
    assert missed_detection(np.zeros(1), 4, 1e-3)[0] == pytest.approx(1 - 1e-3)
    assert missed_detection(np.array([1e-9]), 4, 1e-3)[0] == pytest.approx(1 - 1e-3)


def test_solution_separation_thresholds() -> None:
    """LPV-200: 3.9e-6 for the vertical, 9e-8 for the two horizontal axes, over eight modes."""
    sigma = solution_separation(PARTS, np.zeros((1, 8)), WEIGHT).sigma_m[0]
    np.testing.assert_allclose(sigma[2], [5.152, 1.484, 2.218, 7.743, 2.870, 2.812, 1.728, 4.785], atol=5.1e-4)
    up, flat = separation_factor(3.9e-6, 8), separation_factor(4.5e-8, 8)
    assert (up, flat) == (pytest.approx(5.0312, abs=5e-5), pytest.approx(5.8275, abs=5e-5))
    np.testing.assert_allclose(up * sigma[2], [25.92, 7.47, 11.16, 38.95, 14.44, 14.15, 8.69, 24.07], atol=6e-3)
    np.testing.assert_allclose(flat * sigma[0], [0.12, 14.58, 9.49, 13.64, 3.90, 17.48, 9.27, 3.02], atol=6e-3)
    np.testing.assert_allclose(flat * sigma[1], [4.21, 11.50, 0.35, 25.53, 7.64, 8.98, 4.32, 15.47], atol=6e-3)


def test_the_rank_one_update_is_the_fix_without_the_satellite() -> None:
    y = stream(1, "test", "raim").standard_normal((1, 8)) * SIGMA_M
    weight = WEIGHT * np.linspace(0.5, 2.0, 8)
    parts = redundancy(GEOMETRY, weight)
    whole = parts.gain[0] @ y[0]
    residual = y - (GEOMETRY[0] @ whole)[None]
    separation = solution_separation(parts, residual, weight)
    for k in range(8):
        without = weight.copy()
        without[0, k] = 0
        gain = redundancy(GEOMETRY, without).gain[0]
        np.testing.assert_allclose(separation.difference_m[0, :, k], gain @ y[0] - whole, atol=1e-9)
        change = gain - parts.gain[0]
        sigma = np.sqrt(np.einsum("ij,j,ij->i", change, 1 / weight[0], change))
        np.testing.assert_allclose(separation.sigma_m[0, :, k], sigma, rtol=1e-9)


def test_every_axis_of_the_separation_says_the_same() -> None:
    """|Δx_q|/σ_ss,q = |r_i|/(σ√P_ii) for every q."""
    residual = _residuals(stream(2, "test", "raim").standard_normal((1, 8)) * SIGMA_M)
    separation = solution_separation(PARTS, residual, WEIGHT)
    expected = np.abs(residual) / (SIGMA_M * np.sqrt(PARTS.unexplained))
    for q in range(4):
        np.testing.assert_allclose(np.abs(separation.difference_m[:, q]) / separation.sigma_m[:, q], expected)


def test_a_common_bias_is_invisible() -> None:
    """A time push of all satellites, or any push that a position explains, leaves T as it was."""
    y = stream(3, "test", "raim").standard_normal((1, 8)) * SIGMA_M
    before = chi_square_statistic(_residuals(y), WEIGHT)
    np.testing.assert_allclose(chi_square_statistic(_residuals(y + 1234.5), WEIGHT), before, rtol=1e-9)
    pushed = y + (GEOMETRY[0] @ np.array([100.0, -50.0, 300.0, 10.0]))[None]
    np.testing.assert_allclose(chi_square_statistic(_residuals(pushed), WEIGHT), before, rtol=1e-9)


def test_false_alarms_and_misses_by_simulation() -> None:
    """100,000 fixes: binomial deviations below 4σ."""
    n, p_fa = 100_000, 1e-3
    y = stream(4, "test", "raim").standard_normal((n, 8)) * SIGMA_M
    threshold = chi_square_threshold(np.array([4]), p_fa)[0]
    for bias, probability in ((0.0, p_fa), (60.0, 1 - 0.05643)):
        y[:, 3] += bias
        alarms = np.mean(np.sum(_residuals(y) ** 2, axis=1) / SIGMA_M**2 > threshold)
        assert abs(alarms - probability) < 4 * np.sqrt(probability * (1 - probability) / n)


def test_exclusion_finds_the_fault() -> None:
    y = stream(5, "test", "raim").standard_normal((2000, 8)) * SIGMA_M
    parts, weight = _repeated(2000)
    nominal = exclude_one(parts, _residuals(y), weight, 1e-3)
    quiet = chi_square_statistic(_residuals(y), weight) <= chi_square_threshold(np.array([4]), 1e-3)
    assert np.all(nominal[quiet] == NOT_EXCLUDED)
    y[:, 4] += 100.0
    found = exclude_one(parts, _residuals(y), weight, 1e-3)
    assert np.mean(found == 4) > 0.99
    reduced = _residuals(y, weight=np.where(np.arange(8) == 4, 0.0, WEIGHT))
    statistic = np.sum(np.delete(reduced, 4, axis=1) ** 2, axis=1) / SIGMA_M**2
    assert np.array_equal(found == 4, statistic <= chi_square_threshold(np.array([3]), 1e-3))


def test_exclusion_weighs_satellites_of_unequal_sigma() -> None:
    """What is left is the fix without the satellite, and the one that is named leaves least, of all eight."""
    sigma = np.array([1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 1.5, 20.0])
    weight = np.repeat(sigma[None] ** -2, 500, axis=0)
    geometry = np.repeat(GEOMETRY, 500, axis=0)
    y = stream(6, "test", "raim").standard_normal((500, 8)) * sigma
    faulty = np.arange(500) % 8
    y[np.arange(500), faulty] += 15 * sigma[faulty]
    found = exclude_one(redundancy(geometry, weight), _residuals(y, weight=weight), weight, 1e-3)
    left = np.stack(
        [
            chi_square_statistic(_residuals(y, weight=without), without)
            for without in (np.where(np.arange(8) == one, 0.0, weight) for one in range(8))
        ],
        axis=1,
    )
    excluded = found != NOT_EXCLUDED
    assert np.mean(excluded) > 0.7  # a satellite of small σ leaves little trace in the residuals
    assert np.array_equal(found[excluded], np.argmin(left, axis=1)[excluded])
    failed = chi_square_statistic(_residuals(y, weight=weight), weight) > chi_square_threshold(np.array([4]), 1e-3)
    assert np.array_equal(excluded, failed & (left.min(axis=1) <= chi_square_threshold(np.array([3]), 1e-3)))


def test_five_satellites_cannot_exclude_and_four_cannot_test() -> None:
    y = np.zeros((1, 8))
    y[0, 1] = 500.0
    for used in (5, 4):
        weight = np.where(np.arange(8) < used, WEIGHT, 0.0)
        parts = redundancy(GEOMETRY, weight)
        assert exclude_one(parts, _residuals(y, weight=weight), weight, 1e-3)[0] == NOT_EXCLUDED
    assert np.isnan(chi_square_threshold(np.array([0]), 1e-3))
