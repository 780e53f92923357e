"""Correlate samples with the replicas of E1-C and E1-B, in the compiled inner loops of a tracking channel.

Theory of operation
-------------------
**Running sums.** A replica is constant in each segment, which extends from one possible edge of the replica to the next
possible edge. The replica BOC(1,1) can have an edge every half chip, so a segment contains about six samples at 12.5
MHz. A correlator needs only the sum of the samples of each segment, which is the difference of two running sums. The
running sums are computed once for all satellites. The work for a satellite grows with the number of edges, and not with
the sampling rate.

**Correlators at whole samples.** The replica of an early or late correlator is the replica of the prompt correlator,
moved by some samples. So the segments of the moved replica begin and end some samples earlier or later in the same
running sums. If all correlators lie at consecutive samples, a vector reads the sums of two correlators at once.

**Carrier.** A segment has one carrier phase, the phase at its middle. With a residual frequency of 10 kHz the carrier
turns by 0.005 cycles in half a chip. This rotation reduces the amplitude by (0.005 π)² / 6 = 4·10⁻⁵, which is 0.0004
dB. If the centre frequency is not the E1 carrier, the difference is removed from the samples before they are summed.
The frequency that is removed is a multiple of the sampling rate over 2³², so that its phase at any sample is an exact
integer in units of 2⁻³² cycles.

**Precision.** Running sums are float32 and start again after at most `PIECE` samples. At 12.5 MHz the rounding of the
sums is 116 dB below the noise of a code period. If the samples have a constant offset as strong as the noise, the
rounding is 81 dB below the noise.
"""

# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="call-arg"

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, Int8, Int64

from vestige.kernel_cache import njit
from vestige.sample_processor.tracking.correlator_bank_vectors import SUMS, VECTORS, bank_sums

PIECE = 8192  # largest number of samples with common running sums: 64 kB, which fit the second-level cache
_MARGIN = 64  # number of segments of a replica before the code period and after the code period
_SEGMENTS = 1024  # largest number of segments in a piece; a power of two, as `_carrier` needs
_PAD = 2  # number of elements before and after the running sums; a vector reads at most one of these elements
_LOW, _HIGH = np.sqrt(10 / 11), np.sqrt(1 / 11)  # amplitudes of CBOC [OS-ICD, 2.3.3]
REMOVED_STEPS = float(1 << 32)  # number of phase steps in a cycle of the frequency that is removed from all samples


def segments_in_half_chip(replica: str) -> int:
    """Return the number of segments of a half chip: 1 for BOC(1,1), 6 for CBOC."""
    return 1 if replica == "BOC(1,1)" else 6


def bank_replicas(
    pilot: Int8[np.ndarray, " 4092"], data: Int8[np.ndarray, " 4092"], replica: str = "BOC(1,1)"
) -> Float32[np.ndarray, "2 n"]:
    """Return the values of the replicas of E1-C and E1-B in each segment, continued beyond both ends of the period.

    CBOC adds BOC(6,1) on E1-B and subtracts BOC(6,1) on E1-C [OS-ICD, 2.3.3]. BOC(1,1) changes its sign in the middle
    of a chip. BOC(6,1) has three cycles in each half of a chip.
    """
    n = segments_in_half_chip(replica)
    rows = []
    for code, sign in ((pilot, -1.0), (data, 1.0)):
        slow, quick = np.repeat([1.0, -1.0], n), np.tile([1.0, -1.0], n)
        pulse = slow if n == 1 else _LOW * slow + sign * _HIGH * quick
        values = np.kron(code, pulse)
        rows.append(np.concatenate((values[-_MARGIN:], values, values[:_MARGIN])))
    return np.array(rows, np.float32)


