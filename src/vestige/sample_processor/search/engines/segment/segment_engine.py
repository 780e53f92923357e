"""Plan and run the fast engine for a processor; the docstring of the package explains the method."""

# mypy: disable-error-code="call-arg"

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int8, Int16, Int32, Int64

from vestige.sample_processor.search.engines.engine import CHIP_RATE_HZ, CHIP_SIGMA, GRIDS, chip_variance
from vestige.sample_processor.search.engines.segment.segment_kernel import (
    CHIPS_IN_GROUP,
    PATTERNS,
    ROW_STEP,
    SCREEN_BLOCK,
    SEGMENTS,
    SHORT_TURN,
    TOP_OF_SCREEN,
    complete,
    fill_sign_table,
    screen,
)
from vestige.sample_processor.search.engines.segment.vector_ir import (
    DFT_POINTS,
    LANES,
    ROW_TOP,
    ROWS_AT_ONCE,
    VECTOR_BYTES,
)
from vestige.theory.screen_loss import SCREEN_SHARE, pass_threshold

_TABLE_OFFSETS = 131_072  # number of code offsets that share a set of sign tables
_PAGE = 4096  # number of bytes after which cache lines repeat; the rows of a table are spread evenly over the lines
_CUT = 1.0  # largest rounding error of a screened power in units of int16, because two squares are rounded down
_SIGMA_OF_BIN = 1000  # largest σ of a bin of the screen in int16; the smallest σ is half of this value
_MOST_SCREENED = 0.3  # largest share of offsets at which noise passes the screen; above this share a screen costs time


@dataclass(frozen=True, slots=True)
class _Plan:
    """Rows of the sign tables that a code adds and subtracts in each segment, in the order that `row_sum` explains."""

    entries: Int32[np.ndarray, " groups"]
    bounds: Int64[np.ndarray, "segments 6"]


