"""The compiled loops of the segment engine; the package says what they compute and why."""

# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="call-arg"

from __future__ import annotations

import numpy as np
from numba import njit

from vestige.sample_processor.search.engines.segment.vector_ir import (
    DFT_POINTS,
    LANES,
    SUM_WIDTH,
    first_dft,
    second_dft_maximum,
    second_dft_store,
    signed_row_sum,
)

CHIPS_IN_GROUP = 5
BINS_STORED = 2 * 27 + 1  # of each of two groups
PATTERNS = 1 << (CHIPS_IN_GROUP - 1)
TABLE_ROWS = PATTERNS + 1  # the last is that of an empty group
ZERO = 64  # the byte that stands for nothing; two rows stay below 256
SEGMENTS = 128  # in a group; 64 and 32 for 2 ms and 1 ms
ROW = SUM_WIDTH + LANES  # of partial sums: padded, so that rows do not fall on the same cache lines
_STRETCH = 1024  # of a sign table that is filled at once, in int16: 32 kB


@njit(cache=True, nogil=True)
def fill_sign_table(x, table):
    """Fill uint8 `table`[17, n] with half of x[n] ± x[n+1] ± … ± x[n+4], and `ZERO`.

    Bit j − 1 of the row is set for +x[n+j]. Halves are rounded up, and what is beyond ±64 is cut.
    """
    table[PATTERNS, :] = ZERO
    wide = np.empty((PATTERNS, _STRETCH), np.int16)
    for first in range(0, table.shape[1], _STRETCH):
        n = min(_STRETCH, table.shape[1] - first)
        wide[0, :n] = x[first : first + n]
        for j in range(1, CHIPS_IN_GROUP):
            rows = 1 << (j - 1)
            later = x[first + j : first + j + n]
            for p in range(rows):
                low, high = wide[p], wide[p + rows]
                for i in range(n):
                    a, b = low[i], later[i]
                    high[i] = a + b
                    low[i] = a - b
        for p in range(PATTERNS):
            row, out = wide[p], table[p, first : first + n]
            for i in range(n):
                half = np.int16((row[i] + 1 + 2 * ZERO) >> 1)
                out[i] = np.uint8(min(max(half, np.int16(0)), np.int16(2 * ZERO - 1)))


@njit(cache=True, nogil=True)
def _partial_sums(table, entries, bounds, first_segment, n_segments, base, sums):
    for k in range(n_segments):
        low, middle, high, zero = bounds[first_segment + k]
        signed_row_sum(table, entries, low, middle, high, zero, base, sums, k * ROW)


@njit(nogil=True)
def _first_stage(sums_re, sums_im, lane, n_segments, turns, points):
    for b in range(DFT_POINTS):
        index, step, turn, out = b * ROW + lane, DFT_POINTS * ROW, 2 * DFT_POINTS * b, 2 * LANES * b
        if n_segments == SEGMENTS:
            first_dft(sums_re, sums_im, index, step, 8, turns, turn, points, out)
        elif n_segments == SEGMENTS // 2:
            first_dft(sums_re, sums_im, index, step, 4, turns, turn, points, out)
        else:
            first_dft(sums_re, sums_im, index, step, 2, turns, turn, points, out)


