"""The compiled inner loops of the correlator.

**Chip windows.** `chip_windows` packs the code into one uint32 a chip: 32 consecutive chips, bit 31 being the chip that
lies `LEAD` chips earlier. Shifting the window left by s brings chip (j − LEAD + s) into the sign bit. So one gather a
sample serves every tap of the bank.

**Fixed-point code phase.** Each block of 1024 samples starts from float64; inside it the phase is an int64 with 40
fraction bits. The part after the chip, cut to 26 bits and added to the tap's offset, gives the shift. A chip edge is
met within 2^-26 chip (1 µm), so that a brute-force double loop gives the same chips.

**Carrier.** One rotator table for the whole bank, from float64; the phase at the middle of each block is applied to the
block's sums in float64, and a Doppler rate enters there and as a first-order turn inside the block (1e-8 at 100 Hz/s).

Sums run in float32 inside a block and in float64 over blocks. The few samples at both ends, where some taps meet a chip
of the segment and others do not, are handled one by one.
"""

from __future__ import annotations

import numpy as np
from numba import njit

BLOCK = 1024
LEAD = 16  # chips before the current one in a window
REACH_CHIPS = 8.0  # farthest tap from the middle of the bank
_FRACTION = 40  # fraction bits of the code phase in a block
_TAP_FRACTION = 26  # fraction bits of a tap's offset; LEAD + REACH and the fraction fit 31 bits


@njit(cache=True, nogil=True)
def chip_windows(chips):
    """Return uint32[n_chips + 64]: window i + 32 holds chips i − LEAD … i − LEAD + 31, most significant first."""
    n = chips.size
    windows = np.empty(n + 64, np.uint32)
    word = np.uint32(0)
    for i in range(-32, n + 32):
        j = i - LEAD + 31  # the chip that enters at bit 0
        bit = np.uint32(1) if 0 <= j < n and chips[j] < 0 else np.uint32(0)
        word = np.uint32((word << np.uint32(1)) | bit)
        windows[i + 32] = word
    # The first 31 windows lack the chips that never entered; no sample uses them, because all earlier chips are none.
    return windows


@njit(cache=True, nogil=True, fastmath=True)
def _tap_sums(w, fraction, y_re, y_im, delay, n):
    """Return the block sum of one tap: Σ ±y with the sign bit of each sample's shifted window."""
    s_re, s_im = np.float32(0.0), np.float32(0.0)
    for i in range(n):
        shift = np.uint32(np.uint32(fraction[i] + delay) >> np.uint32(_TAP_FRACTION))
        bit = np.uint32(np.uint32(w[i] << shift) >> np.uint32(31))
        sign = np.float32(1.0) - np.float32(2.0) * np.float32(np.int32(bit))
        s_re += sign * y_re[i]
        s_im += sign * y_im[i]
    return s_re, s_im


