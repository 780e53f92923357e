"""Sum samples into half chips, the first step of the hand-over search and of the exhaustive search in E6.

A sample taken t after the start of the code lies at code phase u(t) = R t + ½ Ṙ t². R is the received chip rate at the
start of the code, and Ṙ is the rate of change of R. The carrier is removed from the sample, and the sample is added to
half chip ⌊2u⌋. The correlator at a delay of any multiple of half a chip is then a signed sum of the half chips. The
signed sum agrees with the sum over samples in `vestige.sample_processor.correlator`, because both computations assign a
sample to the same chip.

Phases of code and carrier are computed in float64 for each block of 1024 samples. Inside a block the code phase is an
integer with 40 fraction bits, and the carrier is a table.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np

from vestige.kernel_cache import njit
from vestige.signals.rotator_kernel import BLOCK, MIDDLE, from_middle, rotator_table, turn_at

_PHASE_BITS = 40
_UNSIGNED_BITS = np.uint64(_PHASE_BITS)


@njit(cache=True, nogil=True, fastmath=True)
def _wipe(x, cos, sin, places, turn_re, turn_im, slope, curve, y_re, y_im):
    """Remove the carrier, the block's phase and the angle slope · k + curve · k² from each sample.

    k is the number of the sample, counted from the middle of the block.
    """
    for i in range(y_re.size):
        a, b = x[2 * i], x[2 * i + 1]
        re = a * cos[i] + b * sin[i]
        im = b * cos[i] - a * sin[i]
        k = places[i]
        angle = k * (slope + curve * k)
        re, im = re + im * angle, im - re * angle
        y_re[i] = re * turn_re - im * turn_im
        y_im[i] = im * turn_re + re * turn_im


@njit(cache=True, nogil=True)
def half_chip_sums(x, t0, dt, code_rate, code_rate_rate, if_hz, doppler_rate, first_half, out_re, out_im):
    """Fill float32 `out_re`, `out_im` with the sums of the samples in half chips from `first_half` on.

    Parameters
    ----------
    x
        float32[2 · n_samples], real and imaginary parts in turn.
    t0, dt
        Time of the first sample after the start of half chip 0, and the sampling interval, in s.
    code_rate, code_rate_rate
        Received chip rate at t = 0 in chips/s, and the change of this rate in chips/s².
    if_hz, doppler_rate
        Carrier frequency in the samples at t = 0 in Hz, and the change of this frequency in Hz/s.
    first_half
        Number of the half chip in the first element of `out_re` and `out_im`.
    """
    out_re[:] = 0
    out_im[:] = 0
    n_samples, n_halves = x.size // 2, out_re.size
    cos, sin = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    y_re, y_im = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    rotator_table(if_hz * dt, cos, sin)
    places = from_middle()
    for b0 in range(0, n_samples, BLOCK):
        n = min(BLOCK, n_samples - b0)
        t = t0 + b0 * dt
        tm = t + MIDDLE * dt
        turn = np.conj(turn_at(if_hz, doppler_rate, tm))
        slope, curve = 2 * np.pi * doppler_rate * tm * dt, np.pi * doppler_rate * dt * dt
        _wipe(
            x[2 * b0 : 2 * (b0 + n)],
            cos,
            sin,
            places,
            np.float32(turn.real),
            np.float32(turn.imag),
            np.float32(slope),
            np.float32(curve),
            y_re[:n],
            y_im[:n],
        )
        halves_per_sample = 2 * (code_rate + code_rate_rate * tm) * dt
        u0 = 2 * (code_rate * t + 0.5 * code_rate_rate * t * t)
        base = np.floor(u0)
        p = np.int64(np.round((u0 - base) * 2.0**_PHASE_BITS))
        dp = np.int64(np.round(halves_per_sample * 2.0**_PHASE_BITS))
        first = np.int64(base) - first_half
        if first >= 0 and first + ((p + n * dp) >> _PHASE_BITS) < n_halves:
            # the index is unsigned, because a signed index could count from the end
            start, phase, step = np.uint64(first), np.uint64(p), np.uint64(dp)
            for i in range(n):
                j = start + (phase >> _UNSIGNED_BITS)
                out_re[j] += y_re[i]
                out_im[j] += y_im[i]
                phase += step
        else:
            for i in range(n):
                j = first + (p >> _PHASE_BITS)
                if 0 <= j < n_halves:
                    out_re[j] += y_re[i]
                    out_im[j] += y_im[i]
                p += dp


@njit(cache=True, nogil=True, fastmath=True)
def chip_sums(halves, even, odd):
    """Fill `even` with h_2j + h_2j+1 and `odd` with h_2j+1 + h_2j+2, where h is `halves`, and return Σ even².

    Parameters
    ----------
    halves
        float32[2 · n + 1 or more], real or imaginary part of the half-chip sums.
    even
        float32[n], chips that begin at even half chips.
    odd
        float32[n], chips that begin at odd half chips; float32[0] if these chips are not needed.
    """
    total = 0.0
    for first in range(0, even.size, BLOCK):
        n = min(BLOCK, even.size - first)
        h, e, o = halves[2 * first :], even[first : first + n], odd[first : first + n]
        for j in range(n):
            e[j] = h[2 * np.uint32(j)] + h[2 * np.uint32(j) + 1]
        for j in range(o.size):
            o[j] = h[2 * np.uint32(j) + 1] + h[2 * np.uint32(j) + 2]
        power = np.float32(0.0)
        for j in range(n):
            power += e[j] * e[j]
        total += float(power)
    return total
