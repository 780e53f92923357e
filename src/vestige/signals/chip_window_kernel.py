"""Chip of every sample by chip windows and fixed-point code phase, to make and to correlate samples.

Theory of operation
-------------------
**Packed chips.** A code is packed into one bit a chip, 32 to a word; a set bit means −1. A window is 32 consecutive
chips. Shifting it left by s brings its chip s into the sign bit; that bit, XORed into a float32, multiplies it by the
chip.

**One window for eight samples.** Eight samples at half the chip rate or more meet at most 15 chips, so that one window
holds the chips of all eight at every delay within `WINDOW_REACH_CHIPS` of a common middle. A window stays in the order
of its words: chip c stands at place c mod 32, and the shift is the code phase modulo 32 chips. So nothing is looked up
sample by sample, unless the sampling rate is less than half the chip rate: then each sample has a window of its own.

**Fixed-point code phase.** A block of samples starts from float64; inside it the phase is an integer with 40 fraction
bits, so that 1000 steps add up to an error below 1e-9 chip. Modulo 32 chips and cut to 27 fraction bits, it is added to
the delay's (`window_delay`), and its five upper bits are the shift. A chip edge is met within 2^-27 chip (0.4 µm): a
plain double loop in float64 finds the same chip at every sample.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np
from jaxtyping import Int8, UInt32

from vestige.kernel_cache import njit

GROUP = 8  # samples that share a window
PAD = 32  # places before the first chip in packed chips; there are as many behind the last
WINDOW_REACH_CHIPS = 8.0  # farthest delay from the middle: with 15 chips of a group, 31 of a window's 32
FRACTION_BITS = 27  # bits of a delay; five bits are left for 32 chips
_LEAD = 8  # chips in a window before that of a group's first sample
_PHASE_BITS = 40  # fraction bits of the code phase


@njit(inline="always")
def bits_of(value):
    """Return the bits of a float32 as int32."""
    return np.float32(value).view(np.int32)


@njit(inline="always")
def float_of(bits):
    """Return the float32 that has the bits of an int32."""
    return np.int32(bits).view(np.float32)


def packed_chips(chips: Int8[np.ndarray, " n"]) -> UInt32[np.ndarray, " n_words"]:
    """Return chips as bits: chip i is bit 31 − i mod 32 of word 1 + ⌊i / 32⌋, +1 where there is no chip."""
    packed = np.packbits(chips < 0)
    words = np.zeros((chips.size + 2 * PAD) // 32 + 3, ">u4")
    words.view(np.uint8)[PAD // 8 : PAD // 8 + packed.size] = packed
    return words.astype(np.uint32)


def chip_windows(chips: Int8[np.ndarray, " n"]) -> UInt32[np.ndarray, " n_windows"]:
    """Return n + 64 windows at least: window i + PAD holds chips i … i + 31, the first in its sign bit."""
    return _windows(packed_chips(chips))


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
    """Return −delay (chips from the middle, within WINDOW_REACH_CHIPS) as fixed point, modulo 32 chips."""
    return np.uint32(np.int64(np.round(-delay * 2.0**FRACTION_BITS)))


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
def _fixed(u0, step):
    """Return code phase and step as fixed point, and the whole chips before that phase."""
    base = np.floor(u0)
    return (
        np.int64(np.round((u0 - base) * 2.0**_PHASE_BITS)),
        np.int64(np.round(step * 2.0**_PHASE_BITS)),
        np.int64(base),
    )


@njit(inline="always")
def _window(packed, phase):
    """Return the window of a fixed-point code phase, in the order of its words."""
    lead = (phase >> _PHASE_BITS) - _LEAD
    word, place = lead >> 5, lead & 31
    early, late = packed[word], packed[word + 1]
    return np.uint32(late ^ np.uint32(np.uint32(early ^ late) & np.uint32(np.uint32(0xFFFFFFFF) >> np.uint32(place))))


@njit(cache=True, nogil=True)
def fill_windows(packed, u0, step, n, window, fraction):
    """Fill window and fraction of n consecutive samples.

    Parameters
    ----------
    packed
        `packed_chips` of the code.
    u0, step
        Code phase of the first sample and its step, in chips; all phases lie in the code.
    window, fraction
        uint32[m], m a multiple of GROUP that is not less than n:
        `window[i] << ((fraction[i] + window_delay(d)) >> FRACTION_BITS)` has in its sign bit the chip of sample i at a
        delay of d chips.
    """
    p0, dp, base = _fixed(u0, step)
    p0 += (base + PAD) << _PHASE_BITS
    for i in range(n):
        fraction[i] = np.uint32((p0 + i * dp) >> (_PHASE_BITS - FRACTION_BITS))
    if dp <= 2 << _PHASE_BITS:
        for first in range(0, n, GROUP):
            ring = _window(packed, p0 + first * dp)
            for i in range(GROUP):
                window[first + i] = ring
    else:
        for i in range(n):
            window[i] = _window(packed, p0 + i * dp)


@njit(cache=True, nogil=True)
def fill_chip_numbers(u0, step, chip):
    """Fill int32[n] with the chip that each of consecutive samples meets at no delay."""
    p0, dp, base = _fixed(u0, step)
    for i in range(chip.size):  # AVX2 shifts signed 64-bit numbers only one by one
        chip[i] = np.int32(np.int32(np.uint64(p0 + i * dp) >> np.uint64(_PHASE_BITS)) + np.int32(base))
