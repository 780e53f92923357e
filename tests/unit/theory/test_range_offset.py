from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vestige.acas_processor.detectors import DETECTORS, EarlyDetector, MaximumDetector
from vestige.theory.range_offset import range_offset_m

CHIP_M = 299_792_458 / 5.115e6
BANK_M = 15.0 * (np.arange(11) - 5)


def triangle(offsets_m: np.ndarray, peak_m: np.ndarray) -> np.ndarray:
    return np.clip(1 - np.abs(offsets_m - peak_m[:, None]) / CHIP_M, 0, None)


@given(st.floats(0.05, 2 / 3), st.floats(-0.5, 0.5), st.integers(1, 3), st.floats(0.01, 100))
def test_exact_on_a_triangle(spacing_chips: float, fraction: float, n: int, height: float) -> None:
    step_m = spacing_chips * CHIP_M / n
    offsets_m = step_m * (np.arange(2 * n + 5) - n - 2)
    true_m = fraction * spacing_chips * CHIP_M
    magnitudes = height * triangle(offsets_m, np.array([true_m]))
    found = range_offset_m(magnitudes, np.array([n + 2]), n, offsets_m)
    assert found[0] == pytest.approx(true_m, abs=1e-9 * CHIP_M / spacing_chips)


@pytest.mark.parametrize("detector", DETECTORS.values())
@given(true_m=st.floats(-60, 60))
def test_exact_behind_a_detector(detector: type[MaximumDetector] | type[EarlyDetector], true_m: float) -> None:
    magnitudes = triangle(BANK_M, np.array([true_m]))
    tap = detector().detect(magnitudes, 0.1)
    if tap[0] < 0:  # two equal taps: no peak for the early detector
        assert detector is EarlyDetector
        assert abs(abs(true_m) % 15 - 7.5) < 1e-9
        return
    assert range_offset_m(magnitudes, tap, 1, BANK_M)[0] == pytest.approx(true_m, abs=1e-9)


@pytest.mark.parametrize(
    ("spacing_m", "true_m"),
    [
        (15.0, 3.0),
        (15.0, -4.0),
        (15.0, 7.5),
        *((0.256 * CHIP_M, x * CHIP_M) for x in (0.05, 0.1, -0.08)),
        *((0.512 * CHIP_M, x * CHIP_M) for x in (0.05, 0.1, -0.08)),
    ],
)
def test_table_of_the_corrected_formula(spacing_m: float, true_m: float) -> None:
    offsets_m = spacing_m * np.array([-1.0, 0.0, 1.0])
    magnitudes = triangle(offsets_m, np.array([true_m]))
    early, punctual, late = magnitudes[0]
    printed = (max(early, late) - min(early, late)) / (punctual - min(early, late)) * spacing_m
    found = range_offset_m(magnitudes, np.array([1]), 1, offsets_m)[0]
    assert found == pytest.approx(true_m)
    assert printed == pytest.approx(2 * abs(true_m))  # what the paper's formula gives


three_taps = arrays(np.float64, (5, 3), elements=st.floats(0, 10))


@given(three_taps)
def test_mirrored_taps_give_the_opposite_offset(magnitudes: np.ndarray) -> None:
    tap, offsets_m = np.ones(5, dtype=int), np.array([-15.0, 0.0, 15.0])
    found = range_offset_m(magnitudes, tap, 1, offsets_m)
    np.testing.assert_array_equal(range_offset_m(magnitudes[:, ::-1], tap, 1, offsets_m), -found)


@given(three_taps)
def test_never_more_than_half_the_spacing(magnitudes: np.ndarray) -> None:
    found = range_offset_m(magnitudes, np.ones(5, dtype=int), 1, np.array([-15.0, 0.0, 15.0]))
    assert np.all(np.abs(found) <= 7.5)
    outer_is_highest = magnitudes[:, [0, 2]].max(axis=1) > magnitudes[:, 1]
    unequal = magnitudes[:, 0] != magnitudes[:, 2]
    np.testing.assert_array_equal(np.abs(found[outer_is_highest & unequal]), 7.5)


@pytest.mark.parametrize(
    ("taps", "expected"),
    [
        ([1, 1, 1], 0.0),  # no information
        ([2, 1, 2], 0.0),  # a valley is symmetric too
        ([1, 2, 2], 7.5),  # c_p ≈ c_l: saturates, the origin of the cluster at −30 m + 7.5 m
        ([1, 1, 2], 7.5),  # c_p = c_min, but the late tap is higher
        ([2, 1, 1], -7.5),
    ],
)
def test_degenerate_taps(taps: list[float], expected: float) -> None:
    found = range_offset_m(np.array([taps], dtype=float), np.array([1]), 1, np.array([-15.0, 0.0, 15.0]))
    assert found[0] == expected


def test_not_detected_is_no_number() -> None:
    magnitudes = triangle(BANK_M, np.array([3.0, 3.0, -33.0]))
    found = range_offset_m(magnitudes, np.array([5, -1, 3]), 1, BANK_M)
    np.testing.assert_allclose(found, [3.0, np.nan, -33.0])


def test_no_number_in_no_number_out() -> None:
    found = range_offset_m(np.array([[np.nan, 2.0, 1.0]]), np.array([1]), 1, np.array([-15.0, 0.0, 15.0]))
    assert np.isnan(found[0])


def test_refuses() -> None:
    magnitudes = np.ones((1, 5))
    even = np.arange(5.0)
    with pytest.raises(ValueError, match="equal steps"):
        range_offset_m(magnitudes, np.array([2]), 1, np.array([0.0, 1, 2, 4, 5]))
    with pytest.raises(ValueError, match="equal steps"):
        range_offset_m(magnitudes, np.array([2]), 1, -even)
    with pytest.raises(ValueError, match="neighbours"):
        range_offset_m(magnitudes, np.array([0]), 1, even)
    with pytest.raises(ValueError, match="neighbours"):
        range_offset_m(magnitudes, np.array([-1]), 3, even)
