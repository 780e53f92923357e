"""Add the paths of one signal to samples, in compiled loops.

The paths of a signal are divided into groups of paths, whose delays differ by at most 2 · `WINDOW_REACH_CHIPS`. All
paths of a group use the same chip windows (`vestige.signals.chip_window_kernel`). So each sample of a path needs a
rotation, the multiplication by the path's chip, and an addition. Each path has its own rotator table. The phase
of a path at the middle of every block is computed in float64. The Doppler rate rotates the sum of all paths inside the
block. This rotation is computed to second order in its angle, which stays below 1e-3 rad in a RECS of 16 ms at 100 Hz/s
and 12.5 MHz.

One loop processes two paths, so that their sum is loaded and stored once. The loop of the last two paths also rotates
the sum and adds the sum to the samples. An odd number of paths gets another path with amplitude 0, which changes no
bit.

No sum depends on the order of vector lanes, and products and sums are fused explicitly. So a block has equal bits on
every machine, even if several calls make the samples, divided at the limits of blocks.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np

from vestige.kernel_cache import njit
from vestige.signals.chip_window_kernel import (
    WINDOW_REACH_CHIPS,
    chip_at,
    chip_of,
    fill_fractions,
    fill_windows,
    interior,
    window_delay,
)
from vestige.signals.float_kernel import fma
from vestige.signals.rotator_kernel import BLOCK, MIDDLE, from_middle, rotator_table, turn_at

# number of elements in a row of the rotator tables; rows 4096 bytes apart would displace each other from the L1 cache
_ROW = BLOCK + 48


@njit(inline="always")
def _with_ray(sum_re, sum_im, chip, cos, sin, re, im):
    """Return the sum of paths plus chip × amplitude × rotator of another path, at a sample."""
    return fma(chip, fma(re, cos, -im * sin), sum_re), fma(chip, fma(re, sin, im * cos), sum_im)


@njit(cache=True, nogil=True)
def _add_two_rays(window, fraction, shift, cos, sin, a, r, first, fresh, s_re, s_im):
    """Add path number r and then path number r + 1 to the sum of the paths, from sample `first` on.

    If `fresh` is true, the previous sum is replaced.
    """
    re, im = np.float32(a[r].real), np.float32(a[r].imag)
    re_2, im_2 = np.float32(a[r + 1].real), np.float32(a[r + 1].imag)
    cos_1, sin_1, cos_2, sin_2 = cos[r, first:], sin[r, first:], cos[r + 1, first:], sin[r + 1, first:]
    shift_1, shift_2, zero = shift[r], shift[r + 1], np.float32(0.0)
    for i in range(s_re.size):
        sum_re, sum_im = zero if fresh else s_re[i], zero if fresh else s_im[i]
        chip_1, chip_2 = chip_of(window[i], fraction[i], shift_1), chip_of(window[i], fraction[i], shift_2)
        sum_re, sum_im = _with_ray(sum_re, sum_im, chip_1, cos_1[i], sin_1[i], re, im)
        s_re[i], s_im[i] = _with_ray(sum_re, sum_im, chip_2, cos_2[i], sin_2[i], re_2, im_2)


@njit(cache=True, nogil=True)
def _add_turned(window, fraction, shift, cos, sin, a, r, s_re, s_im, places, slope, curve, x):
    """Add paths number r and r + 1 to the sum of the paths, and add this sum to the samples.

    The sum is rotated by the small angle slope · k + curve · k², with k counted from the middle of the block.
    """
    re, im = np.float32(a[r].real), np.float32(a[r].imag)
    re_2, im_2 = np.float32(a[r + 1].real), np.float32(a[r + 1].imag)
    cos_1, sin_1, cos_2, sin_2 = cos[r], sin[r], cos[r + 1], sin[r + 1]
    shift_1, shift_2 = shift[r], shift[r + 1]
    for i in range(x.size // 2):
        chip_1, chip_2 = chip_of(window[i], fraction[i], shift_1), chip_of(window[i], fraction[i], shift_2)
        sum_re, sum_im = _with_ray(s_re[i], s_im[i], chip_1, cos_1[i], sin_1[i], re, im)
        sum_re, sum_im = _with_ray(sum_re, sum_im, chip_2, cos_2[i], sin_2[i], re_2, im_2)
        k = places[i]
        turn = k * fma(curve, k, slope)
        kept = fma(np.float32(-0.5) * turn, turn, np.float32(1.0))
        x[2 * i] += fma(sum_re, kept, -sum_im * turn)
        x[2 * i + 1] += fma(sum_im, kept, sum_re * turn)


@njit(cache=True, nogil=True)
def _add_edge_ray(packed, n_chips, u0, step, delay, cos, sin, a, s_re, s_im):
    """Add to the sum of the paths a path that may have samples before the first or after the last chip."""
    a_re, a_im = np.float32(a.real), np.float32(a.imag)
    for i in range(s_re.size):
        j = np.int64(np.floor(u0 + i * step - delay))
        if 0 <= j < n_chips:
            chip = chip_at(packed, j)
            s_re[i] += chip * (a_re * cos[i] - a_im * sin[i])
            s_im[i] += chip * (a_re * sin[i] + a_im * cos[i])


@njit(cache=True, nogil=True)
def _add_group(x, packed, n_chips, delays, amplitudes, ray_hz, t0, dt, code_rate, code_rate_rate, if_hz, doppler_rate):
    """Add paths with delays within 2 · WINDOW_REACH_CHIPS to samples; `add_paths` explains the parameters."""
    n_samples, n_rays = x.size // 2, delays.size
    middle, reach = (delays.max() + delays.min()) / 2, (delays.max() - delays.min()) / 2
    last = (n_rays - 1) // 2 * 2  # first path of the last pair
    cos, sin = np.zeros((last + 2, _ROW), np.float32), np.zeros((last + 2, _ROW), np.float32)
    a, shift = np.zeros(last + 2, np.complex128), np.zeros(last + 2, np.uint32)
    for r in range(n_rays):
        shift[r] = window_delay(delays[r] - middle)
        rotator_table((if_hz + ray_hz[r]) * dt, cos[r, :BLOCK], sin[r, :BLOCK])
    window, fraction = np.zeros(BLOCK, np.uint32), np.zeros(BLOCK, np.uint32)
    s_re, s_im = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    places = from_middle()

    for b0 in range(0, n_samples, BLOCK):
        n = min(BLOCK, n_samples - b0)
        t = t0 + b0 * dt
        tm = t + MIDDLE * dt
        step = (code_rate + code_rate_rate * tm) * dt
        u0 = code_rate * t + 0.5 * code_rate_rate * t * t - middle
        if u0 + step * n + reach < 0 or u0 - reach > n_chips:
            continue
        i0, i1 = interior(u0, step, reach, n_chips, n)
        if i1 > i0:
            fill_windows(packed, u0 + i0 * step, step, i1 - i0, window)
            fill_fractions(u0 + i0 * step, step, fraction[: i1 - i0])
        for r in range(n_rays):
            a[r] = amplitudes[r] * turn_at(if_hz + ray_hz[r], doppler_rate, tm)
        inside = i1 - i0 == n
        if last == 0 or not inside:  # in all other blocks the first pair of paths overwrites the previous sum
            s_re[:] = 0
            s_im[:] = 0
        for r in range(0, last if inside else last + 2, 2):
            _add_two_rays(window, fraction, shift, cos, sin, a, r, i0, inside and r == 0, s_re[i0:i1], s_im[i0:i1])
        if not inside:
            for r in range(n_rays):
                d, u1 = delays[r] - middle, u0 + i1 * step
                _add_edge_ray(packed, n_chips, u0, step, d, cos[r, :i0], sin[r, :i0], a[r], s_re[:i0], s_im[:i0])
                _add_edge_ray(packed, n_chips, u1, step, d, cos[r, i1:n], sin[r, i1:n], a[r], s_re[i1:n], s_im[i1:n])
            a[last], a[last + 1] = 0, 0  # the sum already contains all paths
        slope, curve = np.float32(2 * np.pi * doppler_rate * tm * dt), np.float32(np.pi * doppler_rate * dt * dt)
        part = x[2 * b0 : 2 * (b0 + n)]
        _add_turned(window, fraction, shift, cos, sin, a, last, s_re, s_im, places, slope, curve, part)


@njit(cache=True, nogil=True)
def add_paths(x, packed, n_chips, delays, amplitudes, ray_hz, t0, dt, code_rate, code_rate_rate, if_hz, doppler_rate):
    """Add all paths of one signal to samples, in groups of paths whose delays lie within one chip window.

    Parameters
    ----------
    x
        float32[2 · n_samples], samples with alternating real and imaginary parts.
    packed, n_chips
        Packed chips, and the number of chips; there is no signal before the first and after the last chip.
    delays
        float64[n_rays]: delay of each path in chips, positive if later.
    amplitudes, ray_hz
        complex128[n_rays]: amplitude of each path at the start of the code; float64[n_rays]: Doppler in Hz of each path
        relative to the signal.
    t0, dt
        Time in s from the start of the code to the first sample, and sampling interval in s.
    code_rate, code_rate_rate
        Received chip rate in chips/s at the start of the code, and its rate of change in chips/s².
    if_hz, doppler_rate
        Carrier frequency in the samples at the start of the code in Hz, and its rate of change in Hz/s.
    """
    order = np.argsort(delays, kind="mergesort")  # `mergesort` is a stable sort
    first = 0
    while first < order.size:
        last = first + 1
        while last < order.size and delays[order[last]] - delays[order[first]] <= 2 * WINDOW_REACH_CHIPS:
            last += 1
        group = order[first:last]
        _add_group(
            x,
            packed,
            n_chips,
            delays[group],
            amplitudes[group],
            ray_hz[group],
            t0,
            dt,
            code_rate,
            code_rate_rate,
            if_hz,
            doppler_rate,
        )
        first = last
