"""The fast engine of a processor; the package says how it works and why."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int8, Int16, Int32, Int64

from vestige.sample_processor.search.engines.engine import CHIP_RATE_HZ, GRIDS
from vestige.sample_processor.search.engines.segment.segment_kernel import (
    CHIPS_IN_GROUP,
    PATTERNS,
    SEGMENTS,
    TABLE_ROWS,
    ZERO,
    fill_sign_table,
    scan,
)
from vestige.sample_processor.search.engines.segment.vector_ir import DFT_POINTS, SUM_WIDTH

_TABLE_OFFSETS = 16_384  # that share one set of tables

_HALF_ROUNDED_UP = 0.25  # of a row, in the mean: every second sum is odd


@dataclass(frozen=True, slots=True)
class _Plan:
    """A code as rows of the sign tables: entries of segment k are bounds[k, 0] … bounds[k, 2], minus from [k, 1] on.

    Both signs have an even number of them, if need be with a row of nothing. bounds[k, 3] is what they sum to where the
    samples are zero.
    """

    entries: Int32[np.ndarray, " groups"]
    bounds: Int64[np.ndarray, "segments 4"]


class SegmentEngine:
    """Powers of codes of equal length by sign tables and a Doppler transform; see the package.

    Parameters
    ----------
    codes
        ±1; 1, 2, 4, 8 or 16 ms of chips each.
    """

    block = 8 * _TABLE_OFFSETS
    uses_cores = True

    def __init__(self, codes: Int8[np.ndarray, "codes chips"]) -> None:
        grid = GRIDS[codes.shape[1]]
        self._stride = grid.stride
        self._segments = SEGMENTS // grid.stride
        self._table_length = -(-(_TABLE_OFFSETS + codes.shape[1]) // 32) * 32
        self._plans = [_plan(code, grid.segment_chips, self._segments, self._table_length) for code in codes]
        k = np.arange(DFT_POINTS)
        turns = 2 * np.exp(-2j * np.pi * np.outer(k, k) / DFT_POINTS**2).astype(np.complex64)
        self._turns = turns.reshape(-1).view(np.float32)
        segment_s = grid.segment_chips / CHIP_RATE_HZ
        outermost_hz = grid.reach * grid.spacing_hz + grid.sub_bin_hz
        edge = np.sinc(outermost_hz * segment_s) * np.sinc(grid.sub_bin_hz * SEGMENTS * segment_s)
        self.loss_db = float(-20 * np.log10(edge))

    def powers(
        self, chips: Int16[np.ndarray, "grids 2 n"], n_offsets: int
    ) -> Float32[np.ndarray, "codes grids n_offsets"]:
        """Return the largest power over the bins, for every code, grid and offset; chips within ±127."""
        best = np.zeros((len(self._plans), chips.shape[0], n_offsets), np.float32)
        tables = np.empty((2, TABLE_ROWS, self._table_length), np.uint8)
        stretch = np.zeros(self._table_length + CHIPS_IN_GROUP, np.int16)
        for grid in range(chips.shape[0]):
            for first in range(0, n_offsets, _TABLE_OFFSETS):
                count = min(_TABLE_OFFSETS, n_offsets - first)
                for part in (0, 1):
                    have = chips[grid, part, first : first + stretch.size]
                    stretch[: have.size] = have
                    stretch[have.size :] = 0
                    fill_sign_table(stretch, tables[part])
                for plan, out in zip(self._plans, best, strict=True):
                    powers = np.zeros(-(-count // SUM_WIDTH) * SUM_WIDTH, np.float32)
                    scan(
                        tables[0].reshape(-1),
                        tables[1].reshape(-1),
                        plan.entries,
                        plan.bounds,
                        self._segments,
                        self._stride,
                        self._turns,
                        powers,
                    )
                    powers = powers.reshape(-1, 2, 32).swapaxes(1, 2).reshape(-1)  # even and odd offsets in turn
                    out[grid, first : first + count] = powers[:count]
        return best


def _plan(code: Int8[np.ndarray, " chips"], segment_chips: int, n_segments: int, table_length: int) -> _Plan:
    """Return the plan of a code; its segments fill whole groups of `n_segments`, the last ones may be empty."""
    signs = code.reshape(-1, CHIPS_IN_GROUP).astype(np.int64)  # 1 ms is 5115 chips
    first = signs[:, 0]
    pattern = ((signs[:, 1:] * first[:, None] > 0) << np.arange(CHIPS_IN_GROUP - 1)).sum(axis=1)
    chip = CHIPS_IN_GROUP * np.arange(first.size)
    segment = chip // segment_chips
    total = -(-code.size // (segment_chips * n_segments)) * n_segments
    count = np.stack([np.bincount(segment[first == sign], minlength=total) for sign in (1, -1)], axis=1)
    odd_segment, odd_minus = np.nonzero(count % 2)  # these get a row of nothing
    group_of = 2 * np.concatenate([segment, odd_segment]) + np.concatenate([first < 0, odd_minus])
    entry = np.concatenate([pattern * table_length + chip, np.full(odd_segment.size, PATTERNS * table_length)])
    plus, minus = (count + count % 2).T
    ends = np.cumsum(plus + minus)
    zero = np.rint(ZERO * (plus - minus) + _HALF_ROUNDED_UP * (count[:, 0] - count[:, 1]))
    bounds = np.stack([ends - minus - plus, ends - minus, ends, zero], axis=1)
    return _Plan(entry[np.argsort(group_of, kind="stable")].astype(np.int32), bounds.astype(np.int64))