@njit(cache=True, nogil=True)
def scan(table_re, table_im, entries, bounds, n_segments, stride, turns, out):
    """Raise `out` to the largest power over the Doppler bins at the offsets 0, 1, …; a multiple of SUM_WIDTH of them.

    Of 64 offsets the 32 even ones come first, as `signed_row_sum` leaves them.

    Parameters
    ----------
    table_re, table_im
        Flat sign tables.
    entries, bounds
        Plan of the code: `segment_engine._plan`.
    n_segments
        128, or 64 or 32 for 2 ms and 1 ms.
    stride
        Only every `stride`-th bin is wanted.
    turns
        float32[16 · 16 · 2], 2 exp(−j2π b r / 256): the tables hold halves.
    """
    groups = bounds.shape[0] // n_segments
    sums_re, sums_im = np.zeros(SEGMENTS * ROW, np.int16), np.zeros(SEGMENTS * ROW, np.int16)
    points = np.zeros(DFT_POINTS * DFT_POINTS * 2 * LANES, np.float32)
    spectrum = np.zeros(groups * BINS_STORED * 2 * SUM_WIDTH if groups > 1 else 1, np.float32)
    for base in range(0, out.size, SUM_WIDTH):
        work = (sums_re, sums_im, points, spectrum)
        part = out[base : base + SUM_WIDTH]
        _scan_block(table_re, table_im, entries, bounds, base, n_segments, stride, turns, work, part)


@njit(nogil=True)
def _scan_block(table_re, table_im, entries, bounds, base, n_segments, stride, turns, work, out):
    sums_re, sums_im, points, spectrum = work
    groups = bounds.shape[0] // n_segments
    for group in range(groups):
        _partial_sums(table_re, entries, bounds, group * n_segments, n_segments, base, sums_re)
        _partial_sums(table_im, entries, bounds, group * n_segments, n_segments, base, sums_im)
        for lane in range(0, SUM_WIDTH, LANES):
            _first_stage(sums_re, sums_im, lane, n_segments, turns, points)
            for r in range(0, DFT_POINTS, stride):
                index = r * DFT_POINTS * 2 * LANES
                if groups == 1:
                    _maximum(points, index, r, out, lane)
                else:
                    _store(points, index, r, spectrum, group * BINS_STORED * 2 * SUM_WIDTH + lane)
    if groups == 2:
        _combine(spectrum, out)


@njit(nogil=True)
def _maximum(points, index, r, out, lane):
    """Bins r + 16 g within ±40."""
    if r < 8:
        second_dft_maximum(points, index, -2, 2, out, lane)
    elif r == 8:
        second_dft_maximum(points, index, -3, 2, out, lane)
    else:
        second_dft_maximum(points, index, -3, 1, out, lane)


@njit(nogil=True)
def _store(points, index, r, spectrum, first):
    """Bins r + 16 g within ±27, in order."""
    step, part = 16 * 2 * SUM_WIDTH, SUM_WIDTH
    where = first + (r + 27) * 2 * SUM_WIDTH
    if r < 5:
        second_dft_store(points, index, -1, 1, spectrum, where - step, step, part)
    elif r < 12:
        second_dft_store(points, index, -2, 1, spectrum, where - 2 * step, step, part)
    else:
        second_dft_store(points, index, -2, 0, spectrum, where - 2 * step, step, part)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _combine(spectrum, out):
    """Join two groups of 8 ms at f ± δ, δ a quarter of a bin."""
    c = np.float32(np.cos(np.pi / 8))
    s = np.float32(np.sin(np.pi / 8))
    for b in range(BINS_STORED):
        odd = np.float32(1.0 if b % 2 else -1.0)  # b = 27 is bin 0
        x, y = spectrum[b * 2 * SUM_WIDTH :], spectrum[(BINS_STORED + b) * 2 * SUM_WIDTH :]
        for i in range(out.size):
            x_re, x_im, y_re, y_im = x[i], x[i + SUM_WIDTH], odd * y[i], odd * y[i + SUM_WIDTH]
            out[i] = _pair(c * (x_re + y_re), c * (x_im + y_im), s * (y_re - x_re), s * (y_im - x_im), out[i])


@njit(inline="always")
def _pair(e_re, e_im, o_re, o_im, best):
    """Return the largest of |E + jO|², |E − jO|² and `best`."""
    a, d = e_re + o_im, e_im - o_re
    low = a * a + d * d
    a, d = e_re - o_im, e_im + o_re
    high = a * a + d * d
    best = low if low > best else best
    return high if high > best else best
