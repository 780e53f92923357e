"""Run the compiled loops of the segment engine; the docstring of the package explains the method."""

# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="call-arg"

from __future__ import annotations

import numpy as np

from vestige.kernel_cache import njit
from vestige.sample_processor.search.engines.segment.vector_ir import (
    DFT_POINTS,
    LANES,
    ROW_TOP,
    SHORT_LANES,
    SUM_WIDTH,
    dot,
    first_dft,
    row_sum,
    second_dft_maximum,
    second_dft_store,
)

CHIPS_IN_GROUP = 5
PATTERNS = 1 << (CHIPS_IN_GROUP - 1)
ROW_STEP = 8  # step between two numbers of a row, in units of the chips
SCREEN_BLOCK = 512  # number of offsets of the screen that are computed at once
SEGMENTS = 128  # number of segments in a group; 64 for 2 ms and 32 for 1 ms
SHORT_TURN = 32_768  # magnitude of the int16 phase factors: the value 0.5 in units of 2⁻¹⁶
TOP_OF_SCREEN = 16_000.0  # power of a bin that noise does not reach; a strong signal reaches it even with limited sums
_BINS_STORED = 2 * 27 + 1  # number of stored bins of each group
_ROW = SCREEN_BLOCK + SHORT_LANES  # length of a row of the screen's sums, padded so that rows use different cache lines
_FIRST_POINTS = 8  # number of points of the screen's first DFT
_STRETCH = 1024  # number of offsets of a sign table that are filled at once; 16 rows of int16 take 32 kB
_STEP_BITS = 3


