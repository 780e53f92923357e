from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import random_chips
from vestige.records.packed_chips import packed_chips
from vestige.signals.chip_window_kernel import (
    FRACTION_BITS,
    GROUP,
    WINDOW_REACH_CHIPS,
    fill_fractions,
    fill_windows,
    interior,
    phase_apart,
    window_delay,
)


def chips_met(chips: np.ndarray, u0: float, step: float, delays: list[float], n: int) -> np.ndarray:
    """The chip of every sample at every delay, through windows and shifts."""
    room = -(-n // GROUP) * GROUP
    window, fraction = np.empty(room, np.uint32), np.empty(n, np.uint32)
    fill_windows(packed_chips(chips), u0, step, n, window)
    fill_fractions(u0, step, fraction)
    assert np.array_equal(fraction >> FRACTION_BITS, np.floor(u0 + step * np.arange(n)).astype(int) % 32)
    shifts = [(fraction + np.uint32(window_delay(d))) >> np.uint32(FRACTION_BITS) for d in delays]
    return np.array([1 - 2 * ((window[:n] << shift) >> np.uint32(31)).astype(int) for shift in shifts])


@given(
    seed=st.integers(0, 99),
    n_chips=st.integers(100, 3000),
    u0=st.floats(20.3, 40.7),
    step=st.sampled_from([0.10371, 0.4092, 0.4516, 0.4517, 0.99173, 1.70313, 2.0001, 3.7123, 25.575]),
    delays=st.lists(st.floats(-WINDOW_REACH_CHIPS, WINDOW_REACH_CHIPS), min_size=1, max_size=4),
)
def test_windows_give_the_chip_at_every_delay(
    seed: int, n_chips: int, u0: float, step: float, delays: list[float]
) -> None:
    chips = random_chips(np.random.default_rng(seed), n_chips).chips
    n = int(45 / step) + 1  # up to 86 chips
    u = u0 + step * np.arange(n)
    expected = [chips[np.floor(u - d).astype(int)] for d in delays]
    off_edge = [np.abs(u - d - np.round(u - d)) > 2.0**-26 for d in delays]
    met = chips_met(chips, u0, step, delays, n)
    assert np.array_equal(met[off_edge], np.array(expected)[off_edge])


@given(u0=st.floats(8, 1000), step=st.floats(0.05, 25.0))
def test_the_fraction_is_that_of_whole_numbers(u0: float, step: float) -> None:
    """Phase and step have 40 fraction bits; all that follows is exact."""
    fraction = np.empty(1024, np.uint32)
    fill_fractions(u0, step, fraction)
    start, each = round(u0 % 1 * 2**40) + (int(u0) << 40), round(step * 2**40)
    assert fraction.tolist() == [(start + i * each >> 40 - FRACTION_BITS) % 2**32 for i in range(1024)]


@given(u0=st.floats(0, 1000), step=st.floats(0.05, 25.0), lag=st.integers(1, 24))
def test_samples_share_a_chip_if_their_phases_are_far_enough_from_its_start(u0: float, step: float, lag: int) -> None:
    fraction = np.empty(1024, np.uint32)
    fill_fractions(u0, step, fraction)
    phases, each = round(u0 % 1 * 2**40) + round(step * 2**40) * np.arange(1024), round(step * 2**40)
    chips = phases >> 40
    in_chip = fraction[lag:] & (2**FRACTION_BITS - 1)
    off_edge = np.abs((phases[lag:] & (2**40 - 1)) - lag * each) > 2**13  # phases are cut to 2^-27 chip
    same = in_chip >= phase_apart(step, lag)
    assert np.array_equal(same[off_edge], (chips[lag:] == chips[:-lag])[off_edge])


@pytest.mark.parametrize("side", [-1, 1])
def test_an_edge_is_met_within_half_a_micrometre(side: int) -> None:
    """Code phases 2^-26 chip before and after an edge, at 200 delays, 1000 samples into a block."""
    rng = np.random.default_rng(1)
    chips = random_chips(rng, 1000).chips
    for delay in rng.uniform(-WINDOW_REACH_CHIPS, WINDOW_REACH_CHIPS, 200):
        step = 0.409_217_3
        u0 = 500 + delay + side * 2.0**-26 - 999 * step
        met = chips_met(chips, u0, step, [delay], 1000)[0, -1]
        assert met == chips[500 if side > 0 else 499]


@given(st.floats(-500, 3000), st.floats(0.05, 1.5), st.floats(0, 15), st.integers(0, 2000), st.integers(1, 1024))
def test_interior_is_all_but_a_sample_at_each_end(u0: float, step: float, reach: float, n_chips: int, n: int) -> None:
    i0, i1 = interior(u0, step, reach, n_chips, n)
    u = u0 + step * np.arange(n)
    inside = np.flatnonzero((u - reach >= 0) & (u + reach < n_chips))
    assert 0 <= i0 <= i1 <= n
    assert set(range(i0, i1)) <= set(inside.tolist())
    assert i1 - i0 >= inside.size - 4
