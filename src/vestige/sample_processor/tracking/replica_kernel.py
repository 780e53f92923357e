"""The compiled inner loops of a tracking channel: one code period of samples against the replicas of E1-C and E1-B.

Theory of operation
-------------------
**Correlators at whole samples.** An early or late correlator is the same replica, moved by some samples. So the replica
of each sample is made once and serves the whole bank. The distance of a correlator from the prompt is exactly known.

**Replica.** BOC(1,1) is a code of twice the rate: every chip is followed by its opposite. A window of 32 half chips and
the fixed-point code phase give the sign of a sample by one shift, without a look-up
(`vestige.signals.chip_window_kernel`). CBOC adds the six half cycles of BOC(6,1) in a half chip, from the same phase.
With BOC(1,1) the replicas of E1-C and E1-B are made together, because they share the shifts.

**Sums.** Two correlators are summed in one loop, because loading the samples takes as long as multiplying them.

**Carrier.** One rotator table serves the period. The phase of each block is applied to its sums, in float64.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np
from jaxtyping import Int8, UInt32

from vestige.kernel_cache import njit
from vestige.signals.chip_window_kernel import FRACTION_BITS, PAD, chip_windows, float_of
from vestige.signals.rotator_kernel import BLOCK, MIDDLE, rotator_table

HALF_CHIPS = 8184  # half chips in a code period of E1-B and E1-C
_MARGIN = 64  # half chips before and after the period for which there are windows
_AHEAD = _MARGIN + PAD  # index of the window that starts at half chip 0
_ONE = 0x3F800000  # bits of 1.0 as float32
_SIGN = 0x80000000
_WHOLE = float(1 << FRACTION_BITS)
_LOW, _HIGH = np.float32(np.sqrt(10 / 11)), np.float32(np.sqrt(1 / 11))  # amplitudes of CBOC [OS-ICD, 2.3.3]


def half_chip_windows(code: Int8[np.ndarray, " 4092"]) -> UInt32[np.ndarray, " n"]:
    """Return the windows of a primary code as BOC(1,1) half chips, periodic beyond both ends."""
    half = np.kron(code, np.array([1, -1], np.int8)).astype(np.int8)
    return chip_windows(np.concatenate((half[-_MARGIN:], half, half[: 2 * _MARGIN])))


@njit(cache=True, nogil=True, fastmath=True)
def _fill_boc(window, fraction, step, replica):
    """Fill a piece of at most 31 half chips with the BOC(1,1) replica, ±1."""
    for i in range(replica.size):
        shift = np.uint32(fraction + np.uint32(i) * step) >> np.uint32(FRACTION_BITS)
        sign = np.uint32(np.uint32(window << shift) & np.uint32(_SIGN))
        replica[i] = float_of(np.int32(sign | np.uint32(_ONE)))


@njit(cache=True, nogil=True, fastmath=True)
def _fill_two_boc(window_1, window_2, fraction, step, replica_1, replica_2):
    """Fill the same piece with the replicas of two codes."""
    for i in range(replica_1.size):
        shift = np.uint32(fraction + np.uint32(i) * step) >> np.uint32(FRACTION_BITS)
        sign_1 = np.uint32(np.uint32(window_1 << shift) & np.uint32(_SIGN))
        sign_2 = np.uint32(np.uint32(window_2 << shift) & np.uint32(_SIGN))
        replica_1[i] = float_of(np.int32(sign_1 | np.uint32(_ONE)))
        replica_2[i] = float_of(np.int32(sign_2 | np.uint32(_ONE)))


@njit(cache=True, nogil=True, fastmath=True)
def _fill_cboc(window, fraction, step, second_half, high, replica):
    """Fill a piece with CBOC; `high` is the signed amplitude of BOC(6,1), `second_half` is 1 in a second half chip."""
    for i in range(replica.size):
        phase = np.uint32(fraction + np.uint32(i) * step)
        shift = phase >> np.uint32(FRACTION_BITS)
        sign = np.uint32(np.uint32(window << shift) & np.uint32(_SIGN))
        inside = np.uint32(phase & np.uint32((1 << FRACTION_BITS) - 1))
        quick = np.int32(np.uint32(np.uint32(inside >> np.uint32(3)) * np.uint32(6)) >> np.uint32(FRACTION_BITS - 3))
        # BOC(1,1) changes its sign from one half of a chip to the other, BOC(6,1) starts each half alike
        odd = (quick + np.int32(shift) + second_half) & 1
        replica[i] = float_of(np.int32(sign | np.uint32(_ONE))) * (_LOW + high * np.float32(1 - 2 * odd))


@njit(cache=True, nogil=True)
def fill_replica(windows, phase, step, high, replica):
    """Fill the replica of consecutive samples.

    Parameters
    ----------
    windows
        `half_chip_windows` of the code.
    phase, step
        Code phase of the first sample and its step in half chips; at most 64 half chips outside the period.
    high
        Signed amplitude of the BOC(6,1) part; 0 for BOC(1,1).
    replica
        float32[n], filled.
    """
    piece = max(1, int(30.0 / step))
    fixed_step = np.uint32(np.round(step * _WHOLE))
    for first in range(0, replica.size, piece):
        at = phase + first * step
        base = np.floor(at)
        fraction = np.uint32((at - base) * _WHOLE)
        window = windows[np.int64(base) + _AHEAD]
        part = replica[first : first + piece]
        if high == 0.0:
            _fill_boc(window, fraction, fixed_step, part)
        else:
            _fill_cboc(window, fraction, fixed_step, np.int32(np.int64(base) & 1), np.float32(high), part)


@njit(cache=True, nogil=True)
def _fill_both(pilot_windows, data_windows, phase, step, high, pilot, data):
    """Fill the replicas of E1-C and E1-B for the same samples; arguments as for `fill_replica`."""
    if high != 0.0:
        fill_replica(pilot_windows, phase, step, -high, pilot)
        fill_replica(data_windows, phase, step, high, data)
        return
    piece = max(1, int(30.0 / step))
    fixed_step = np.uint32(np.round(step * _WHOLE))
    for first in range(0, pilot.size, piece):
        at = phase + first * step
        base = np.floor(at)
        fraction = np.uint32((at - base) * _WHOLE)
        window = np.int64(base) + _AHEAD
        last = first + piece
        _fill_two_boc(
            pilot_windows[window], data_windows[window], fraction, fixed_step, pilot[first:last], data[first:last]
        )


@njit(cache=True, nogil=True, fastmath=True)
def _wipe(x, cos, sin, y_re, y_im):
    for i in range(y_re.size):
        a, b = x[2 * i], x[2 * i + 1]
        y_re[i] = a * cos[i] + b * sin[i]
        y_im[i] = b * cos[i] - a * sin[i]


@njit(cache=True, nogil=True, fastmath=True)
def _two_sums(y_re, y_im, replica_1, replica_2):
    re_1, im_1 = np.float32(0.0), np.float32(0.0)
    re_2, im_2 = np.float32(0.0), np.float32(0.0)
    for i in range(y_re.size):
        re, im = y_re[i], y_im[i]
        re_1 += re * replica_1[i]
        im_1 += im * replica_1[i]
        re_2 += re * replica_2[i]
        im_2 += im * replica_2[i]
    return re_1, im_1, re_2, im_2


@njit(cache=True, nogil=True)
def correlate_period(x, pilot_windows, data_windows, high, phase, step, cycles, cycles_per_sample, lags, pilot):
    """Correlate the samples of one code period; return the prompt of E1-B and fill `pilot`, the bank of E1-C.

    Parameters
    ----------
    x
        float32[2 · n], real and imaginary parts of the samples in turn.
    pilot_windows, data_windows
        `half_chip_windows` of E1-C and E1-B.
    high
        Amplitude of the BOC(6,1) part: added on E1-B, subtracted on E1-C [OS-ICD, 2.3.3]; 0 for BOC(1,1).
    phase, step
        Code phase of the first sample and its step, in half chips.
    cycles, cycles_per_sample
        Carrier phase of the first sample and its step, in cycles.
    lags
        int64[k], the delay of the replica of each correlator in samples; k is odd.
    pilot
        complex128[k], filled with the sums over the samples.
    """
    n = x.size // 2
    reach = np.max(np.abs(lags))
    cos, sin = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    rotator_table(cycles_per_sample, cos, sin)
    y_re, y_im = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    pilot_replica, data_replica = np.empty(BLOCK + 2 * reach, np.float32), np.empty(BLOCK + 2 * reach, np.float32)
    pilot[:] = 0.0
    data = 0.0 + 0.0j
    last = lags.size - 1
    for first in range(0, n, BLOCK):
        m = min(BLOCK, n - first)
        re, im = y_re[:m], y_im[:m]
        _wipe(x[2 * first : 2 * (first + m)], cos, sin, re, im)
        angle = -2 * np.pi * ((cycles + cycles_per_sample * (first + MIDDLE)) % 1.0)
        turn = complex(np.cos(angle), np.sin(angle))
        begin, end = phase + (first - reach) * step, m + 2 * reach
        _fill_both(pilot_windows, data_windows, begin, step, high, pilot_replica[:end], data_replica[:end])
        for k in range(0, last, 2):
            early, late = reach - lags[k], reach - lags[k + 1]
            a, b, c, d = _two_sums(re, im, pilot_replica[early : early + m], pilot_replica[late : late + m])
            pilot[k] += (a + 1j * b) * turn
            pilot[k + 1] += (c + 1j * d) * turn
        begin_last = reach - lags[last]
        a, b, c, d = _two_sums(re, im, pilot_replica[begin_last : begin_last + m], data_replica[reach : reach + m])
        pilot[last] += (a + 1j * b) * turn
        data += (c + 1j * d) * turn
    return data