def bank_vectors(lags: Int64[np.ndarray, " k"]) -> tuple[Int64[np.ndarray, " n"], Int64[np.ndarray, " k"]]:
    """Return the first lag of each vector of `bank_sums`, and the position of each lag in the sums of `bank_sums`.

    A vector contains the sums of two consecutive lags. If all lags are consecutive, two correlators share a vector;
    otherwise each correlator has its own vector. Each call of `bank_sums` processes `VECTORS` vectors. In the first
    call, the vector `DATA_VECTOR` contains the lag 0.
    """
    dense = bool(np.all(np.diff(lags) == 1))
    wanted = sorted({int(lag) // 2 * 2 if dense else int(lag) for lag in lags} | {0}, key=abs)
    starts = [wanted[1] if len(wanted) > 1 else 0, 0, *wanted[2:]]
    starts += [0] * (-len(starts) % VECTORS)
    slots = [2 * starts.index(lag // 2 * 2 if dense else lag) + (lag % 2 if dense else 0) for lag in lags.tolist()]
    return np.array(starts, np.int64), np.array(slots, np.int64)


@njit(cache=True, nogil=True)
def bank_workspace():
    """Return arrays for `running_sums` and `add_to_bank`: running sums, edges, carrier, and sums of `bank_sums`."""
    return (
        np.zeros(2 * (PIECE + 1 + 2 * _PAD), np.float32),
        np.empty(_SEGMENTS + 1, np.int32),
        np.empty((2, _SEGMENTS), np.float32),
        np.empty(SUMS, np.float32),
    )


@njit(cache=True, nogil=True)
def piece_length(step, lags):
    """Return the largest number of samples of a piece whose segments fit the workspace.

    The argument `step` is in segments per sample, and `lags` are in samples.
    """
    return max(min(PIECE, int((_SEGMENTS - 8) / step) - 2 * np.max(np.abs(lags))), 1)


@njit(cache=True, nogil=True, fastmath=True)
def _carrier(cycles_per_place, carrier):
    """Fill the cosine and the sine of a phase that begins at 0 and grows by `cycles_per_place` from element to element.

    Each pass of the loop doubles the filled length.
    """
    cos, sin = carrier[0], carrier[1]
    cos[0], sin[0] = 1.0, 0.0
    n = 1
    while n < cos.size:
        angle = 2 * np.pi * ((cycles_per_place * n) % 1.0)
        c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
        for i in range(n):
            a, b = cos[i], sin[i]
            cos[n + i] = a * c - b * s
            sin[n + i] = a * s + b * c
        n *= 2


@njit(cache=True, nogil=True)
def running_sums(x, first_sample, shift, work):
    """Compute the running sums of at most `PIECE` samples, and store these sums in `work`.

    Parameters
    ----------
    x
        float32[2 · n], real and imaginary parts of the samples in turn.
    first_sample
        Number of the first sample, from which the phase of the removed frequency follows.
    shift
        Frequency that is removed, in 2⁻³² cycles per sample.
    work
        Arrays from `bank_workspace`, whose running sums are filled.
    """
    running, _, carrier, _ = work
    re, im = np.float32(0.0), np.float32(0.0)
    at = 2 * (_PAD + 1)
    if shift == 0:
        for i in range(0, x.size, 2):
            re += x[i]
            im += x[i + 1]
            running[at + i], running[at + i + 1] = re, im
        return
    cos, sin = carrier[0], carrier[1]
    _carrier(shift / REMOVED_STEPS, carrier)
    for block in range(0, x.size, 2 * _SEGMENTS):
        angle = 2 * np.pi * removed_cycles(first_sample + block // 2, shift)
        c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
        for k in range(min(_SEGMENTS, (x.size - block) // 2)):
            i = block + 2 * k
            u, v = cos[k] * c - sin[k] * s, cos[k] * s + sin[k] * c
            re += x[i] * u + x[i + 1] * v
            im += x[i + 1] * u - x[i] * v
            running[at + i], running[at + i + 1] = re, im


@njit(cache=True, nogil=True)
def removed_cycles(sample, shift):
    """Return the phase of the removed frequency at a sample, in cycles, 0 to 1."""
    return ((sample * np.int64(shift)) & np.int64(0xFFFFFFFF)) / REMOVED_STEPS


@njit(cache=True, nogil=True)
def add_to_bank(work, begin, count, replicas, phase, step, cycles, cycles_per_sample, lags, starts, slots, bank):
    """Add the correlations of some samples to the bank of E1-C; return the correlation with E1-B at lag 0.

    Parameters
    ----------
    work
        Arrays from `bank_workspace` with the running sums of a piece.
    begin, count
        Number of the first sample, counted from the beginning of the piece, and number of samples, at most
        `piece_length`.
    replicas
        Replicas from `bank_replicas`.
    phase, step
        Code phase of the first sample, and its step per sample, in segments; the phase lies in the code period.
    cycles, cycles_per_sample
        Carrier phase of the first sample, and its step per sample, in cycles, without the removed frequency.
    lags
        int64[k], the delay of the replica of each correlator in samples, in ascending order.
    starts, slots
        Results of `bank_vectors` for the lags.
    bank
        complex128[k], to which the sums over the samples are added.
    """
    running, edges, carrier, sums = work
    reach = max(-lags[0], lags[-1])
    low = int(np.floor(phase - reach * step))
    n = int(np.floor(phase + (count - 1 + reach) * step)) - low + 1
    zero = _PAD + begin
    samples_per_segment = 1.0 / step
    first_edge = (low - phase) * samples_per_segment
    for j in range(n + 1):
        edges[j] = np.int32(zero) + np.int32(np.ceil(first_edge + np.float64(np.int32(j)) * samples_per_segment))
    per_segment = cycles_per_sample * samples_per_segment
    _carrier(per_segment, carrier)
    replica_at = low + _MARGIN
    # head and tail: segments that are incomplete for some correlator
    head, tail = 0, n
    while head < n and edges[head] - reach < zero:
        head += 1
    while tail > head and edges[tail] + reach > zero + count:
        tail -= 1
    middle_of_first = cycles + cycles_per_sample * first_edge + 0.5 * per_segment
    angle = -2 * np.pi * (middle_of_first % 1.0)
    turn = complex(np.cos(angle), np.sin(angle))
    data = 0.0j
    for begin_part, end_part in ((0, head), (tail, n)):
        for j in range(begin_part, end_part):
            rotation = turn * complex(carrier[0, j], -carrier[1, j])
            data += replicas[1, replica_at + j] * rotation * _segment(running, edges[j], edges[j + 1], zero, count, 0)
            for k in range(lags.size):
                moved = rotation * _lag_turn(cycles_per_sample, lags[k])
                total = _segment(running, edges[j], edges[j + 1], zero, count, lags[k])
                bank[k] += replicas[0, replica_at + j] * moved * total
    if head == tail:
        return data
    for first_vector in range(0, starts.size, VECTORS):
        bank_sums(running, edges, replicas, replica_at, carrier, head, tail, starts, first_vector, sums)
        if first_vector == 0:
            data += turn * _sum_at(sums, 2 * VECTORS)
        for k in range(lags.size):
            if 0 <= slots[k] - 2 * first_vector < 2 * VECTORS:
                bank[k] += turn * _lag_turn(cycles_per_sample, lags[k]) * _sum_at(sums, slots[k] - 2 * first_vector)
    return data


@njit(cache=True, nogil=True)
def _sum_at(sums, slot):
    """Return a sum of `bank_sums`, rotated back by the carrier."""
    with_cos, with_sin = 2 * slot, SUMS // 2 + 2 * slot
    return complex(sums[with_cos] + sums[with_sin + 1], sums[with_cos + 1] - sums[with_sin])


@njit(cache=True, nogil=True)
def _lag_turn(cycles_per_sample, lag):
    """Return the factor that removes the carrier phase of a lag; the samples of a correlator are later by the lag."""
    angle = -2 * np.pi * cycles_per_sample * lag
    return complex(np.cos(angle), np.sin(angle))


@njit(cache=True, nogil=True)
def _segment(running, edge, next_edge, zero, count, lag):
    """Return the sum of the samples between two edges, which are moved by a lag and limited to the `count` samples."""
    a = 2 * min(max(edge + lag, zero), zero + count)
    b = 2 * min(max(next_edge + lag, zero), zero + count)
    return complex(running[b] - running[a], running[b + 1] - running[a + 1])


@njit(cache=True, nogil=True)
def correlate_part(x, replicas, phase, step, cycles, cycles_per_sample, lags, starts, slots, bank):
    """Fill the bank of E1-C from a part of a code period; return the correlation with E1-B at lag 0.

    Parameters
    ----------
    x
        float32[2 · n], real and imaginary parts of the samples in turn, all in one code period.
    replicas, phase, step, cycles, cycles_per_sample, lags, starts, slots, bank
        Arguments with the same meaning as in `add_to_bank`. No frequency is removed from the samples.
    """
    work = bank_workspace()
    bank[:] = 0.0
    data = 0.0j
    piece = piece_length(step, lags)
    for first in range(0, x.size // 2, piece):
        count = min(piece, x.size // 2 - first)
        running_sums(x[2 * first : 2 * (first + count)], 0, 0, work)
        data += add_to_bank(
            work,
            0,
            count,
            replicas,
            phase + first * step,
            step,
            cycles + first * cycles_per_sample,
            cycles_per_sample,
            lags,
            starts,
            slots,
            bank,
        )
    return data
