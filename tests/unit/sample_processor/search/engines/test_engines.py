"""`fft` and `segment` against sums written out in complex128: the direct sum, the segmented one, and the screen's."""

from __future__ import annotations

import numpy as np
import pytest

from engine_vector import CHECKED, MILLISECONDS, N_OFFSETS, direct_powers, engine_vector
from vestige.sample_processor.search.engines.engine import CHIP_RATE_HZ, CHIP_SIGMA, CLIP, GRIDS
from vestige.sample_processor.search.engines.fft_engine import FftEngine
from vestige.sample_processor.search.engines.segment.segment_engine import SegmentEngine
from vestige.sample_processor.search.engines.segment.segment_kernel import ROW_STEP
from vestige.theory.screen_loss import pass_threshold


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
def test_segment_engine_is_the_segmented_sum(ms: int) -> None:
    codes, x = engine_vector(ms)
    powers = SegmentEngine(codes).powers(x, N_OFFSETS)
    expected = direct_powers(codes, x, _segmented_phases(codes.shape[1]))
    assert np.max(np.abs(powers[:, :, CHECKED] - expected)) < 1e-5 * expected.max()
    assert np.unravel_index(np.argmax(powers), powers.shape) == (1, 1, 333)


def _middle(n: int) -> slice:
    """Return the chips that the screen sums up: whole segments, three quarters of them, in the middle."""
    segments = {5115: 32, 10_230: 64}.get(n, n // GRIDS[n].segment_chips + 1)
    eighth = segments // 8 * GRIDS[n].segment_chips
    return slice(eighth, 7 * eighth)


def _screen_segment_chips(n: int) -> int:
    return 3 * GRIDS[n].segment_chips * GRIDS[n].split // 2


def _screen_phases(n: int, chip_step: int = 1) -> np.ndarray:
    """Return the carrier as the screen takes it off, segment by segment, at bins 1/(2 T) of the middle apart."""
    grid = GRIDS[n]
    segment_chips = _screen_segment_chips(n)
    spacing_hz = grid.stride * CHIP_RATE_HZ / (128 * segment_chips)
    first, last = (-40, 40) if grid.split == 2 else (-32 // grid.stride, 31 // grid.stride)
    middle = _middle(n)
    segment = np.arange(middle.stop - middle.start)[::chip_step] // segment_chips
    return np.outer(np.arange(first, last + 1) * spacing_hz, segment * segment_chips / CHIP_RATE_HZ)


@pytest.mark.parametrize("ms", MILLISECONDS)
def test_the_screen_is_the_segmented_sum_of_rounded_rows_over_the_middle(ms: int) -> None:
    """Sums of five chips in steps of eight, up to 15½ of them; int16 moves a magnitude by less than 0.03 σ.

    No number wraps, because the sum of a segment is cut.
    """
    codes, x = engine_vector(ms)
    n = codes.shape[1]
    middle = _middle(n)
    noise = CHIP_SIGMA * np.sqrt(middle.stop - middle.start)
    engine = SegmentEngine(codes)
    table = np.exp(-2j * np.pi * _screen_phases(n, _screen_segment_chips(n)))
    for grid in x:
        screened = np.sqrt(engine.screened(grid, N_OFFSETS)[:, list(CHECKED)])
        for code, found in zip(codes, screened, strict=True):
            first = code[middle][::5].astype(float)
            sums = np.array([grid[:, o + middle.start : o + middle.stop] * code[middle] for o in CHECKED])
            rows = first * np.clip(
                np.floor(first * sums.reshape(*sums.shape[:-1], -1, 5).sum(-1) / 8) + 0.5, -15.5, 15.5
            )
            segments = 8 * rows.reshape(*rows.shape[:2], -1, _screen_segment_chips(n) // 5).sum(-1)
            cut = np.clip(segments, -engine.sum_limit, engine.sum_limit)
            expected = np.max(np.abs((cut[:, 0] + 1j * cut[:, 1]) @ table.T), axis=1)
            np.testing.assert_allclose(found, expected, rtol=0, atol=0.03 * noise)


@pytest.mark.parametrize("ms", MILLISECONDS)
def test_rounding_rows_moves_a_magnitude_of_the_screen_by_a_twelfth_of_the_noise(ms: int) -> None:
    """σ of a row is 3.35 steps: 1/√12 of one is 0.086 σ in each dimension."""
    codes, x = engine_vector(ms)
    n = codes.shape[1]
    middle = _middle(n)
    exact = np.sqrt(direct_powers(codes[:, middle], x[:, :, middle.start :], _screen_phases(n)))
    engine = SegmentEngine(codes)
    moved = np.sqrt([engine.screened(grid, N_OFFSETS)[:, list(CHECKED)] for grid in x]).swapaxes(0, 1)
    top = 12 * CHIP_SIGMA * np.sqrt(middle.stop - middle.start)  # the sums of a stronger signal are cut
    moved = np.minimum(moved, top) - np.minimum(exact, top)
    noise = CHIP_SIGMA * np.sqrt(middle.stop - middle.start)
    assert np.max(np.abs(moved)) < 0.4 * noise
    assert 0.04 * noise < np.sqrt(np.mean(moved**2)) < 0.12 * noise


@pytest.mark.parametrize("ms", [1, 4, 16])
def test_what_passes_the_screen_is_the_sum_over_all_chips_and_the_rest_is_nothing(ms: int) -> None:
    codes, x = engine_vector(ms)
    engine = SegmentEngine(codes)
    threshold = 6.3
    powers = engine.powers(x, N_OFFSETS, threshold)
    middle = _middle(codes.shape[1])
    joined = np.rint(x.sum(axis=0) / np.sqrt(3)).astype(np.int16)
    least = pass_threshold(threshold) ** 2 * np.mean(joined.astype(float) ** 2) * (middle.stop - middle.start)
    passed = engine.screened(joined, N_OFFSETS) > least
    np.testing.assert_array_equal(powers, np.where(passed[:, None], engine.powers(x, N_OFFSETS), 0))
    assert passed[1, 333]
    assert 0 < np.mean(passed) < 0.3


def test_a_low_threshold_is_not_screened() -> None:
    """At 4 σ noise alone would pass nearly everywhere: all offsets are computed in full."""
    codes, x = engine_vector(2)
    engine = SegmentEngine(codes)
    np.testing.assert_array_equal(engine.powers(x, N_OFFSETS, 4.0), engine.powers(x, N_OFFSETS))


@pytest.mark.parametrize("ms", MILLISECONDS)
def test_no_signal_is_too_strong_for_the_screen(ms: int) -> None:
    """The sums of its segments are cut: no int16 number wraps, whatever the Doppler, and it stays above 28 σ."""
    n = 5115 * ms
    code = (1 - 2 * np.random.default_rng(ms).integers(0, 2, (1, n))).astype(np.int8)
    engine = SegmentEngine(code)
    largest = 64 // GRIDS[n].stride * np.sqrt(2) * engine.sum_limit / ROW_STEP * 2**engine._shift / 2
    assert 30_000 < largest < 32_768
    bins = GRIDS[n].bins_hz
    middle = [(amplitude, bins[bins.size // 2]) for amplitude in range(16, CLIP, 6)]
    for amplitude, f in (*middle, (16, bins[0]), (16, bins[-2]), (CLIP, bins[7] + 30 / ms)):
        signal = amplitude * code[0] * np.exp(2j * np.pi * (f * np.arange(n) / CHIP_RATE_HZ + 0.07))
        x = np.zeros((1, 2, n + 16), np.int16)
        x[0, 0, 7 : 7 + n], x[0, 1, 7 : 7 + n] = np.rint(signal.real), np.rint(signal.imag)
        assert 0 < engine.powers(x, 16, 28.0)[0, 0, 7] == engine.powers(x, 16)[0, 0, 7]


@pytest.mark.parametrize("ms", [*MILLISECONDS[:-1], pytest.param(16, marks=pytest.mark.slow)])
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
    """All chips at the limit and in phase with the code, 320 in a segment."""
    for n in GRIDS:
        code = (1 - 2 * np.random.default_rng(n).integers(0, 2, (1, n))).astype(np.int8)
        x = np.zeros((1, 2, n + 1), np.int16)
        x[0, :, :n] = CLIP * code
        share = SegmentEngine(code).powers(x, 1)[0, 0, 0] / (2.0 * (CLIP * n) ** 2)
        assert 0.8 < share < 1.04  # 16 ms have no bin at 0 Hz: a quarter of a cycle off
