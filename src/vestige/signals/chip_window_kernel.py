"""Which chip every sample meets: chip windows and fixed-point code phase, to make and to correlate samples.

Theory of operation
-------------------
**Chip windows.** `chip_windows` packs a code into one uint32 a chip: 32 consecutive chips, bit 31 being the chip that
lies `LEAD` chips earlier, a set bit meaning −1. Shifting the window left by s brings chip (j − LEAD + s) into the sign
bit; that bit, XORed into a float32, multiplies it by the chip. So one look-up a sample serves every ray or correlator
within `REACH_CHIPS` of a common middle.

**Fixed-point code phase.** A block of samples starts from float64; inside it the phase is an integer with 40 fraction
bits, so that 1000 steps add up to an error below 1e-9 chip. The part after the chip, cut to 27 bits, is added to the
delay's (`window_delay`), and its five upper bits are the shift. A chip edge is met within 2^-27 chip (0.4 µm): a plain
double loop in float64 finds the same chip at every sample.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np
from jaxtyping import Int8, UInt32
from numba import njit

LEAD = 16  # chips before the current one in a window
WINDOW_REACH_CHIPS = 15.0  # farthest delay from the middle: LEAD ± REACH and the fraction lie within 0 … 32
FRACTION_BITS = 27  # of a delay; five bits are left for 32 chips
_PHASE_BITS = 40  # fraction bits of the code phase
_PAD = 32  # windows before the first and behind the last chip


@njit(inline="always")
def bits_of(value):
    """Return the bits of a float32 as int32."""
    return np.float32(value).view(np.int32)


@njit(inline="always")
def float_of(bits):
    """Return the float32 that has the bits of an int32."""
    return np.int32(bits).view(np.float32)


def chip_windows(chips: Int8[np.ndarray, " n"]) -> UInt32[np.ndarray, " n_windows"]:
    """Return n + 64 windows at least: window i + 32 holds chips i − LEAD … i − LEAD + 31, +1 where there is no chip."""
    lead = (_PAD + LEAD) // 8
    packed = np.packbits(chips < 0)
    words = np.zeros((chips.size + 2 * _PAD) // 32 + 3, ">u4")
    words.view(np.uint8)[lead : lead + packed.size] = packed
    return _windows(words.astype(np.uint32))


@njit(cache=True, nogil=True)
def _windows(words):
    windows = np.empty(32 * (words.size - 1), np.uint32)
    for k in range(words.size - 1):
        pair = np.uint64((np.uint64(words[k]) << np.uint64(32)) | np.uint64(words[k + 1]))
        part = windows[32 * k : 32 * k + 32]
        for s in range(32):
            part[s] = np.uint32(pair >> np.uint64(32 - s))
    return windows


@njit(cache=True, nogil=True)
def window_delay(delay):
    """Return LEAD − delay (chips from the middle, within REACH_CHIPS) as fixed point."""
    return np.uint32(np.int64(np.round((LEAD - delay) * 2.0**FRACTION_BITS)))


@njit(cache=True, nogil=True)
def interior(u0, step, reach, n_chips, n):
    """Return (i0, i1): of n samples with code phase u0 + i · step, those that meet a chip at all delays within ±reach.

    The range may be a sample short at either end; then the plain loops at the edges take it.
    """
    i0 = max(0, min(n, np.int64(np.ceil((reach - u0) / step)) + 1)) if u0 < reach else np.int64(0)
    i1 = n
    if u0 + step * n + reach >= n_chips:
        i1 = min(n, np.int64(np.floor((n_chips - reach - u0) / step)) - 1)
    return i0, max(i0, i1)


@njit(cache=True, nogil=True)
def fill_windows(windows, u0, step, window, fraction, chip):
    """Fill window, fraction and chip number of consecutive samples.

    Parameters
    ----------
    windows
        `chip_windows` of the code.
    u0, step
        Code phase of the first sample and its step, in chips; all phases lie in the code.
    window, fraction
        uint32[n]: `window[i] << ((fraction[i] + window_delay(d)) >> FRACTION_BITS)` has in its sign bit the chip of
        sample i at a delay of d chips.
    chip
        int32[n], the chip at no delay.
    """
    base = np.floor(u0)
    near = windows[np.int64(base) + _PAD :]
    first = np.int32(base)
    p0 = np.int64(np.round((u0 - base) * 2.0**_PHASE_BITS))
    dp = np.int64(np.round(step * 2.0**_PHASE_BITS))
    for i in range(chip.size):
        p = p0 + i * dp
        chip[i] = np.int32(p >> _PHASE_BITS)
        fraction[i] = np.uint32((p >> (_PHASE_BITS - FRACTION_BITS)) & ((1 << FRACTION_BITS) - 1))
    for i in range(chip.size):
        window[i] = near[np.uint32(chip[i])]
    for i in range(chip.size):
        chip[i] += first
