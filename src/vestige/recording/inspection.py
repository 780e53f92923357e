"""Inspect a recording: list the content, and the data that ACAS lacks to authenticate the recording.

For a verdict other than NOT_AVAILABLE, ACAS needs three inputs: E6 samples that contain a RECS, the RECS itself, and
the OSNMA key of the RECS. E1 (samples or observations) predicts the position of the RECS in E6. The group delay of the
satellite corrects the predicted position. The receiver clock's error must be provably smaller than the time from the
RECS to the disclosure of the key. For a key delay of one subframe (KDI 1), the paper states 30 s from the RECS to the
disclosure [WFO, Sec. III-D]. For this key delay, the exact time from the RECS to the disclosure is 22 to 52 s.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from vestige.acas_processor.searches.vestigial import TRAVEL_TIME_S
from vestige.constants import SUBFRAME_S
from vestige.crypto.osnma.disclosure import provably_before_disclosure
from vestige.recording.adc_statistics import AdcStatistics, adc_statistics
from vestige.recording.assistance.folder import AssistanceFolder, read_assistance
from vestige.recording.description import RecordingDescription, redated
from vestige.recording.doctor.e1_signals import Progress
from vestige.recording.doctor.examination import Examination, examine
from vestige.recording.observations.observation_file import ObservationFile, observation_kind, open_observations
from vestige.recording.recording import describe_recording, find_observations, find_recording
from vestige.recording.samples.sample_file import SampleReader, open_samples
from vestige.records import Assistance, Band, EncryptedSegment
from vestige.signals.definitions import CARRIER_HZ, E6C
from vestige.time import GalileoTime

FEW_VALUES = 16  # number of distinct values of a 4-bit front end, for which samples at the outermost values are normal
CLIPPING = 0.01  # fraction of components at the outermost value above which clipping distorts the signals
CENTER_TOLERANCE = 0.25  # largest distance of the pass band's centre from the carrier, as a share of the sampling rate


@dataclass(frozen=True, slots=True, kw_only=True)
class BandInspection:
    """The samples of a band and the statistics of the first samples.

    `hash_agrees` tells whether the file has the hash that the description of the file states. `hash_agrees` is None if
    no hash is stated or compared.
    """

    reader: SampleReader
    adc_statistics: AdcStatistics
    hash_agrees: bool | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ObservationCoverage:
    """Coverage of a file of E1 observations.

    `span` has the times of the first and the last epoch, and is None without an epoch.
    """

    file: ObservationFile
    n_epochs: int
    span: tuple[GalileoTime, GalileoTime] | None
    satellites: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Inspection:
    """Result of an inspection: the data at a path, and the data that ACAS lacks."""

    path: Path
    description: RecordingDescription | None  # description of the recording; None if the path has no samples
    bands: tuple[BandInspection, ...]
    observations: ObservationCoverage | None
    assistance: AssistanceFolder
    recorded_segments: tuple[EncryptedSegment, ...]  # RECS that can be in the E6 samples
    notes: tuple[str, ...]  # unusual features of the recording, one line each
    # missing data, one line each; first the data without which no verdict is possible, then other gaps of the
    # assistance folder
    missing: tuple[str, ...]
    examination: Examination | None = None  # result of the search for signals; None if there was no search


def inspect_recording(
    path: Path,
    *,
    start: GalileoTime | None = None,
    time_uncertainty_s: float | None = None,
    assistance: Path | None = None,
    public_key: Path | None = None,
    merkle_tree: Path | None = None,
    check_hash: bool = False,
    signals: bool = False,
    progress: Progress = lambda _step, _done, _total: None,
) -> Inspection:
    """Return the content of a recording, an observation file or a folder, and the data that ACAS lacks.

    The function raises `InputFileError` or `UnsupportedError` if nothing at `path` can be read, or its description,
    samples or observations are not usable. `InputFileError` is also raised if the folder `assistance` does not exist.
    `VestigeError` is raised if `public_key` or `merkle_tree` is not usable.

    Parameters
    ----------
    start
        Receiver-clock time of the earliest sample, in place of the recording's time tags.
    time_uncertainty_s
        Upper limit of the receiver clock's error in s, in place of the limit that the recording states.
    assistance
        Folder with RECS, keys and other assistance; by default the folder of the recording with its direct subfolders.
    public_key, merkle_tree
        Trust anchors of OSNMA, used in place of the trust anchors in the assistance folder.
    check_hash
        Whether sample files are compared with the hashes in their descriptions, which reads all samples.
    signals
        Whether to search for satellites and for errors of the description, which usually takes 10 to 40 s.
    progress
        Function that is called with the name of the search step, the number of finished parts and the number of all
        parts.
    """
    description, observation_path = _find(path)
    if description is not None and start is not None:
        description = redated(description, start)
    if description is not None and time_uncertainty_s is not None:
        description = replace(description, time_uncertainty_s=time_uncertainty_s)
    bands = tuple(_bands(description, check_hash))
    coverage = None if observation_path is None else _coverage(open_observations(observation_path))
    folder = assistance or (path if path.is_dir() else path.parent)
    span = _span(bands)
    helping = read_assistance(
        folder,
        public_key=public_key,
        merkle_tree=merkle_tree,
        window=_transmission(span),
        reference=None if span is None else span[0],
    )
    return Inspection(
        path=path,
        description=description,
        bands=bands,
        observations=coverage,
        assistance=helping,
        recorded_segments=() if span is None else helping.assistance.segments,
        notes=(*(description.notes if description else ()), *_notes(bands)),
        missing=tuple(_missing(description, bands, coverage, helping)),
        examination=examine(description, progress=progress) if signals and description is not None else None,
    )


def _find(path: Path) -> tuple[RecordingDescription | None, Path | None]:
    """Return the recording and the observation file at a path, each None if the path has none."""
    if path.is_file() and observation_kind(path) is not None:
        return None, path
    if path.is_dir() and find_recording(path) is None:
        return None, find_observations(path)
    description = describe_recording(path)
    return description, description.observations


def _bands(description: RecordingDescription | None, check_hash: bool) -> Iterator[BandInspection]:
    files = {} if description is None else description.bands
    for band in Band:
        if band in files:
            reader = open_samples(files[band])
            agrees = reader.hash_agrees() if check_hash else None
            yield BandInspection(reader=reader, adc_statistics=adc_statistics(reader), hash_agrees=agrees)


def _coverage(file: ObservationFile) -> ObservationCoverage:
    count, span, satellites = 0, None, set[int]()
    for epoch in file:
        count += 1
        span = (epoch.time if span is None else span[0], epoch.time)
        satellites |= epoch.observations.keys()
    return ObservationCoverage(file=file, n_epochs=count, span=span, satellites=tuple(sorted(satellites)))


def _span(bands: tuple[BandInspection, ...]) -> tuple[GalileoTime, GalileoTime] | None:
    """Return the receiver-clock times of the start and end of the E6 samples, or None if these times are unknown."""
    e6 = next((band.reader for band in bands if band.reader.band is Band.E6), None)
    if e6 is None or e6.file.start is None:
        return None
    return e6.start, e6.start + e6.duration_s


def _transmission(span: tuple[GalileoTime, GalileoTime] | None) -> tuple[GalileoTime, GalileoTime] | None:
    """Return the first and last time of transmission of a segment that can reach the receiver within `span`."""
    if span is None or span[0] < GalileoTime(0, 1):  # Galileo time does not exist before week 0
        return span
    return span[0] + -TRAVEL_TIME_S[1], span[1] + -TRAVEL_TIME_S[0]


def _notes(bands: tuple[BandInspection, ...]) -> Iterator[str]:
    for band in bands:
        reader, found = band.reader, band.adc_statistics
        name = reader.file.path.name
        yield from reader.notes
        if band.hash_agrees is False:
            yield f"{name} does not have the SHA-512 that its description states: the samples were changed"
        if found.deviation == 0:
            yield f"{name}: all samples are equal: the front end is dead, or the format is wrong"
        elif found.n_distinct > FEW_VALUES and found.outermost_fraction > CLIPPING:
            yield f"{name}: {found.outermost_fraction:.1%} of the values are ±{found.outermost:g}: the samples clip"
        center, carrier = found.spectral_center_hz, CARRIER_HZ[reader.band]
        if center is not None and abs(center - carrier) > CENTER_TOLERANCE * reader.file.sample_rate_hz:
            yield (
                f"{name}: the pass band lies around {center / 1e6:.2f} MHz, far from the carrier: "
                "check center_frequency_hz and spectral_inversion"
            )


def _missing(
    description: RecordingDescription | None,
    bands: tuple[BandInspection, ...],
    coverage: ObservationCoverage | None,
    assistance: AssistanceFolder,
) -> Iterator[str]:
    there = {band.reader.band: band.reader for band in bands}
    if Band.E6 not in there:
        yield "no E6 samples: ACAS correlates E6-C"
    if Band.E1 not in there and (coverage is None or coverage.n_epochs == 0):
        yield "no E1: neither samples nor observations tell where in E6 to look"
    if any(reader.file.start is None for reader in there.values()):
        yield "no start time: neither the description nor a --start tells when the samples were taken"
    if description is not None:
        yield from _missing_time(description.time_uncertainty_s)
    span = _span(bands)
    if span is not None:
        seen = None if coverage is None else coverage.span
        if coverage is not None and seen is not None and (seen[1] < span[0] or span[1] < seen[0]):
            yield f"no observations for this time: {coverage.file.path.name} has {seen[0]} to {seen[1]}"
        if description is not None and description.time_uncertainty_s < SUBFRAME_S:
            yield from _missing_margin(description.time_uncertainty_s, assistance.assistance)
    yield from assistance.missing_for(span)


def _missing_time(uncertainty_s: float) -> Iterator[str]:
    rule = f"expected below {SUBFRAME_S} s, to prove that E6 was received before the key was public"
    if math.isinf(uncertainty_s):
        yield f"no time uncertainty: the upper limit of the receiver clock's error is not stated; {rule}"
    elif uncertainty_s >= SUBFRAME_S:
        yield f"time uncertainty too large: the receiver clock may be wrong by {uncertainty_s:g} s; {rule}"


def _missing_margin(uncertainty_s: float, assistance: Assistance) -> Iterator[str]:
    """Yield a line if the clock cannot prove that every RECS with a known key was received before the disclosure."""
    disclosed = {key.time: key.disclosed_at for key in assistance.keys}
    margins_s = [
        disclosed[segment.key_time] - segment.transmit_time - TRAVEL_TIME_S[1] - segment.n_chips / E6C.chip_rate_hz
        for segment in assistance.segments
        if segment.key_time in disclosed
    ]
    late = [margin_s for margin_s in margins_s if not provably_before_disclosure(margin_s, uncertainty_s)]
    if late:
        yield (
            f"time uncertainty too large for {len(late)} of {len(margins_s)} RECS: the key is on air "
            f"{min(late):.1f} s after the RECS or later, and the receiver clock may be wrong by {uncertainty_s:g} s"
        )
