"""`fft` and `segment` against sums written out in complex128: the direct sum, and the segmented one."""

from __future__ import annotations

import numpy as np
import pytest

from engine_vector import CHECKED, MILLISECONDS, N_OFFSETS, direct_powers, engine_vector
from vestige.sample_processor.search.engines.engine import CHIP_RATE_HZ, CHIP_SIGMA, CLIP, GRIDS
from vestige.sample_processor.search.engines.fft_engine import FftEngine
from vestige.sample_processor.search.engines.segment.segment_engine import SegmentEngine


def _rounded(codes: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return sums over five chips as the sign tables hold them, at the checked offsets: halves up to 64, doubled."""
    n = codes.shape[1]
    sums = np.array([[[part[:, o : o + n] * code for o in CHECKED] for part in x] for code in codes])
    first = codes[:, None, None, None, ::5].astype(np.int64)
    rows = first * sums.reshape(*sums.shape[:-1], -1, 5).sum(axis=-1)
    return 2 * first * np.clip((rows + 1) // 2, -64, 63)


def _rounding_up(code: np.ndarray, segment_chips: int) -> np.ndarray:
    """Return what each segment has too much: a quarter of a row, of which a whole number is taken off."""
    first = code[::5].astype(int)
    return 2 * np.rint(np.bincount(5 * np.arange(first.size) // segment_chips, 0.25 * first))


def _segmented_phases(n: int) -> np.ndarray:
    """Return the carrier as the segment engine takes it off: stepwise, and a group's sub-bin as one step."""
    grid = GRIDS[n]
    segment = np.arange(n) // grid.segment_chips
    if grid.split == 1:
        return np.outer(grid.bins_hz, segment * grid.segment_chips / CHIP_RATE_HZ)
    whole = np.round(grid.bins_hz / grid.spacing_hz + 1e-6)
    rest = grid.bins_hz / grid.spacing_hz - whole
    assert np.allclose(np.abs(rest), 0.25)
    return np.outer(whole, segment / 256) + np.outer(rest, segment // 128 * 0.5)


@pytest.mark.parametrize("ms", MILLISECONDS)
def test_segment_engine_is_the_segmented_sum_of_rounded_rows(ms: int) -> None:
    codes, x = engine_vector(ms)
    n = codes.shape[1]
    segment_chips = GRIDS[n].segment_chips
    powers = SegmentEngine(codes).powers(x, N_OFFSETS)
    table = np.exp(-2j * np.pi * _segmented_phases(n)[:, ::5])
    steps = np.arange(0, n, segment_chips)
    for k, code in enumerate(codes):
        rows = _rounded(codes, x)[k]
        partial = np.add.reduceat(rows, steps // 5, axis=-1) - _rounding_up(code, segment_chips)
        z = partial[:, :, 0] + 1j * partial[:, :, 1]
        expected = np.max(np.abs(z @ table[:, steps // 5].T) ** 2, axis=-1)
        assert np.max(np.abs(powers[k][:, CHECKED] - expected)) < 1e-5 * powers.max()
    assert np.unravel_index(np.argmax(powers), powers.shape) == (1, 1, 333)


@pytest.mark.parametrize("ms", MILLISECONDS)
def test_rounding_rows_moves_a_magnitude_by_a_thirtieth_of_the_noise(ms: int) -> None:
    """σ of a row is 13.4 steps: 1/√12 of one is 0.022 σ in each dimension."""
    codes, x = engine_vector(ms)
    n = codes.shape[1]
    exact = np.sqrt(direct_powers(codes, x, _segmented_phases(n)))
    moved = np.sqrt(SegmentEngine(codes).powers(x, N_OFFSETS)[:, :, CHECKED]) - exact
    noise = CHIP_SIGMA * np.sqrt(n)
    assert np.max(np.abs(moved)) < 0.1 * noise
    assert 0.01 * noise < np.sqrt(np.mean(moved**2)) < 0.033 * noise


@pytest.mark.parametrize("ms", MILLISECONDS)
def test_fft_engine_is_the_direct_sum(ms: int) -> None:
    codes, x = engine_vector(ms)
    n = codes.shape[1]
    engine = FftEngine(codes)
    powers = engine.powers(x, N_OFFSETS)
    step = CHIP_RATE_HZ / (engine.block + n - 1)
    rounded = np.rint(GRIDS[n].bins_hz / step) * step
    expected = direct_powers(codes, x, np.outer(rounded, np.arange(n) / CHIP_RATE_HZ))
    assert np.max(np.abs(powers[:, :, CHECKED] - expected)) < 1e-5 * expected.max()
    assert np.unravel_index(np.argmax(powers), powers.shape) == (1, 1, 333)


@pytest.mark.parametrize("ms", MILLISECONDS)
def test_bins_are_half_the_inverse_integration_time_apart(ms: int) -> None:
    grid = GRIDS[5115 * ms]
    np.testing.assert_allclose(np.diff(grid.bins_hz), 500 / ms, rtol=2e-3)
    np.testing.assert_allclose(grid.bins_hz, -grid.bins_hz[::-1])
    assert grid.bins_hz[-1] + 250 / ms >= grid.half_width_hz


@pytest.mark.parametrize("ms", [pytest.param(ms, marks=[pytest.mark.slow] if ms > 8 else []) for ms in MILLISECONDS])
def test_the_stated_loss_holds_without_noise(ms: int) -> None:
    """A strong signal on each of some bins, through both engines: never more is lost than they say."""
    n = 5115 * ms
    code = (1 - 2 * np.random.default_rng(ms).integers(0, 2, (1, n))).astype(np.int8)
    segment, fft = SegmentEngine(code), FftEngine(code)
    for f in GRIDS[n].bins_hz[[0, 1, 5, -1]]:
        signal = 16 * code[0] * np.exp(2j * np.pi * f * np.arange(n) / CHIP_RATE_HZ)  # σ is 12: all that is there
        x = np.zeros((1, 2, n + 16), np.int16)
        x[0, 0, 7 : 7 + n], x[0, 1, 7 : 7 + n] = np.rint(signal.real), np.rint(signal.imag)
        for engine in (segment, fft):
            lost_db = 10 * np.log10((16.0 * n) ** 2 / engine.powers(x, 16)[0, 0, 7])
            assert -0.02 < lost_db < engine.loss_db + 0.02  # rounded to steps of a 40th, without noise


def test_the_largest_numbers_do_not_wrap() -> None:
    """All chips at the limit and in phase with the code, 320 in a segment: a row of 5 · 102 is cut to 2 · 63."""
    for n in GRIDS:
        code = (1 - 2 * np.random.default_rng(n).integers(0, 2, (1, n))).astype(np.int8)
        x = np.zeros((1, 2, n + 1), np.int16)
        x[0, :, :n] = CLIP * code
        share = SegmentEngine(code).powers(x, 1)[0, 0, 0] / (2.0 * (126 / 5 * n) ** 2)
        assert 0.8 < share < 1.04  # 16 ms have no bin at 0 Hz: a quarter of a cycle off
