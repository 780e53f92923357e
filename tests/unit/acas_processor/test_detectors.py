from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vestige.acas_processor.detectors import DETECTORS, EarlyDetector, MaximumDetector

Detectors = type[MaximumDetector] | type[EarlyDetector]

every_detector = pytest.mark.parametrize("detector", DETECTORS.values())


def early_step_by_step(c: list[float], threshold: float, n: int) -> int:
    """The early detector as the paper lists it, one tap at a time."""

    def constraint(i: int) -> bool:
        return c[i] > c[i + n] and c[i] > c[i - n]

    def asymmetry(i: int) -> float:
        return abs(c[i + n] - c[i - n])

    last = len(c) - 1 - n
    scan_from = n
    while True:
        i = scan_from  # step 2
        while i <= last and not c[i] > threshold:
            i += 1
        while i <= last and c[i + n] > c[i]:  # step 3
            i += 1
        if i > last:
            return -1  # step 5
        if c[i] > threshold and constraint(i):
            break
        scan_from = i + 1
    while i < last and constraint(i + 1) and c[i + 1] > threshold and asymmetry(i + 1) < asymmetry(i):  # step 4
        i += 1
    return i


def maximum_step_by_step(c: list[float], threshold: float, n: int) -> int:
    best = -1
    for i in range(n, len(c) - n):
        if c[i] > threshold and (best < 0 or c[i] > c[best]):
            best = i
    return best


TWINS = {EarlyDetector: early_step_by_step, MaximumDetector: maximum_step_by_step}


@st.composite
def blocks(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, int]:
    """A block of epochs, a threshold for each, a spacing; few different values, so that ties are frequent."""
    n = draw(st.integers(1, 3))
    shape = (draw(st.integers(0, 20)), draw(st.integers(2 * n + 1, 14)))
    levels = st.integers(0, 6).map(float) if draw(st.booleans()) else st.floats(0, 20)
    magnitudes = draw(arrays(np.float64, shape, elements=levels))
    return magnitudes, draw(arrays(np.float64, shape[0], elements=levels)), n


@every_detector
@given(blocks())
def test_block_equals_the_steps_of_the_paper(detector: Detectors, block: tuple[np.ndarray, np.ndarray, int]) -> None:
    magnitudes, threshold, n = block
    expected = [TWINS[detector](list(c), g, n) for c, g in zip(magnitudes, threshold, strict=True)]
    np.testing.assert_array_equal(detector(spacing=n).detect(magnitudes, threshold), expected)


@every_detector
@given(blocks())
def test_detected_tap_is_above_threshold_and_has_neighbours(
    detector: Detectors, block: tuple[np.ndarray, np.ndarray, int]
) -> None:
    magnitudes, threshold, n = block
    tap = detector(spacing=n).detect(magnitudes, threshold)
    epoch = np.flatnonzero(tap >= 0)
    assert np.all(magnitudes[epoch, tap[epoch]] > threshold[epoch])
    assert np.all((tap[epoch] >= n) & (tap[epoch] < magnitudes.shape[1] - n))


@every_detector
@given(blocks(), st.integers(-8, 8))
def test_only_ratios_count(detector: Detectors, block: tuple[np.ndarray, np.ndarray, int], power: int) -> None:
    magnitudes, threshold, n = block
    scale = 2.0**power
    found = detector(spacing=n).detect(magnitudes * scale, threshold * scale)
    if np.all((magnitudes == 0) | (magnitudes > 1e-300)):  # scaling is exact there
        np.testing.assert_array_equal(found, detector(spacing=n).detect(magnitudes, threshold))


def two_peaks() -> np.ndarray:
    """The early detector's figure: taps a quarter chip apart, true peak just before c_6, a stronger one later."""
    tap = np.arange(18)
    true = np.clip(1 - np.abs(tap - 5.9) / 4, 0, None)
    spoofed = np.clip(1 - np.abs(tap - 13.0) / 4, 0, None)
    return (true + 1.5 * spoofed)[None, :]


def test_two_peak_figure() -> None:
    c = two_peaks()
    threshold = 0.5
    first, second = 4, 5  # the pictures: c_4 is above the threshold but c_6 is higher; c_5 is a peak, c_6 a better one
    assert c[0, first - 1] < threshold < c[0, first] < c[0, first + 2]
    assert c[0, second] > max(c[0, second - 2], c[0, second + 2])
    assert abs(c[0, 8] - c[0, 4]) < abs(c[0, 7] - c[0, 3])
    assert EarlyDetector(spacing=2).detect(c, threshold) == [6]
    assert MaximumDetector(spacing=2).detect(c, threshold) == [13]


def test_early_walk_does_not_jump_to_the_more_symmetric_spoofer() -> None:
    c = two_peaks()
    asymmetry = np.abs(c[0, 4:] - c[0, :-4])
    assert np.argmin(asymmetry[2:]) + 4 == 13  # the global minimum of D, at a peak, is the spoofer's
    assert EarlyDetector(spacing=2).detect(c, 0.5) == [6]


@pytest.mark.parametrize(
    ("c", "threshold", "early", "maximum"),
    [
        ([0, 1, 5, 1, 0], 3, 2, 2),
        ([0, 1, 3, 1, 0], 3, -1, -1),  # equal to the threshold is not above
        ([0, 4, 4, 1, 0], 3, -1, 1),  # two equal taps are no peak; the maximum is the earliest of equals
        ([0, 1, 2, 3, 4], 0.5, -1, 3),  # rises out of the vector; the last tap cannot be punctual
        ([9, 4, 1, 0, 0], 3, -1, 1),  # falls from outside
        ([9, 5, 1, 4, 1, 6, 1], 3, 3, 5),  # the first tap above is no peak: the scan goes on behind it
        ([0, 5, 5, 1, 4, 1], 3, 4, 1),  # behind a tie too
        ([0, 2, 3.5, 5, 1, 0], 3, 3, 3),  # step 3 walks up the flank
        ([0, 0, 0, 0, 0], 0, -1, -1),
    ],
)
def test_rules_at_n_1(c: list[float], threshold: float, early: int, maximum: int) -> None:
    magnitudes = np.array([c], dtype=float)
    assert EarlyDetector().detect(magnitudes, threshold) == [early]
    assert MaximumDetector().detect(magnitudes, threshold) == [maximum]


def test_early_steps_over_a_tap_below_the_threshold() -> None:
    # n = 2: c_2 is above, c_4 higher; step 3 goes over c_3, which is below the threshold, to the peak c_4
    assert EarlyDetector(spacing=2).detect(np.array([[0, 0, 4, 2, 6, 1, 0, 0.0]]), 3.0) == [4]


@every_detector
def test_no_number_is_not_detected(detector: Detectors) -> None:
    magnitudes = np.array([[np.nan] * 5, [0, 1, 9, 1, 0]])
    np.testing.assert_array_equal(detector().detect(magnitudes, 3.0), [-1, 2])
    np.testing.assert_array_equal(detector().detect(magnitudes, np.array([3.0, np.nan])), [-1, -1])


@every_detector
def test_refuses(detector: Detectors) -> None:
    with pytest.raises(ValueError, match="at least 5 correlators, found 4"):
        detector(spacing=2).detect(np.ones((1, 4)), 0.5)
    with pytest.raises(ValueError, match="at least 1 correlator"):
        detector(spacing=0)
