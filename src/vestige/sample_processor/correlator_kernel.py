"""Compute the correlators and the noise floor in compiled loops.

**Taps.** All taps of the bank use the same chip windows and the same fixed-point code phase
(`vestige.signals.chip_window_kernel`). So each tap needs only a shift and a multiplication by ±1 for each sample. Two
taps are summed in one loop, because loading a sample takes as long as multiplying the sample.

**Carrier.** All taps use the same table of carrier rotations, computed in float64. The phase at the middle of each
block is applied to the block's sums in float64. This phase includes the Doppler rate. Inside the block, the samples are
rotated by the Doppler rate to first order, with a relative error of 1e-7 at 100 Hz/s.

**Noise floor.** Σ_j |y_j|² over chips is Σ_n |y_n|² over samples, plus twice the real part of y_n y*_(n−l) for all
samples n and n − l in the same chip. So no loop over chips is needed. Two lags l are summed in one loop. The last
samples of a block are stored for the next block, rotated to the phase of the next block.

Sums are float32 inside a block of 1024 samples and float64 over blocks. At an end of the segment, a sample may lie
inside the segment of one tap and outside the segment of another tap. The few samples at the ends are processed
individually.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np

from vestige.kernel_cache import njit
from vestige.signals.chip_window_kernel import (
    FRACTION_BITS,
    WINDOW_REACH_CHIPS,
    chip_at,
    chip_of,
    fill_fractions,
    fill_windows,
    interior,
    phase_apart,
    window_delay,
)
from vestige.signals.rotator_kernel import BLOCK, MIDDLE, from_middle, rotator_table, turn_at

_IN_CHIP = (1 << FRACTION_BITS) - 1  # mask of the bits of a fixed-point code phase that give the phase in the chip
REACH_CHIPS = WINDOW_REACH_CHIPS  # largest distance of a tap from the middle of the bank


@njit(cache=True, nogil=True, fastmath=True)
def _two_tap_sums(window, fraction, y_re, y_im, delay_1, delay_2):
    """Return the sums Σ ±y of one block for two taps: real and imaginary part of the first tap, then of the second."""
    re_1, im_1 = np.float32(0.0), np.float32(0.0)
    re_2, im_2 = np.float32(0.0), np.float32(0.0)
    for i in range(y_re.size):
        re, im = y_re[i], y_im[i]
        chip_1, chip_2 = chip_of(window[i], fraction[i], delay_1), chip_of(window[i], fraction[i], delay_2)
        re_1 += chip_1 * re
        im_1 += chip_1 * im
        re_2 += chip_2 * re
        im_2 += chip_2 * im
    return re_1, im_1, re_2, im_2


@njit(cache=True, nogil=True, fastmath=True)
def _tap_sum(window, fraction, y_re, y_im, delay):
    """Return the real and the imaginary part of the sum Σ ±y of one block for one tap."""
    total_re, total_im = np.float32(0.0), np.float32(0.0)
    for i in range(y_re.size):
        chip = chip_of(window[i], fraction[i], delay)
        total_re += chip * y_re[i]
        total_im += chip * y_im[i]
    return total_re, total_im


@njit(cache=True, nogil=True, fastmath=True)
def _wipe(x, cos, sin, places, slope, curve, y_re, y_im):
    """Remove the carrier and the small angle slope · k + curve · k² from samples; k counts from the block's middle."""
    for i in range(y_re.size):
        a, b = x[2 * i], x[2 * i + 1]
        re = a * cos[i] + b * sin[i]
        im = b * cos[i] - a * sin[i]
        k = places[i]
        turn = k * (slope + curve * k)
        y_re[i] = re + im * turn
        y_im[i] = im - re * turn


@njit(cache=True, nogil=True, fastmath=True)
def _two_lag_sums(own, fraction, y_re, y_im, apart_1, re_1, im_1, apart_2, re_2, im_2):
    """Return Σ_n `own` |y_n|² plus Re(y_n y*_(n−l)) for two lags l, where samples n and n − l lie in the same chip."""
    total, zero = np.float32(0.0), np.float32(0.0)
    for i in range(y_re.size):
        phase = np.uint32(fraction[i] & np.uint32(_IN_CHIP))
        same_1, same_2 = phase >= apart_1, phase >= apart_2
        re = own * y_re[i] + (re_1[i] if same_1 else zero) + (re_2[i] if same_2 else zero)
        im = own * y_im[i] + (im_1[i] if same_1 else zero) + (im_2[i] if same_2 else zero)
        total += y_re[i] * re + y_im[i] * im
    return total


@njit(cache=True, nogil=True)
def _edge_sums(packed, n_chips, u0, step, offsets, y_re, y_im, turn, out):
    """Add the samples at an end of the segment to each tap on its own; the first or last sample depends on the tap.

    u0 is the code phase of the first sample in chips, minus the middle of the bank. For the noise floor, a sample is
    set to 0 if it is outside the segment at the middle of the bank.
    """
    for k in range(offsets.size):
        total = 0.0 + 0.0j
        for i in range(y_re.size):
            j = np.int64(np.floor(u0 + i * step - offsets[k]))
            if 0 <= j < n_chips:
                total += chip_at(packed, j) * (y_re[i] + 1j * y_im[i])
        out[k] += total * turn
    for i in range(y_re.size):
        j = np.int64(np.floor(u0 + i * step))
        if not 0 <= j < n_chips:
            y_re[i], y_im[i] = 0.0, 0.0