class SegmentEngine:
    """Engine that tests a part of the chips of each code, and then sums up all chips at the offsets that pass.

    Parameters
    ----------
    codes
        Codes of ±1; each has 1, 2, 4, 8 or 16 ms of chips.

    Attributes
    ----------
    sum_limit
        Largest magnitude of the real and of the imaginary part of a segment's sum in the screen, in units of the chips.
        Larger sums are limited to this magnitude.
    """

    block = _TABLE_OFFSETS
    uses_cores = True

    def __init__(self, codes: Int8[np.ndarray, "codes chips"]) -> None:
        grid = GRIDS[codes.shape[1]]
        self._grid = grid
        self._segments = SEGMENTS // grid.stride  # number of segments in a group
        whole = self._segments * grid.split
        self._missing = whole * grid.segment_chips - codes.shape[1]  # number of chips that the last segment lacks
        self._codes = np.pad(codes, ((0, 0), (0, self._missing))).astype(np.int16)
        self._screened = slice(whole // 8 * grid.segment_chips, 7 * whole // 8 * grid.segment_chips)
        screened_chips = self._screened.stop - self._screened.start
        self._table_length = -(-(_TABLE_OFFSETS + screened_chips) // _PAGE) * _PAGE + _PAGE // PATTERNS
        segments = self._segments // 2  # number of segments of the screen
        self._plans = [_plan(code[self._screened], screened_chips // segments, self._table_length) for code in codes]
        sigma = CHIP_SIGMA / (2 * ROW_STEP) * np.sqrt(screened_chips)  # σ of a bin before the shift
        self._shift = int(np.log2(_SIGMA_OF_BIN / sigma))
        self.sum_limit = ROW_STEP * (int(np.sqrt(2) * SHORT_TURN / segments) >> self._shift)
        self._unit = 16_384.0 * (2 * ROW_STEP / (1 << self._shift)) ** 2
        self._turns = _turns(DFT_POINTS)
        self._short_turns = np.rint(np.minimum(SHORT_TURN * _turns(DFT_POINTS // 2), SHORT_TURN - 1)).astype(np.int16)
        segment_s = grid.segment_chips / CHIP_RATE_HZ
        outermost_hz = grid.reach * grid.spacing_hz + grid.sub_bin_hz
        edge = np.sinc(outermost_hz * segment_s) * np.sinc(grid.sub_bin_hz * SEGMENTS * segment_s)
        self.loss_db = float(-20 * np.log10(edge))

    def powers(
        self, chips: Int16[np.ndarray, "grids 2 n"], n_offsets: int, threshold: float = 0.0
    ) -> Float32[np.ndarray, "codes grids n_offsets"]:
        """Return the largest power over the Doppler bins, for every code, grid and code offset.

        The chips must be within ±`CLIP`, so that a segment's sum fits int16. The screen adds the chips of two grids
        half a chip apart. The power is zero at offsets that do not pass the screen.
        """
        best = np.zeros((len(self._plans), chips.shape[0], n_offsets), np.float32)
        limit = pass_threshold(threshold)
        padded = np.pad(chips, ((0, 0), (0, 0), (0, self._missing)))
        if self._grid.bins_hz.size * SCREEN_SHARE * np.exp(-(limit**2) / 2) > _MOST_SCREENED:
            for grid in range(chips.shape[0]):
                for code, out in zip(self._codes, best, strict=True):
                    out[grid] = self._completed(padded[grid], code, np.arange(n_offsets))
            return best
        joined = _joined(chips)
        noise = chip_variance(joined[None]) * (self._screened.stop - self._screened.start)
        least = min(limit**2 * noise, TOP_OF_SCREEN * self._unit)
        for passed, code, out in zip(self.screened(joined, n_offsets), self._codes, best, strict=True):
            offsets = np.flatnonzero(passed > least)
            for grid in range(chips.shape[0]):
                out[grid, offsets] = self._completed(padded[grid], code, offsets)
        return best

    def screened(self, chips: Int16[np.ndarray, "2 n"], n_offsets: int) -> Float32[np.ndarray, "codes n_offsets"]:
        """Return the largest power of the middle three quarters of the chips over the screen's bins."""
        best = np.empty((len(self._plans), n_offsets), np.float32)
        tables = np.empty((2, PATTERNS, self._table_length), np.uint8)
        begin, end = self._screened.start, self._screened.stop
        for first in range(0, n_offsets, _TABLE_OFFSETS):
            count = min(_TABLE_OFFSETS, n_offsets - first)
            rounded = -(-count // SCREEN_BLOCK) * SCREEN_BLOCK
            width = rounded + end - begin
            for part in (0, 1):
                stretch = np.zeros(width + CHIPS_IN_GROUP, np.int16)
                have = chips[part, first + begin : first + begin + stretch.size]
                stretch[: have.size] = have
                fill_sign_table(stretch, tables[part, :, :width])
            for plan, out in zip(self._plans, best, strict=True):
                powers = np.zeros(rounded, np.int16)
                flat = (table.reshape(-1) for table in tables)
                limits, bins = (self.sum_limit // ROW_STEP, self._shift), (self._grid.stride, self._grid.split)
                screen(*flat, plan.entries, plan.bounds, *limits, *bins, self._short_turns, powers)
                # `screen` stores even offsets before odd offsets; this line restores the order of the offsets
                powers = powers.reshape(-1, 2, VECTOR_BYTES // 2).swapaxes(1, 2).reshape(-1)
                out[first : first + count] = powers[:count]
        return (best + np.float32(_CUT)) * np.float32(self._unit)

    def _completed(
        self, chips: Int16[np.ndarray, "2 n"], code: Int16[np.ndarray, " chips"], offsets: Int64[np.ndarray, " some"]
    ) -> Float32[np.ndarray, " some"]:
        """Return the largest power of all chips over the Doppler bins, at the given code offsets."""
        filled = np.zeros(-(-offsets.size // LANES) * LANES, np.int64)
        filled[: offsets.size] = offsets
        powers = np.empty(filled.size, np.float32)
        grid = self._grid
        complete(*chips, code, grid.segment_chips, self._segments, filled, grid.stride, self._turns, powers)
        return powers[: offsets.size]


def _joined(chips: Int16[np.ndarray, "grids 2 n"]) -> Int16[np.ndarray, "2 n"]:
    """Return the sums of the chips of two grids, scaled to the σ of a single chip; a single grid is returned unchanged.

    Two chips half a chip apart share half of their noise. So the variance of their sum is three times the variance of a
    chip.
    """
    if chips.shape[0] == 1:
        return chips[0]
    return np.rint((chips[0] + chips[1]) * np.float32(np.sqrt(1 / 3))).astype(np.int16)


def _turns(points: int) -> Float32[np.ndarray, " numbers"]:
    """Return exp(−j2π b r / (16 · points)) for b < 16 and r < `points`, real and imaginary parts interleaved."""
    angles = np.outer(np.arange(DFT_POINTS), np.arange(points)) / (DFT_POINTS * points)
    return np.exp(-2j * np.pi * angles).astype(np.complex64).reshape(-1).view(np.float32)


def _plan(code: Int8[np.ndarray, " chips"], segment_chips: int, table_length: int) -> _Plan:
    """Return the plan of a code whose length is a whole number of segments."""
    signs = code.reshape(-1, CHIPS_IN_GROUP).astype(np.int64)
    first = signs[:, 0]
    pattern = ((signs[:, 1:] * first[:, None] > 0) << np.arange(CHIPS_IN_GROUP - 1)).sum(axis=1)
    entries = pattern * table_length + CHIPS_IN_GROUP * np.arange(first.size)
    rows = segment_chips // CHIPS_IN_GROUP
    plus = np.count_nonzero(first.reshape(-1, rows) > 0, axis=1)
    low = rows * np.arange(plus.size)
    added, mixed = plus // ROWS_AT_ONCE, (plus % ROWS_AT_ONCE > 0).astype(int)
    subtracted = rows // ROWS_AT_ONCE - added - mixed
    plus_end = low + ROWS_AT_ONCE * added
    minus_start = plus_end + ROWS_AT_ONCE * mixed
    zero = ROWS_AT_ONCE * ROW_TOP // 2 * (added + mixed - subtracted)
    bounds = np.stack([low, plus_end, minus_start, low + rows, low + plus, zero], axis=1)
    order = np.lexsort((first < 0, np.arange(first.size) // rows))
    return _Plan(entries[order].astype(np.int32), bounds.astype(np.int64))