@njit(cache=True, nogil=True, fastmath=True)
def _wipe(x, rotator, slope, curve, y_re, y_im, first, n):
    """Turn n samples by the conjugate rotator and the small angle slope · k + curve · k², k from the block's middle."""
    for i in range(n):
        a, b = x[first + i, 0], x[first + i, 1]
        re = a * rotator[i, 0] + b * rotator[i, 1]
        im = b * rotator[i, 0] - a * rotator[i, 1]
        k = np.float32(i - BLOCK // 2)
        turn = k * (slope + curve * k)
        y_re[i] = re + im * turn
        y_im[i] = im - re * turn


@njit(cache=True, nogil=True)
def _phases(windows, u0, du, w, fraction, chip, n):
    """Fill window, fraction and chip number of n samples from code phase u0 and step du (chips)."""
    base = np.floor(u0)
    j0 = np.int64(base) + 32
    p0 = np.int64(np.round((u0 - base) * 2.0**_FRACTION))
    dp = np.int64(np.round(du * 2.0**_FRACTION))
    for i in range(n):
        p = p0 + i * dp
        j = j0 + (p >> _FRACTION)
        chip[i] = np.int32(j - 32)
        w[i] = windows[j]
        fraction[i] = np.uint32((p & ((1 << _FRACTION) - 1)) >> (_FRACTION - _TAP_FRACTION))


@njit(cache=True, nogil=True)
def correlate_block(x, chips, windows, offsets, t0, dt, code_rate, code_rate_rate, if_hz, doppler_rate):
    """Return (taps complex128[n_taps], Σ_j |y_j|²), both not normalised.

    Parameters
    ----------
    x
        float32[n_samples, 2].
    chips, windows
        int8[n_chips] of ±1 and their `chip_windows`.
    offsets
        float64[n_taps] in chips, later is positive, within REACH_CHIPS of their mean.
    t0, dt
        Time of the first sample after the start of the code, and the sampling interval, in s.
    code_rate, code_rate_rate
        Received chips/s at the start of the code, and its rate of change in chips/s².
    if_hz, doppler_rate
        Carrier frequency in the samples at the start of the code in Hz, and its rate of change in Hz/s.
    """
    n_samples, n_taps, n_chips = x.shape[0], offsets.size, chips.size
    out = np.zeros(n_taps, np.complex128)
    middle = offsets.mean()
    delays = np.empty(n_taps, np.uint32)
    for k in range(n_taps):
        # floor(u − d) = floor(u − middle) and the rest: the window's lead keeps the sum positive
        delays[k] = np.uint32(np.int64(np.round((LEAD - (offsets[k] - middle)) * 2.0**_TAP_FRACTION)))
    rotator = np.empty((BLOCK, 2), np.float32)
    for i in range(BLOCK):
        angle = 2 * np.pi * if_hz * dt * (i - BLOCK // 2)
        rotator[i, 0], rotator[i, 1] = np.cos(angle), np.sin(angle)

    w, fraction, chip = np.empty(BLOCK, np.uint32), np.empty(BLOCK, np.uint32), np.empty(BLOCK, np.int32)
    y_re, y_im = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    reach = max(offsets.max() - middle, middle - offsets.min())
    chip_power, held_re, held_im, held = 0.0, 0.0, 0.0, np.int32(-1)

    b0 = 0
    while b0 < n_samples:
        n = min(BLOCK, n_samples - b0)
        t = t0 + b0 * dt
        tm = t + (BLOCK // 2) * dt
        step = (code_rate + code_rate_rate * tm) * dt
        u0 = code_rate * t + 0.5 * code_rate_rate * t * t - middle
        slope, curve = 2 * np.pi * doppler_rate * tm * dt, np.pi * doppler_rate * dt * dt
        _wipe(x, rotator, np.float32(slope), np.float32(curve), y_re, y_im, b0, n)
        phase = 2 * np.pi * ((if_hz * tm) % 1.0 + (0.5 * doppler_rate * tm * tm) % 1.0)
        turn = np.cos(phase) - 1j * np.sin(phase)
        _phases(windows, u0, step, w, fraction, chip, n)
        if u0 - reach >= 0.0 and u0 + step * n + reach < n_chips:
            for k in range(n_taps):
                re, im = _tap_sums(w, fraction, y_re, y_im, delays[k], n)
                out[k] += (re + 1j * im) * turn
        else:
            _edge_sums(chips, u0, step, offsets - middle, y_re, y_im, n, turn, out)
        for i in range(n):  # chip sums for the noise floor; magnitudes only, so the block's phase does not matter
            if chip[i] != held:
                chip_power += held_re * held_re + held_im * held_im
                held_re, held_im, held = 0.0, 0.0, chip[i]
            if 0 <= chip[i] < n_chips:
                z = (y_re[i] + 1j * y_im[i]) * turn
                held_re += z.real
                held_im += z.imag
        b0 += n
    return out, chip_power + held_re * held_re + held_im * held_im


@njit(cache=True, nogil=True)
def _edge_sums(chips, u0, step, offsets, y_re, y_im, n, turn, out):
    """Add a block at an end of the segment, where each tap has its own first or last sample."""
    for k in range(offsets.size):
        total = 0.0 + 0.0j
        for i in range(n):
            j = np.int64(np.floor(u0 + i * step - offsets[k]))
            if 0 <= j < chips.size:
                total += chips[j] * (y_re[i] + 1j * y_im[i])
        out[k] += total * turn
