"""Sum samples into rows of chips, and multiply each row by a code at many offsets, for the hand-over search.

All taps and all quarters of a RECS are the same code at different offsets. So a single code (330 kB for 16 ms) replaces
the matrix of replicas that a matrix product would need. Each row is summed from the samples, and then multiplied by the
code before the next row begins. The row is multiplied in blocks, each block at all offsets. Written data thus stay in
the second-level cache until the data are read. Data that are read again stay in the first-level cache. Blocks also
limit the rounding error of float32.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np

from vestige.kernel_cache import njit
from vestige.sample_processor.search.half_chip_kernel import chip_sums, half_chip_sums

OFFSETS_AT_ONCE = 4  # number of offsets in a loop; real and imaginary parts are eight independent sums
_BLOCK = 1000  # number of chips in a block
_INVERSION_STEPS = 4  # number of steps of the iteration in `time_of`; each step gives five more decimals


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz"})
def _add_products(re, im, code_0, code_1, code_2, code_3, out_re, out_im):
    """Add the products of one block of a row with the code at four offsets."""
    re_0 = re_1 = re_2 = re_3 = im_0 = im_1 = im_2 = im_3 = np.float32(0.0)
    for j in range(re.size):
        x, y = re[j], im[j]
        re_0 += x * code_0[j]
        im_0 += y * code_0[j]
        re_1 += x * code_1[j]
        im_1 += y * code_1[j]
        re_2 += x * code_2[j]
        im_2 += y * code_2[j]
        re_3 += x * code_3[j]
        im_3 += y * code_3[j]
    out_re[0] += re_0
    out_re[1] += re_1
    out_re[2] += re_2
    out_re[3] += re_3
    out_im[0] += im_0
    out_im[1] += im_1
    out_im[2] += im_2
    out_im[3] += im_3


@njit(cache=True, nogil=True)
def _add_block(re, im, code, first, offsets, out_re, out_im):
    """Add the products of the code with the block that begins at chip `first` of a row, at every offset."""
    for k in range(0, offsets.size, OFFSETS_AT_ONCE):
        _add_products(
            re,
            im,
            code[offsets[k] + first :],
            code[offsets[k + 1] + first :],
            code[offsets[k + 2] + first :],
            code[offsets[k + 3] + first :],
            out_re[k : k + OFFSETS_AT_ONCE],
            out_im[k : k + OFFSETS_AT_ONCE],
        )


@njit(cache=True, nogil=True)
def time_of(chips, code_rate, code_rate_rate):
    """Return the time t at which R t + ½ Ṙ t² equals `chips`, for the code rate R and its rate of change Ṙ."""
    t = chips / code_rate
    for _ in range(_INVERSION_STEPS):
        t = (chips - 0.5 * code_rate_rate * t**2) / code_rate
    return t


@njit(cache=True, nogil=True)
def row_products(
    x, t0, dt, code_rate, code_rate_rate, if_hz, doppler_rate, first_row, n, code, offsets, odd_offsets, out, odd, noise
):
    """Fill `out` and `odd` with products of rows of `n` chips and the code on two grids, and `noise` with Σ|chip|².

    Parameters
    ----------
    x, t0, dt, code_rate, code_rate_rate, if_hz, doppler_rate
        Arguments with the same meaning as in `half_chip_sums`. Chip 0 is the first chip of row 0.
    first_row
        Number of the first row in `out`, `odd` and `noise`.
    code
        float32, chips of the code, with at least `n` chips after every offset.
    offsets, odd_offsets
        int64[multiple of `OFFSETS_AT_ONCE`], offsets for the chips and for the chips half a chip later; may be empty.
    out, odd
        float32[2, rows, offsets], real and imaginary part of the products.
    noise
        float64[rows], Σ|chip|² of each row.
    """
    re, im = np.empty(2 * n + 1, np.float32), np.empty(2 * n + 1, np.float32)
    even, late = np.empty((2, _BLOCK), np.float32), np.empty((2, _BLOCK), np.float32)
    n_samples = x.size // 2
    out[:], odd[:], noise[:] = 0, 0, 0
    for row in range(noise.size):
        begin = (first_row + row) * n
        low = (time_of(begin, code_rate, code_rate_rate) - t0) / dt
        high = (time_of(begin + n + 1, code_rate, code_rate_rate) - t0) / dt
        start, stop = max(int(low) - 1, 0), min(int(high) + 2, n_samples)
        part, t = x[2 * start : 2 * stop], t0 + start * dt
        half_chip_sums(part, t, dt, code_rate, code_rate_rate, if_hz, doppler_rate, 2 * begin, re, im)
        for first in range(0, n, _BLOCK):
            m = min(_BLOCK, n - first)
            m_late = m if odd_offsets.size else 0
            noise[row] += chip_sums(re[2 * first :], even[0, :m], late[0, :m_late])
            noise[row] += chip_sums(im[2 * first :], even[1, :m], late[1, :m_late])
            _add_block(even[0, :m], even[1, :m], code, first, offsets, out[0, row], out[1, row])
            _add_block(late[0, :m], late[1, :m], code, first, odd_offsets, odd[0, row], odd[1, row])
