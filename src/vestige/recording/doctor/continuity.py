"""Test whether the samples are continuous: code phases at two or three positions must change as the Dopplers predict.

Theory of operation
-------------------
The time of transmission of a signal with the Doppler f_d and the carrier frequency f_c grows by (1 + f_d/f_c) s in a
second of the receiver's counter. E1-C shows the time of transmission modulo the 100 ms of its secondary code. The times
of transmission at two positions of the file and the mean Doppler give the jump of the signal relative to the counter.
Missing samples make the signals of all satellites jump ahead. Repeated samples make the signals jump back. The test
does not find a loss or repetition of a whole multiple of 100 ms on E1, or of 1 ms on E6.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median

import numpy as np

from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, SECONDARY_PERIOD_S
from vestige.errors import InputFileError, satellite_names
from vestige.recording.doctor.code_doppler import E1Satellite
from vestige.recording.doctor.finding import Finding, FindingKind, TimeLimit, fault
from vestige.recording.samples.sample_file import SampleReader
from vestige.records import SampleBatch
from vestige.sample_processor.acquisition import Acquisition, acquire
from vestige.sample_processor.e1_snapshot import E1_WINDOW_S, E1Snapshot, measure_e1
from vestige.sample_processor.e6_acquisition import acquire_e6
from vestige.sample_processor.search.e1_jump import Jump
from vestige.sample_processor.search.e1_search import search_e1
from vestige.signals.definitions import E6B
from vestige.time import GalileoTime

SHORTEST_S = 0.112  # shortest duration in s of E1 for the test: two windows for measurements
# smallest reported jump in s, and the increase of this limit in s for each second between two positions, because the
# oscillator drifts
TOLERANCE_S = (1e-6, 1e-8)
_SATELLITES = 3
_DOPPLER_SPAN_HZ = 1000.0  # largest change of a satellite's Doppler during the recording
_NEAR_HZ = 250.0
_NEAR_ENOUGH_S = 0.3
_E6_S = 0.022  # duration in s of the E6 samples in which a code phase is searched for


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredPlace:
    """E1 measurements at one position in the file."""

    first: int  # number of the first sample, on the counter
    snapshots: dict[int, E1Snapshot]


def examine_continuity(
    reader: SampleReader, e6: SampleReader | None, satellites: Sequence[E1Satellite], limit: TimeLimit
) -> Iterator[Finding]:
    """Yield findings about jumps of E1 or E6, lost or multiple signals of E1, and samples that are not finite numbers.

    Parameters
    ----------
    reader
        Reader of the E1 samples, with the description with which the satellites were found.
    e6
        Reader of the E6 samples, with the description with which the satellites were found; None without E6.
    satellites
        Satellites that were found at the beginning, the strongest first. Only the three strongest satellites with a
        measurement are used.
    """
    followed = [one for one in satellites if one.snapshot is not None][:_SATELLITES]
    if not followed:
        return
    yield from _at_the_beginning(reader, followed)
    if reader.duration_s < SHORTEST_S:
        return
    window_s = min(E1_WINDOW_S, reader.duration_s / 2)
    count = int(window_s * reader.file.sample_rate_hz)
    last = reader.end_sample - count
    firsts = [reader.first_sample, last]
    if reader.duration_s > 4 * window_s:
        firsts.insert(1, (reader.first_sample + last) // 2)
    places: list[MeasuredPlace] = []
    for first in firsts:
        try:
            place = _place(reader, first, count, followed)
        except InputFileError as error:
            advice = "record again, or cut the file before this sample"
            yield fault(FindingKind.NOT_FINITE, reader.band, f"E1: {error}", advice)
            return
        if place is None:
            at_s = (first - reader.first_sample) / reader.file.sample_rate_hz
            yield fault(
                FindingKind.NO_SIGNAL, reader.band,
                f"E1: {satellite_names(one.svid for one in followed)}, strong at the beginning, are not found "
                f"{at_s:.1f} s later",
                "check whether the antenna was always connected",
            )  # fmt: skip
            return
        places.append(place)
    for earlier, later in pairwise(places):
        shift_s = _shift_s(earlier, later)
        if shift_s is not None:
            yield _jump_finding(reader, *_narrowed(reader, earlier, later, count, followed, limit), shift_s, count)
    if e6 is not None:
        for earlier, later in pairwise(places):
            yield from _e6_jump(e6, reader, earlier, later, count, followed, limit)


def _e6_jump(
    e6: SampleReader,
    e1: SampleReader,
    earlier: MeasuredPlace,
    later: MeasuredPlace,
    count: int,
    followed: Sequence[E1Satellite],
    limit: TimeLimit,
) -> Iterator[Finding]:
    """Narrow the interval between two measurements of E1, and yield the finding if E6 jumps in the interval."""
    shift_s = _e6_shift_s(e6, earlier, later)
    if shift_s is None:
        return
    while (later.first - earlier.first) / e1.file.sample_rate_hz > _NEAR_ENOUGH_S and not limit.is_over:
        middle = _place(e1, (earlier.first + later.first) // 2, count, followed[:1])
        if middle is None:
            break
        if _e6_shift_s(e6, earlier, middle) is not None:
            later = middle
        elif _e6_shift_s(e6, middle, later) is not None:
            earlier = middle
        else:  # neither half has a jump, because the clock drifts steadily
            break
    begin_s, end_s = (
        (one.first - e1.first_sample) / e1.file.sample_rate_hz + (e1.start - e6.start) for one in (earlier, later)
    )
    end_s += count / e1.file.sample_rate_hz
    yield fault(
        FindingKind.LOST_SAMPLES, e6.band,
        f"E6: the signals jump by {shift_s * 1e6:+.1f} µs between {begin_s:.2f} s and {end_s:.2f} s: "
        f"{abs(shift_s) * e6.file.sample_rate_hz:.0f} samples are {'missing' if shift_s > 0 else 'repeated'} "
        "(modulo 1 ms)",
        _ADVICE,
    )  # fmt: skip


def _e6_shift_s(reader: SampleReader, earlier: MeasuredPlace, later: MeasuredPlace) -> float | None:
    """Return the jump in s of the E6 signals relative to the counter between two positions, positive if ahead.

    The code phases of E6 and the Dopplers of E1 give the jump. The result is None if the jump is below the tolerance,
    or if no satellite is found at both positions.
    """
    before, after = _e6_phases(reader, earlier), _e6_phases(reader, later)
    shifts, span_s = [], 0.0
    for svid in before.keys() & after.keys():
        span_s = after[svid][0] - before[svid][0]
        mean_hz = (earlier.snapshots[svid].doppler_hz + later.snapshots[svid].doppler_hz) / 2
        expected = before[svid][1] + span_s * (1 + mean_hz / E1_CARRIER_HZ)
        shifts.append((after[svid][1] - expected + E6B.period_s / 2) % E6B.period_s - E6B.period_s / 2)
    if not shifts:
        return None
    shift_s = median(shifts)
    least_s = TOLERANCE_S[0] + 1 / reader.file.sample_rate_hz + TOLERANCE_S[1] * span_s
    return shift_s if abs(shift_s) > least_s else None


def _e6_phases(reader: SampleReader, place: MeasuredPlace) -> dict[int, tuple[GalileoTime, float]]:
    """Return by SVID the time of a sample, and the time of transmission of E6-B at this sample in s, modulo 1 ms."""
    found: dict[int, tuple[GalileoTime, float]] = {}
    for svid, snapshot in place.snapshots.items():
        rate = reader.file.sample_rate_hz
        first = reader.first_sample + round((snapshot.time - reader.start) * rate)
        if first < reader.first_sample or first >= reader.end_sample:
            continue
        batch = reader.read(first, min(round(_E6_S * rate), reader.end_sample - first))
        signal = acquire_e6(batch, E6B, svid, doppler_hz=snapshot.doppler_hz * E6_CARRIER_HZ / E1_CARRIER_HZ)
        if signal is not None:
            found[svid] = (batch.start, -signal.code_start_s % E6B.period_s)
    return found


def _at_the_beginning(reader: SampleReader, followed: Sequence[E1Satellite]) -> Iterator[Finding]:
    batch = reader.read(reader.first_sample, min(round(E1_WINDOW_S * reader.file.sample_rate_hz), reader.n_samples))
    jumps: list[Jump] = []
    for one in followed:
        signals = search_e1(
            batch, (one.svid,), doppler_center_hz=one.doppler_hz, doppler_span_hz=_NEAR_HZ, jumped=jumps.append
        )
        if len(signals) > 1:
            weaker = ", ".join(f"{signal.cn0_dbhz:.0f} dBHz" for signal in signals)
            yield fault(
                FindingKind.SEVERAL_SIGNALS, reader.band,
                f"E1: {len(signals)} signals of E{one.svid:02d} at once ({weaker})",
                "a transmitter repeats or simulates signals; `vestige search e1` lists them",
            )  # fmt: skip
    if jumps:
        by_s, at_s = median(one.by_s for one in jumps), median(one.at_s for one in jumps)
        rate = reader.file.sample_rate_hz
        what = f"{abs(by_s) * 1e6:.1f} µs ({abs(by_s) * rate:.0f} samples) are {'missing' if by_s < 0 else 'repeated'}"
        yield fault(
            FindingKind.LOST_SAMPLES, reader.band,
            f"E1: {satellite_names(sorted({one.svid for one in jumps}))} jump some {at_s * 1e3:.0f} ms after the first "
            f"sample: {what}, modulo 4 ms",
            _ADVICE,
        )  # fmt: skip


_ADVICE = (
    "record again with fewer losses (faster disk, larger buffers), or cut the file there; if nothing was lost, "
    "sample_rate_hz is wrong by some ppm"
)


def _place(reader: SampleReader, first: int, count: int, followed: Sequence[E1Satellite]) -> MeasuredPlace | None:
    batch = reader.read(first, count)
    if not np.any(batch.samples != batch.samples[0]):
        return None
    found: dict[int, E1Snapshot] = {}
    for one in followed:
        for acquisition in _near(batch, one):
            measured = measure_e1(batch, acquisition)
            if measured is not None:
                found[one.svid] = measured
    return MeasuredPlace(first=first, snapshots=found) if found else None


def _near(batch: SampleBatch, one: E1Satellite) -> tuple[Acquisition, ...]:
    return acquire(
        batch, (one.svid,), overall_pfa=1e-6, doppler_center_hz=one.doppler_hz, doppler_span_hz=_DOPPLER_SPAN_HZ,
        max_stretches=8,
    )  # fmt: skip


def _shift_s(earlier: MeasuredPlace, later: MeasuredPlace) -> float | None:
    """Return the jump of the E1 signals relative to the counter in s, positive if ahead; None if no jump is found."""
    shifts = []
    span_s = 0.0
    for svid, before in earlier.snapshots.items():
        after = later.snapshots.get(svid)
        if after is None:
            continue
        span_s = after.time - before.time
        mean_hz = (before.doppler_hz + after.doppler_hz) / 2
        expected = before.transmit_phase_s + span_s * (1 + mean_hz / E1_CARRIER_HZ)
        half = SECONDARY_PERIOD_S / 2
        shifts.append((after.transmit_phase_s - expected + half) % SECONDARY_PERIOD_S - half)
    if not shifts:
        return None
    shift_s = median(shifts)
    return shift_s if abs(shift_s) > TOLERANCE_S[0] + TOLERANCE_S[1] * span_s else None


def _narrowed(
    reader: SampleReader,
    earlier: MeasuredPlace,
    later: MeasuredPlace,
    count: int,
    followed: Sequence[E1Satellite],
    limit: TimeLimit,
) -> tuple[MeasuredPlace, MeasuredPlace]:
    """Return two positions between which the signals jump, if possible nearer together than the given positions."""
    while (later.first - earlier.first) / reader.file.sample_rate_hz > _NEAR_ENOUGH_S and not limit.is_over:
        middle = _place(reader, (earlier.first + later.first) // 2, count, followed[:1])
        if middle is None:
            break
        if _shift_s(earlier, middle) is not None:
            later = middle
        elif _shift_s(middle, later) is not None:
            earlier = middle
        else:  # neither half has a jump, because the clock drifts steadily
            break
    return earlier, later


def _jump_finding(
    reader: SampleReader, earlier: MeasuredPlace, later: MeasuredPlace, shift_s: float, count: int
) -> Finding:
    rate = reader.file.sample_rate_hz
    begin_s, end_s = ((one - reader.first_sample) / rate for one in (earlier.first, later.first + count))
    what = "missing" if shift_s > 0 else "repeated"
    return fault(
        FindingKind.LOST_SAMPLES, reader.band,
        f"E1: the signals jump by {shift_s * 1e6:+.1f} µs between {begin_s:.2f} s and {end_s:.2f} s: "
        f"{abs(shift_s) * rate:.0f} samples are {what} (modulo 100 ms), or the clock jumped",
        _ADVICE,
    )  # fmt: skip
