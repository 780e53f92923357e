"""Examine a recording: find the satellites, and the faults of the samples or of the description.

The given description is tried first. If no signal is found with the given description, descriptions that differ by one
mistake are tried. In each band, no further description is tried after `TRY_S` of processor time. Trials that keep two
cores busy use up this processor time in half of `TRY_S`. The examination uses the first 100 ms, and windows of 100 ms
in the middle and at the end. Float32 samples are read to the end of the file, or until `READ_S` of processor time is
used up. The reason is that `vestige process` and `vestige track` stop at a sample that is not a finite number.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from vestige.constants import SUBFRAME_S
from vestige.crypto.recs.recs_segment import LENGTHS
from vestige.errors import InputFileError
from vestige.recording.description import BandFile, RecordingDescription, redated
from vestige.recording.doctor.code_doppler import E1Satellite
from vestige.recording.doctor.continuity import examine_continuity
from vestige.recording.doctor.e1_signals import E1Result, Progress, examine_e1
from vestige.recording.doctor.e6_signals import PREDICTED_SPAN_HZ, E6Result, E6Satellite, examine_e6
from vestige.recording.doctor.finding import Finding, FindingKind, TimeLimit, fault, remark
from vestige.recording.doctor.reading import better_sibling, head, swapped_readings
from vestige.recording.samples.front_end_power import CLIPPED, front_end_status
from vestige.recording.samples.sample_file import SampleReader, open_samples
from vestige.recording.tracked.track_recording import MIN_TRACKED_S
from vestige.records import Band
from vestige.sample_processor.e1_snapshot import MIN_PERIODS
from vestige.signals.definitions import E1C, E6C
from vestige.time import GalileoTime

TRY_S = 36.0  # processor time in s for descriptions that differ by one mistake
READ_S = 10.0  # processor time in s for reading float32 samples, about 10 GB
# shortest duration in s of E1 for a measurement of the time of transmission
SHORTEST_E1_S = (MIN_PERIODS + 2) * E1C.period_s
SHORTEST_E6_S = min(length.n_chips for length in LENGTHS) / E6C.chip_rate_hz
RECEIVED_KEY_S = 2 * SUBFRAME_S  # duration in s of E1 that always contains a whole subframe with the subframe's key
_GUESSED_HZ = 4000.0  # largest Doppler error if the centre frequency was estimated from the signals
# assumed start of samples without a time tag, because code phases do not need the true time
_SOME_TIME = GalileoTime(1200, 0)
_ENDS_ONLY = 2  # number of distinct values of a signal that is clipped to one bit
# largest number of values of a front end with four bits or less, which stores many samples at its outermost values
_FEW_VALUES = 16
_READ_SAMPLES = 1 << 20  # number of samples in each read of the search for values that are not finite
_LOOKED_AT_S = 0.02  # duration in s of the samples at each position that is tested for equal samples and clipping


@dataclass(frozen=True, slots=True, kw_only=True)
class Examination:
    """Result of the examination of a recording's signals.

    The tuple of satellites of a missing band is empty.
    """

    e1: tuple[E1Satellite, ...]  # satellites on E1, the strongest first
    e6: tuple[E6Satellite, ...]
    findings: tuple[Finding, ...]


def examine(
    description: RecordingDescription, *, progress: Progress = lambda _step, _done, _total: None
) -> Examination:
    """Return the result of an examination of the signals in a recording.

    The function raises `InputFileError` if a sample file cannot be opened, or its samples cannot be read.

    Parameters
    ----------
    description
        Description of the recording.
    progress
        Function that is called with the name of the step, the number of finished parts and the number of all parts.
    """
    if any(file.start is None for file in description.bands.values()):
        description = redated(description, _SOME_TIME)
    findings: list[Finding] = []
    usable: dict[Band, BandFile] = {}
    for band, file in description.bands.items():
        reader = open_samples(file)
        of_values = tuple(chain(_equal_or_broken(reader), _clipped(reader), _short(reader)))
        if not any(one.kind is FindingKind.NOT_FINITE for one in of_values):
            of_values += tuple(_not_finite(reader, TimeLimit(READ_S)))
        findings.extend(of_values)
        first_is_usable = not any(one.kind in (FindingKind.EMPTY, FindingKind.NOT_FINITE) for one in of_values)
        if first_is_usable or _head_is_usable(file):
            usable[band] = file
    first, second = usable.get(Band.E1), usable.get(Band.E6)
    e1 = None if first is None else examine_e1(first, second, TRY_S, progress)
    e6 = None
    if e1 is not None:
        findings.extend(e1.findings)
    if second is not None:
        progress("E6 signals", 0, 1)
        guessed = e1 is not None and any(one.kind is FindingKind.CENTRE_FREQUENCY for one in e1.findings)
        e6 = examine_e6(
            _e6_files(second, first, e1),
            () if e1 is None else e1.satellites,
            TRY_S,
            span_hz=_GUESSED_HZ if guessed else PREDICTED_SPAN_HZ,
        )
        findings.extend(e6.findings)
    if e1 is not None and e1.satellites:
        progress("continuity", 0, 1)
        beside = None if e6 is None or not e6.satellites else open_samples(e6.file)
        findings.extend(examine_continuity(open_samples(e1.file), beside, e1.satellites, TimeLimit(TRY_S)))
    findings.extend(_duration(description))
    return Examination(
        e1=() if e1 is None else e1.satellites,
        e6=_satellites(e6),
        findings=tuple(findings),
    )


def _satellites(e6: E6Result | None) -> tuple[E6Satellite, ...]:
    return () if e6 is None else e6.satellites


def _e6_files(e6: BandFile, e1: BandFile | None, result: E1Result | None) -> list[BandFile]:
    """Return the descriptions of E6 to try.

    If E1 was found in the E6 file, the E1 file is read as E6.
    """
    if e1 is None or result is None or result.file.path == e1.path:
        return [e6]
    return [reading.file for reading in swapped_readings(e6, e1)]


def _head_is_usable(file: BandFile) -> bool:
    batch = head(file, _LOOKED_AT_S)
    return batch is not None and bool(np.any(batch.samples != batch.samples[0]))


def _equal_or_broken(reader: SampleReader) -> Iterator[Finding]:
    """Yield the first fault of the values at the beginning, in the middle and at the end of the samples."""
    name, band, rate = reader.file.path.name, reader.band, reader.file.sample_rate_hz
    count = min(max(round(_LOOKED_AT_S * rate), 1), reader.n_samples)
    firsts = (reader.first_sample, (reader.first_sample + reader.end_sample - count) // 2, reader.end_sample - count)
    for first, where in zip(firsts, ("at the beginning", "in the middle", "at the end"), strict=True):
        try:
            samples = reader.samples(first, count)
        except InputFileError as error:
            yield _not_a_number(band, error)
            return
        values = samples.view(np.float32).reshape(-1, 2)
        if not np.any(samples != samples[0]):
            yield fault(
                FindingKind.EMPTY, band,
                f"{band.value}: {name} has one value only ({samples[0]:.4g}) {where}, in {count / rate * 1e3:.3g} ms",
                "check that the front end of this band was on, and the format",
            )  # fmt: skip
            return
        if reader.file.form.is_complex and 0.0 in (float(np.std(values[:, 0])), float(np.std(values[:, 1]))):
            yield fault(
                FindingKind.EMPTY, band,
                f"{band.value}: one of I and Q in {name} has one value only {where}",
                "check the cable or channel of that component; if the samples are real ones, convert them to real",
            )  # fmt: skip
            return


def _not_a_number(band: Band, error: InputFileError) -> Finding:
    return fault(
        FindingKind.NOT_FINITE, band, f"{band.value}: {error}",
        "check the format; if it is right, record again: NaN and infinity are no samples",
    )  # fmt: skip


def _not_finite(reader: SampleReader, limit: TimeLimit) -> Iterator[Finding]:
    """Yield a fault for the first float32 sample that is not finite, or a remark if the time limit ends the search."""
    if reader.file.form.component != "float32":
        return
    for first in range(reader.first_sample, reader.end_sample, _READ_SAMPLES):
        if limit.is_over:
            read_s = (first - reader.first_sample) / reader.file.sample_rate_hz
            yield remark(
                FindingKind.NOT_FINITE, reader.band,
                f"{reader.band.value}: no NaN or infinity in the first {read_s:.1f} s of {reader.duration_s:.1f} s, "
                "as far as the file was read, nor at its middle and end",
                "vestige process and vestige track stop at such a sample, and name it",
            )  # fmt: skip
            return
        try:
            reader.samples(first, min(_READ_SAMPLES, reader.end_sample - first))
        except InputFileError as error:
            yield _not_a_number(reader.band, error)
            return


def _clipped(reader: SampleReader) -> Iterator[Finding]:
    file = reader.file
    batch = head(replace(file, start=file.start or _SOME_TIME), _LOOKED_AT_S)
    if better_sibling(file) is not None:  # a wrong format moves the values to the ends of the scale
        return
    if batch is None or not front_end_status(batch, file.form).saturated:
        return
    n_values = len(np.unique(batch.samples.real))
    if n_values == _ENDS_ONLY:
        yield fault(
            FindingKind.CLIPPED, reader.band,
            f"{reader.band.value}: all values are at the ends of the scale",
            "lower the gain: noise should reach a third of the scale (1 σ); store samples of a 1-bit front end as ±1",
        )  # fmt: skip
    elif n_values > _FEW_VALUES:
        yield fault(
            FindingKind.CLIPPED, reader.band,
            f"{reader.band.value}: more than {CLIPPED:.0%} of the values are at the end of the scale",
            "lower the gain: noise should reach a third of the scale (1 σ)",
        )  # fmt: skip


def _short(reader: SampleReader) -> Iterator[Finding]:
    shortest_s = SHORTEST_E1_S if reader.band is Band.E1 else SHORTEST_E6_S
    if reader.duration_s < shortest_s:
        what = "a measurement of E1" if reader.band is Band.E1 else "the shortest RECS"
        yield fault(
            FindingKind.TOO_SHORT, reader.band,
            f"{reader.band.value} lasts {reader.duration_s * 1e3:.3g} ms, too short for {what} "
            f"({shortest_s * 1e3:.3g} ms)",
            "record longer: 100 ms around each RECS at least",
        )  # fmt: skip


def _duration(description: RecordingDescription) -> Iterator[Finding]:
    """Yield a remark that names the purposes for which the recording is too short."""
    durations = [open_samples(file).duration_s for file in description.bands.values()]
    seconds = min(durations, default=math.inf)
    lacks = []
    if seconds < MIN_TRACKED_S:
        lacks.append(f"tracking ({MIN_TRACKED_S:g} s)")
    if seconds < RECEIVED_KEY_S:
        lacks.append(f"an OSNMA key received from its own samples (up to {RECEIVED_KEY_S:g} s)")
    if lacks:
        yield remark(
            FindingKind.DURATION, None, f"the recording lasts {seconds:.3g} s, too short for {' and '.join(lacks)}",
            "keys have to come from the assistance folder",
        )  # fmt: skip