@njit(cache=True, nogil=True)
def fill_sign_table(x, table):
    """Fill uint8 `table`[16, n] with x[n] ± x[n+1] ± … ± x[n+4] in 32 steps of ROW_STEP around zero.

    Bit j − 1 of the row number is set for +x[n+j]. A stored number r stands for r − 15½ steps. Sums outside the 32
    steps are limited.
    """
    wide = np.empty((PATTERNS, _STRETCH), np.int16)
    for first in range(0, table.shape[1], _STRETCH):
        n = min(_STRETCH, table.shape[1] - first)
        for i in range(n):  # a loop, because an assignment of slices takes 2 s to compile
            wide[0, i] = x[first + i]
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
                step = np.int16((row[i] >> _STEP_BITS) + (ROW_TOP + 1) // 2)
                out[i] = np.uint8(min(max(step, np.int16(0)), np.int16(ROW_TOP)))


@njit(cache=True, nogil=True)
def screen(table_re, table_im, entries, bounds, top, shift, stride, split, turns, out):
    """Replace each element of int16 `out` by the largest power over the screen's Doppler bins if this power is larger.

    Powers are in units of 2¹⁴ (2 · ROW_STEP / 2^shift)². The length of `out` is a multiple of SCREEN_BLOCK. The
    elements of `out` belong to the code offsets 0, 1, …. In each group of 32 offsets the 16 even offsets come first,
    like in the output of `row_sum`.

    Parameters
    ----------
    table_re, table_im
        Sign tables of the real and the imaginary part, as arrays of one dimension.
    entries, bounds
        Plan of the code from `segment_engine._plan`, with 16, 32 or 64 segments.
    top, shift
        Limit of a segment's sum in units of ROW_STEP, and number of bits by which the sum is shifted to the left. No
        number wraps if n_segments · top · 2^shift · √2 is below 2¹⁶.
    stride, split
        Step between the bins that are used, and number that selects their range: −40 to 40 for 2, otherwise −32 to 31.
    turns
        int16[16 · 8 · 2], exp(−j2π b r / 128) in units of SHORT_TURN.
    """
    sums_re, sums_im = np.empty(bounds.shape[0] * _ROW, np.int16), np.empty(bounds.shape[0] * _ROW, np.int16)
    points = np.empty(DFT_POINTS * _FIRST_POINTS * 2 * SHORT_LANES, np.int16)
    for base in range(0, out.size, SCREEN_BLOCK):
        _row_sums(table_re, entries, bounds, base, top, shift, sums_re)
        _row_sums(table_im, entries, bounds, base, top, shift, sums_im)
        for lane in range(0, SCREEN_BLOCK, SHORT_LANES):
            _screen_bins(sums_re, sums_im, lane, bounds.shape[0], stride, split, turns, points, out, base + lane)


@njit(nogil=True)
def _row_sums(table, entries, bounds, base, top, shift, sums):
    for k in range(bounds.shape[0]):
        low, plus_end, minus_start, high, first_minus, zero = bounds[k]
        for i in range(0, SCREEN_BLOCK, SUM_WIDTH):
            start, place = base + i, k * _ROW + i
            row_sum(table, entries, low, plus_end, minus_start, high, first_minus, zero, start, top, shift, sums, place)


@njit(nogil=True)
def _screen_bins(sums_re, sums_im, lane, n_segments, stride, split, turns, points, out, where):
    """Replace elements of `out` by the powers of the screen's bins r + 8 g where these powers are larger."""
    step = DFT_POINTS * _ROW
    for b in range(DFT_POINTS):
        index, turn, to = b * _ROW + lane, 2 * _FIRST_POINTS * b, 2 * SHORT_LANES * b
        if n_segments == 64:
            first_dft(sums_re, sums_im, index, step, 4, 8, turns, turn, points, to)
        elif n_segments == 32:
            first_dft(sums_re, sums_im, index, step, 2, 8, turns, turn, points, to)
        else:
            first_dft(sums_re, sums_im, index, step, 1, 8, turns, turn, points, to)
    for r in range(0, _FIRST_POINTS, stride):
        index = r * DFT_POINTS * 2 * SHORT_LANES
        if split == 1:
            second_dft_maximum(points, index, -4, 3, out, where)
        elif r == 0:
            second_dft_maximum(points, index, -5, 5, out, where)
        else:
            second_dft_maximum(points, index, -5, 4, out, where)


@njit(cache=True, nogil=True)
def complete(re, im, code, segment_chips, n_segments, offsets, stride, turns, out):
    """Fill float32 `out` with the largest power over the Doppler bins at single code offsets.

    Parameters
    ----------
    re, im, code
        int16, the chips of the samples (real and imaginary part) and of the code. The code has a whole number of
        segments.
    segment_chips, n_segments
        Number of chips in a segment, and number of segments in a group: 128, or 64 for 2 ms and 32 for 1 ms.
    offsets, out
        Code offsets and their powers; the number of offsets is a multiple of LANES.
    stride
        Step between the bins that are used.
    turns
        float32[16 · 16 · 2], exp(−j2π b r / 256).
    """
    groups = code.size // (segment_chips * n_segments)
    sums_re, sums_im = np.zeros((2, groups * n_segments * LANES), np.int16)
    points = np.empty(DFT_POINTS * DFT_POINTS * 2 * LANES, np.float32)
    spectrum = np.empty(groups * _BINS_STORED * 2 * LANES, np.float32)
    out[:] = 0
    for first in range(0, offsets.size, LANES):
        part = out[first : first + LANES]
        for lane in range(LANES):
            offset = offsets[first + lane]
            for k in range(groups * n_segments):
                chip = k * segment_chips
                sums_re[k * LANES + lane] = dot(re, offset + chip, code, chip, segment_chips)
                sums_im[k * LANES + lane] = dot(im, offset + chip, code, chip, segment_chips)
        for group in range(groups):
            _first_stage(sums_re, sums_im, group * n_segments * LANES, n_segments, turns, points)
            for r in range(0, DFT_POINTS, stride):
                if groups == 1:
                    _maximum(points, r, part)
                else:
                    _store(points, r, spectrum, group * _BINS_STORED * 2 * LANES)
        if groups == 2:
            _combine(spectrum, part)


@njit(nogil=True)
def _first_stage(sums_re, sums_im, start, n_segments, turns, points):
    step = DFT_POINTS * LANES
    for b in range(DFT_POINTS):
        index, turn, to = start + b * LANES, 2 * DFT_POINTS * b, 2 * LANES * b
        if n_segments == SEGMENTS:
            first_dft(sums_re, sums_im, index, step, 8, 16, turns, turn, points, to)
        elif n_segments == SEGMENTS // 2:
            first_dft(sums_re, sums_im, index, step, 4, 16, turns, turn, points, to)
        else:
            first_dft(sums_re, sums_im, index, step, 2, 16, turns, turn, points, to)


@njit(nogil=True)
def _maximum(points, r, out):
    """Replace elements of `out` by the powers of the bins r + 16 g within ±40 where these powers are larger."""
    index = r * DFT_POINTS * 2 * LANES
    if r < 8:
        second_dft_maximum(points, index, -2, 2, out, 0)
    elif r == 8:
        second_dft_maximum(points, index, -3, 2, out, 0)
    else:
        second_dft_maximum(points, index, -3, 1, out, 0)


@njit(nogil=True)
def _store(points, r, spectrum, first):
    """Store the bins r + 16 g within ±27 in ascending order in `spectrum`."""
    index, step, part = r * DFT_POINTS * 2 * LANES, 16 * 2 * LANES, LANES
    where = first + (r + 27) * 2 * LANES
    if r < 5:
        second_dft_store(points, index, -1, 1, spectrum, where - step, step, part)
    elif r < 12:
        second_dft_store(points, index, -2, 1, spectrum, where - 2 * step, step, part)
    else:
        second_dft_store(points, index, -2, 0, spectrum, where - 2 * step, step, part)


@njit(nogil=True, fastmath={"contract"})
def _combine(spectrum, out):
    """Join two groups of 8 ms at f ± δ for each bin f, where δ is ¼ bin, and store the powers that exceed `out`."""
    c = np.float32(np.cos(np.pi / 8))
    s = np.float32(np.sin(np.pi / 8))
    for b in range(_BINS_STORED):
        odd = np.float32(1.0 if b % 2 else -1.0)  # b = 27 is bin 0
        x, y = spectrum[b * 2 * LANES :], spectrum[(_BINS_STORED + b) * 2 * LANES :]
        for i in range(LANES):
            x_re, x_im, y_re, y_im = x[i], x[i + LANES], odd * y[i], odd * y[i + LANES]
            out[i] = _pair(c * (x_re + y_re), c * (x_im + y_im), s * (y_re - x_re), s * (y_im - x_im), out[i])


@njit(inline="always")
def _pair(e_re, e_im, o_re, o_im, best):
    """Return the largest of |E + jO|², |E − jO|² and `best` for two complex numbers E and O."""
    a, d = e_re + o_im, e_im - o_re
    low = a * a + d * d
    a, d = e_re - o_im, e_im + o_re
    high = a * a + d * d
    best = low if low > best else best
    return high if high > best else best