@njit(cache=True, nogil=True)
def middle_chips(offsets):
    """Return the middle of a bank in chips, as a whole number if the middle is 0.5 chip or more from the prediction.

    The noise floor is the power of the sums of samples over chips. If the middle is a whole number of chips, these sums
    begin and end with the chips of the signal.
    """
    if offsets.size == 0:
        return 0.0
    mean = offsets.mean()
    return mean if abs(mean) < 0.5 else np.trunc(mean)


@njit(cache=True, nogil=True)
def bank_span(offsets):
    """Return the earliest tap, the middle of the bank and the latest tap in chips; 0 for a bank without taps."""
    if offsets.size == 0:
        return 0.0, 0.0, 0.0
    return offsets.min(), middle_chips(offsets), offsets.max()


@njit(cache=True, nogil=True)
def correlate_block(x, packed, n_chips, offsets, t0, dt, code_rate, code_rate_rate, if_hz, doppler_rate):
    """Return the taps, complex128[n_taps], and the noise power Σ_j |y_j|², both without normalization.

    Parameters
    ----------
    x
        float32[2 · n_samples], real and imaginary parts in turn.
    packed, n_chips
        Chips as packed bits, and number of chips.
    offsets
        float64[n_taps] in chips, positive is later, within REACH_CHIPS of `middle_chips`.
    t0, dt
        Time of the first sample minus the start of the code, and the sampling interval, in s.
    code_rate, code_rate_rate
        Received chip rate at the start of the code in chips/s, and the change of this rate in chips/s².
    if_hz, doppler_rate
        Carrier frequency in the samples at the start of the code in Hz, and the change of this frequency in Hz/s.
    """
    n_samples, n_taps = x.size // 2, offsets.size
    middle = middle_chips(offsets)
    around = offsets - middle
    reach = np.abs(around).max() if n_taps else 0.0
    out = np.zeros(n_taps, np.complex128)
    cos, sin = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    rotator_table(if_hz * dt, cos, sin)
    places = from_middle()

    # A chip has at most lags + 1 samples. Arrays of samples begin with `lags` samples of the previous block. `lags` is
    # rounded up to an even number, because two lags are summed together. The additional lag adds nothing to the sum,
    # because no two samples of a chip are so far apart.
    lags = 2 * max(np.int64(1), np.int64(np.ceil((1.0 / (code_rate * dt) - 1.0 + 1e-3) / 2)))
    window, fraction = np.empty(BLOCK, np.uint32), np.empty(BLOCK, np.uint32)
    y_re, y_im = np.zeros(lags + BLOCK, np.float32), np.zeros(lags + BLOCK, np.float32)
    chip_power, turn = 0.0, 1.0 + 0.0j

    for b0 in range(0, n_samples, BLOCK):
        n = min(BLOCK, n_samples - b0)
        t = t0 + b0 * dt
        tm = t + MIDDLE * dt
        step = (code_rate + code_rate_rate * tm) * dt
        u0 = code_rate * t + 0.5 * code_rate_rate * t * t - middle
        before, turn = turn, np.conj(turn_at(if_hz, doppler_rate, tm))
        for i in range(lags):
            z = (y_re[BLOCK + i] + 1j * y_im[BLOCK + i]) * before * np.conj(turn)
            y_re[i], y_im[i] = z.real, z.imag

        slope, curve = 2 * np.pi * doppler_rate * tm * dt, np.pi * doppler_rate * dt * dt
        yr, yi, f = y_re[lags : lags + n], y_im[lags : lags + n], fraction[:n]
        _wipe(x[2 * b0 : 2 * (b0 + n)], cos, sin, places, np.float32(slope), np.float32(curve), yr, yi)
        fill_fractions(u0, step, f)
        i0, i1 = interior(u0, step, reach, n_chips, n)
        if i1 > i0:
            w, g, zr, zi = window[: i1 - i0], f[i0:i1], yr[i0:i1], yi[i0:i1]
            fill_windows(packed, u0 + i0 * step, step, i1 - i0, window)
            for k in range(1, n_taps, 2):
                delays = window_delay(around[k - 1]), window_delay(around[k])
                re_1, im_1, re_2, im_2 = _two_tap_sums(w, g, zr, zi, *delays)
                out[k - 1] += (re_1 + 1j * im_1) * turn
                out[k] += (re_2 + 1j * im_2) * turn
            if n_taps % 2:
                re, im = _tap_sum(w, g, zr, zi, window_delay(around[-1]))
                out[-1] += (re + 1j * im) * turn
        if i0 > 0:
            _edge_sums(packed, n_chips, u0, step, around, yr[:i0], yi[:i0], turn, out)
        if i1 < n:
            _edge_sums(packed, n_chips, u0 + i1 * step, step, around, yr[i1:], yi[i1:], turn, out)

        for lag in range(1, lags, 2):
            own = np.float32(0.5 if lag == 1 else 0.0)
            a, b = lags - lag, lags - lag - 1
            near = phase_apart(step, lag), y_re[a : a + n], y_im[a : a + n]
            far = phase_apart(step, lag + 1), y_re[b : b + n], y_im[b : b + n]
            chip_power += 2 * _two_lag_sums(own, f, yr, yi, *near, *far)
    return out, chip_power
