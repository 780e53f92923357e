"""Find the chip at every sample with chip windows and a fixed-point code phase, to make and to correlate samples.

Theory of operation
-------------------
**Packed chips.** A code is packed into one bit per chip, 32 chips to a word (`vestige.records.packed_chips`). A bit 1
means the chip −1. A window is 32 consecutive chips. Bit 0 is the sign bit, and a left shift by s brings bit s into the
sign bit. The sign bit and the bits of 1.0 together are the chip as a float32 (`chip_of`).

**One window for many samples.** A window has the chips of a group of samples, which lie in at most 15 chips. The window
is valid for every delay within `WINDOW_REACH_CHIPS` of a common middle. At about 2.2 or more samples per chip, 32
samples use one window. At 0.5 to about 2.2 samples per chip, eight samples use one window. At lower sampling rates each
sample has its own window. Each chip of a window keeps its bit position in the packed word. Chip c is bit c mod 32, and
the shift is the code phase modulo 32, in whole chips. So the shift does not depend on where the window begins.

**Fixed-point code phase.** The phase at the start of a block is a float64. Inside the block the phase is an integer
with 40 fraction bits, so the error of 1000 steps stays below 1e-9 chip. The phase, modulo 32 chips and cut to 27
fraction bits, is added to the phase of the delay (`window_delay`). The five upper bits of the sum are the shift. The
error of a chip edge is less than 2^-26 chip (0.9 µm on E6, 4.4 µm on E1). A loop over the samples with a float64 code
phase finds the same chip, except at samples within 2^-26 chip of an edge. Two samples lie in the same chip if the phase
of the later sample in its chip is at least `phase_apart`.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from vestige.kernel_cache import njit
from vestige.records.packed_chips import PAD
from vestige.signals.float_kernel import float_of
from vestige.signals.rotator_kernel import BLOCK

GROUP = 32  # largest number of samples with the same window; the length of `window` is a multiple of this number
_SMALL_GROUP = 8
# largest distance in chips from the first to the last sample of a group; the samples of a group lie in at most 15 chips
_GROUP_SPAN = 14
# largest distance in chips of a delay from the middle of the delays; a group needs at most 8 + 15 + 8 chips of a window
WINDOW_REACH_CHIPS = 8.0
FRACTION_BITS = 27  # number of fraction bits of a delay; the five bits above the fraction count 32 chips
_SIGN, _ONE = 0x80000000, 0x3F800000  # sign bit of a float32, and the bits of 1.0
_LEAD = 8  # number of chips in a window before the chip of the group's first sample
_PHASE_BITS = 40  # number of fraction bits of the code phase
_CUT_BITS = _PHASE_BITS - FRACTION_BITS
# Numbers of the samples in a block. A loop counter in place of this array would be compiled to 64-bit sums, which take
# twice as long as 32-bit sums.
_NUMBERS = np.arange(BLOCK, dtype=np.uint32)


@njit(inline="always")
def chip_at(packed, j):
    """Return chip number j, ±1 as int8, of packed chips."""
    word = np.int64(packed[np.int64(j + PAD) >> 5])
    return np.int8(1 - 2 * ((word >> (31 - (j & 31))) & 1))


@njit(inline="always")
def chip_of(window, fraction, delay):
    """Return the chip of a sample at a delay, as +1.0 or −1.0; `delay` is a result of `window_delay`."""
    shift = np.uint32(np.uint32(fraction + delay) >> np.uint32(FRACTION_BITS))
    return float_of(np.int32(np.uint32(np.uint32(np.uint32(window << shift) & np.uint32(_SIGN)) | np.uint32(_ONE))))


@njit(cache=True, nogil=True)
def window_delay(delay):
    """Return −`delay` as a fixed-point number modulo 32 chips; `delay` is in chips, at most ±WINDOW_REACH_CHIPS."""
    return np.uint32(np.int64(np.round(-delay * 2.0**FRACTION_BITS)))


@njit(cache=True, nogil=True)
def interior(u0, step, reach, n_chips, n):
    """Return the limits (i0, i1) of the samples that lie within the code at all delays within ±`reach` chips.

    Sample i of n has the code phase u0 + i · step. The limits may omit one or two samples at each end, although these
    samples lie within the code. The caller processes the samples outside the limits with a plain loop.
    """
    i0 = max(0, min(n, np.int64(np.ceil((reach - u0) / step)) + 1)) if u0 < reach else np.int64(0)
    i1 = n
    if u0 + step * n + reach >= n_chips:
        i1 = min(n, np.int64(np.floor((n_chips - reach - u0) / step)) - 1)
    return i0, max(i0, i1)


@njit(cache=True, nogil=True)
def _fixed(u0, step):
    """Return as integers the fraction of the code phase, the step, and the number of whole chips of the code phase."""
    base = np.floor(u0)
    return (
        np.int64(np.round((u0 - base) * 2.0**_PHASE_BITS)),
        np.int64(np.round(step * 2.0**_PHASE_BITS)),
        np.int64(base),
    )


@njit(inline="always")
def _window(packed, phase):
    """Return the window of a fixed-point code phase, with each chip at its bit position in the packed word."""
    lead = (phase >> _PHASE_BITS) - _LEAD
    word, place = np.uint64(lead >> 5), lead & 31  # `word` is unsigned: numba does not test for a negative index
    early, late = packed[word], packed[word + np.uint64(1)]
    return np.uint32(late ^ np.uint32(np.uint32(early ^ late) & np.uint32(np.uint32(0xFFFFFFFF) >> np.uint32(place))))


def _store_copies(_context, array, first, value):
    if (array.dtype, first, value) != (types.uint32, types.uint64, types.uint32):
        return None  # None makes numba report that the operation does not exist for these types

    def code(context, builder, signature, arguments):
        copies = ir.VectorType(ir.IntType(32), GROUP)
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        lanes = ir.VectorType(ir.IntType(32), GROUP)(None)  # every copy takes lane 0
        one = builder.insert_element(ir.Constant(copies, ir.Undefined), arguments[2], ir.IntType(32)(0))
        place = builder.bitcast(builder.gep(data, [arguments[1]]), copies.as_pointer())
        builder.store(builder.shuffle_vector(one, one, lanes), place, align=4)
        return context.get_dummy_value()

    return types.none(array, first, value), code


# `_copy_to_group(array, first, value)` stores GROUP copies of a uint32 in an array of uint32, from element `first` on.
# `_copy_to_group` uses vector instructions and is for compiled code only. The compiler turns a loop of GROUP steps into
# single stores, which take four times as long.
_copy_to_group: Any = intrinsic(_store_copies)


@njit(cache=True, nogil=True)
def _fill_small_groups(packed, phase, step, n, group, window):
    """Fill the windows of n samples, with one window for every `group` consecutive samples."""
    for g in range(np.uint64((n + group - 1) // group)):
        shared = _window(packed, phase)
        phase += group * step
        for i in range(np.uint64(group)):
            window[g * np.uint64(group) + i] = shared


@njit(cache=True, nogil=True)
def fill_windows(packed, u0, step, n, window):
    """Fill the windows of n consecutive samples.

    Parameters
    ----------
    packed
        Chips of the code as `packed_chips` returns them.
    u0, step
        Code phase of the first sample, and step of the code phase from sample to sample, in chips. All samples lie in
        the code.
    window
        uint32[m]: array for the windows; m is a multiple of GROUP and not less than n. The sign bit of `window[i] <<
        ((fraction[i] + window_delay(d)) >> FRACTION_BITS)` is the chip of sample i at a delay of d chips
        (`fill_fractions`).
    """
    phase, dp, base = _fixed(u0, step)
    phase += (base + PAD) << _PHASE_BITS
    if (GROUP - 1) * dp <= _GROUP_SPAN << _PHASE_BITS:
        for g in range(np.uint64((n + GROUP - 1) // GROUP)):
            _copy_to_group(window, g * np.uint64(GROUP), _window(packed, phase))
            phase += GROUP * dp
    else:
        group = _SMALL_GROUP if (_SMALL_GROUP - 1) * dp <= _GROUP_SPAN << _PHASE_BITS else 1
        _fill_small_groups(packed, phase, dp, n, group, window)


@njit(cache=True, nogil=True)
def fill_fractions(u0, step, fraction):
    """Fill the fractions of consecutive samples: their code phases in units of 2^-27 chip, modulo 32 chips.

    Parameters
    ----------
    u0, step
        Code phase of the first sample, and step of the code phase from sample to sample, in chips.
    fraction
        uint32[n]: array for the fractions; n is at most BLOCK.
    """
    p0, dp, base = _fixed(u0, step)
    p0 += base << _PHASE_BITS
    # The loop computes ⌊(p0 + i dp) / 2^cut⌋ modulo 2³² with 32-bit sums. A vector holds twice as many 32-bit numbers
    # as 64-bit numbers. The lower parts have `cut` bits, so their sum over a block does not overflow.
    cut, lower = np.uint32(_CUT_BITS), np.uint32((1 << _CUT_BITS) - 1)
    high, low = np.uint32(p0 >> _CUT_BITS), np.uint32(np.uint32(p0) & lower)
    high_step, low_step = np.uint32(dp >> _CUT_BITS), np.uint32(np.uint32(dp) & lower)
    for i in range(fraction.size):
        k = _NUMBERS[i]
        carried = np.uint32(np.uint32(low + np.uint32(k * low_step)) >> cut)
        fraction[i] = np.uint32(high + np.uint32(k * high_step) + carried)


@njit(cache=True, nogil=True)
def phase_apart(step, lag):
    """Return the smallest phase in the chip at which a sample shares its chip with the sample `lag` samples before.

    The phase in the chip is the lower FRACTION_BITS bits of a fraction (`fill_fractions`). If a chip is shorter than
    the lag, the function returns 2^27, which is larger than any phase in the chip.
    """
    apart = (lag * np.int64(np.round(step * 2.0**_PHASE_BITS)) + (1 << _CUT_BITS) - 1) >> _CUT_BITS
    return np.uint32(min(apart, 1 << FRACTION_BITS))
