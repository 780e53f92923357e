"""Read SigMF recordings: a metadata file for each band, a collection, or a folder of metadata files.

The `core` fields are read according to the specification, and the `sigmf` library's schema checks these fields.
`core:frequency` is the frequency that lies at 0 Hz in the stored samples. In a real IF recording, `core:frequency` is
the frequency of the local oscillator. `core:global_index` of the first capture is the number of the file's first sample
on the counter that the bands share.

vestige adds its own namespace (name `vestige` in `core:extensions`, version 1.0.0):

======= ============================== =============================================================================
object  field                          meaning
======= ============================== =============================================================================
global  `vestige:spectral_inversion`   boolean, default false: the stored spectrum is inverted
global  `vestige:bandwidth_hz`         number: two-sided bandwidth of the front end
global  `vestige:time_uncertainty_s`   number: upper limit of the receiver clock's error against Galileo System Time
global  `vestige:sample_count`         integer: number of samples that were written; a shorter file was cut off
capture `vestige:start_gst`            string `WEEK:SECOND`, any number of digits: receiver-clock time of the first
                                       sample in Galileo System Time; `core:datetime` has only microseconds
======= ============================== =============================================================================

The time tags of two bands must agree with the counter. Many recorders write `core:datetime` only to the millisecond. So
a time tag from `core:datetime` alone may differ from the counter by up to a millisecond if both files state a
`core:global_index`. If a file states no `core:global_index`, the time tags must agree within 2 µs, because nothing else
relates the bands in time. Two time tags from `vestige:start_gst` must agree with the counter within 1 ns in any case.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, NoReturn

import jsonschema
import sigmf
from jsonschema.exceptions import best_match
from jsonschema.validators import validator_for
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vestige.crypto.file_bytes import read_bytes
from vestige.errors import InputFileError, UnsupportedError
from vestige.recording.description import (
    FIRST_SAMPLE,
    SAMPLE_RATE_RANGE_HZ,
    TIME_UNCERTAINTY_S,
    BandFile,
    RecordingDescription,
    band_of,
    sample_file,
    started,
)
from vestige.recording.samples.sample_format import NOT_READ, SIGMF_FORMATS, SampleFormat
from vestige.records import Band
from vestige.time import GalileoTime

META, DATA, COLLECTION, ARCHIVE = ".sigmf-meta", ".sigmf-data", ".sigmf-collection", ".sigmf"
NAMESPACE, NAMESPACE_VERSION = "vestige", "1.0.0"
_MAX_BYTES = 1 << 26  # largest number of bytes of metadata; thousands of annotations need a few megabytes

EXACT_AGREEMENT_S = 1e-9
DATETIME_AGREEMENT_S = 1e-3
DATETIME_RESOLUTION_S = 2e-6  # largest difference in s that the rounding of core:datetime to 1 µs can cause


class _Extension(BaseModel):
    """The global fields of the namespace `vestige`."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)
    spectral_inversion: bool = False
    bandwidth_hz: Annotated[float, Field(gt=0, le=1e12)] | None = None
    time_uncertainty_s: Annotated[float, Field(ge=TIME_UNCERTAINTY_S[0], le=TIME_UNCERTAINTY_S[1])] | None = None
    sample_count: Annotated[int, Field(ge=0)] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stream:
    """A SigMF recording of one band, with properties of its time tag and its counter."""

    file: BandFile
    exact_start: bool
    states_counter: bool
    time_uncertainty_s: float | None


def read_sigmf(metas: Sequence[Path], *, described_in: Path) -> RecordingDescription:
    """Return the recording that SigMF metadata files describe together, with at most one file for each band.

    A file whose spectrum contains neither the E1 nor the E6 carrier is left out, with a note. `described_in` names the
    recording: the metadata file itself, a collection or a folder.

    The function raises `InputFileError` if a file is not SigMF metadata, lacks a required field or its samples, or
    contradicts itself or the other band. The function also raises `InputFileError` if two files have the same band, or
    if no file has E1 or E6. The function raises `UnsupportedError` if a file is valid SigMF that vestige does not read.
    """
    streams: dict[Band, _Stream] = {}
    notes = []
    for meta in metas:
        stream = _stream(meta)
        if stream is None:
            notes.append(f"{meta.name}: neither the E1 nor the E6 carrier lies in its spectrum; not used")
            continue
        if (other := streams.get(stream.file.band)) is not None:
            found = f"{other.file.described_in.name} and {meta.name}"
            raise InputFileError(described_in, stream.file.band.name, found, "one recording for each band")
        streams[stream.file.band] = stream
    if not streams:
        raise InputFileError(described_in, "core:frequency", "no E1 or E6 samples", "a recording of E1 or E6")
    uncertainties = [s.time_uncertainty_s for s in streams.values() if s.time_uncertainty_s is not None]
    return RecordingDescription(
        path=described_in,
        bands=_aligned(list(streams.values())),
        time_uncertainty_s=max(uncertainties, default=math.inf),
        notes=tuple(notes),
    )


def read_collection(path: Path) -> RecordingDescription:
    """Return the recording that a `.sigmf-collection` file names.

    The function raises the errors of `read_sigmf`. The function also raises `InputFileError` if the file is not a SigMF
    collection, or if a metadata file is missing or has changed since the collection was made.
    """
    content = _json(path)
    collection = content.get("collection") if isinstance(content, dict) else None
    streams = collection.get("core:streams") if isinstance(collection, dict) else None
    if not isinstance(streams, list) or not streams:
        raise InputFileError(path, "collection.core:streams", streams, "a list of SigMF recordings")
    metas = []
    for number, stream in enumerate(streams):
        place = f"collection.core:streams.{number}"
        name = stream.get("name") if isinstance(stream, dict) else None
        if not isinstance(name, str):
            raise InputFileError(path, place, stream, "an object with the name and hash of a recording")
        meta = sample_file(path, f"{place}.name", name + META)
        stated = stream.get("hash")
        if stated is not None and hashlib.sha512(read_bytes(meta, at_most=_MAX_BYTES)).hexdigest() != stated:
            raise InputFileError(path, f"{place}.hash", stated, f"the SHA-512 of {meta.name} as it is now")
        metas.append(meta)
    return read_sigmf(metas, described_in=path)


def _json(path: Path) -> Any:
    def refuse(constant: str) -> NoReturn:
        raise ValueError(f"{constant} is not a number")

    try:
        return json.loads(read_bytes(path, at_most=_MAX_BYTES), parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        raise InputFileError(path, "content", str(error), "JSON") from error


@cache
def _specification() -> Any:
    """Return the validator of the specification's schema, which the first call makes.

    `sigmf.validate` checks the schema itself at every call, which takes longer than the check of the metadata.
    `sigmf.validate` also warns of undeclared namespaces, which vestige permits.
    """
    schema = sigmf.schema.get_schema()
    return validator_for(schema)(schema)


def _metadata(path: Path) -> dict[str, Any]:
    """Return the metadata of one recording, checked against the specification's schema."""
    content = _json(path)
    try:
        if (wrong := best_match(_specification().iter_errors(content))) is not None:
            raise wrong
    except jsonschema.ValidationError as error:
        place = ".".join(map(str, error.absolute_path)) or "content"
        if error.validator == "required":
            raise InputFileError(path, place, "a missing key", error.message) from error
        raise InputFileError(path, place[:80], error.instance, f"{error.validator} {error.validator_value}") from error
    except RecursionError as error:
        raise InputFileError(path, "content", "deep nesting", "SigMF metadata") from error
    return content


def _stream(path: Path) -> _Stream | None:
    """Return the recording of a metadata file, or None if its spectrum contains neither the E1 nor the E6 carrier."""
    metadata = _metadata(path)
    top: dict[str, Any] = metadata["global"]
    captures: list[dict[str, Any]] = metadata["captures"] or [{"core:sample_start": 0}]
    first = captures[0]
    own = _extension(path, top)
    form = _form(path, top)
    rate = _ranged(path, "global.core:sample_rate", top.get("core:sample_rate"), SAMPLE_RATE_RANGE_HZ)
    frequency = _ranged(path, "captures.0.core:frequency", first.get("core:frequency"), (0.0, 1e12))
    _check_one_stretch(path, captures, int(top.get("core:offset", 0)))
    counter = first.get("core:global_index", first["core:sample_start"])
    band = band_of(frequency, rate)
    if band is None:
        return None
    start, exact_start = _start(path, first)
    sha512 = top.get("core:sha512")
    file = BandFile(
        band=band,
        path=_data_file(path, top),
        described_in=path,
        form=form,
        sample_rate_hz=rate,
        center_frequency_hz=frequency,
        spectral_inversion=own.spectral_inversion,
        first_sample=int(_ranged(path, "captures.0.core:global_index", counter, FIRST_SAMPLE)),
        start=start,
        bandwidth_hz=own.bandwidth_hz,
        header_bytes=int(first.get("core:header_bytes", 0)),
        trailing_bytes=int(top.get("core:trailing_bytes", 0)),
        stated_samples=own.sample_count,
        sha512=None if sha512 is None else sha512.lower(),
    )
    return _Stream(
        file=file,
        exact_start=exact_start,
        states_counter="core:global_index" in first,
        time_uncertainty_s=own.time_uncertainty_s,
    )


def _extension(path: Path, top: Mapping[str, Any]) -> _Extension:
    prefix = f"{NAMESPACE}:"
    try:
        return _Extension.model_validate({k.removeprefix(prefix): v for k, v in top.items() if k.startswith(prefix)})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = "".join(character if character.isprintable() else "?" for character in str(first["loc"][0]))[:60]
        if first["type"] == "extra_forbidden":
            expected = f"one of {', '.join(_Extension.model_fields)}"
            raise InputFileError(path, f"global.{prefix}{key}", "an unknown key", expected) from error
        expected = first["msg"].removeprefix("Input should be ")
        raise InputFileError(path, f"global.{prefix}{key}", first["input"], expected) from error


def _form(path: Path, top: Mapping[str, Any]) -> SampleFormat:
    datatype = top["core:datatype"]
    if top.get("core:num_channels", 1) != 1:
        raise UnsupportedError(f"{path}: global.core:num_channels: only recordings of one channel are read")
    if (form := SIGMF_FORMATS.get(datatype)) is not None:
        return form
    if (reason := NOT_READ.get(datatype[1:].split("_")[0])) is not None:
        raise UnsupportedError(f"{path}: global.core:datatype {datatype[:8]} is not read: {reason}")
    raise InputFileError(path, "global.core:datatype", datatype, "a SigMF datatype such as ci8 or rf32_le")


def _ranged(path: Path, place: str, value: float | None, limits: tuple[float, float]) -> float:
    low, high = limits
    if value is None or not low <= value <= high:
        raise InputFileError(path, place, "nothing" if value is None else value, f"a number from {low:g} to {high:g}")
    return value


def _check_one_stretch(path: Path, captures: Sequence[Mapping[str, Any]], offset: int) -> None:
    """Check that the captures are continuous samples without gap or change of frequency."""
    first = captures[0]
    if first["core:sample_start"] != offset:
        found = first["core:sample_start"]
        raise InputFileError(path, "captures.0.core:sample_start", found, f"{offset}, the first sample of the data")
    for number, capture in enumerate(captures[1:], start=1):
        passed = capture["core:sample_start"] - first["core:sample_start"]
        expected = first.get("core:global_index", first["core:sample_start"]) + passed
        gap = capture.get("core:global_index", expected) != expected or capture.get("core:header_bytes", 0) != 0
        if gap or capture.get("core:frequency", first.get("core:frequency")) != first.get("core:frequency"):
            raise UnsupportedError(f"{path}: captures.{number}: a gap or another frequency; split the recording there")


def _data_file(path: Path, top: Mapping[str, Any]) -> Path:
    name = top.get("core:dataset")
    if name is None and top.get("core:metadata_only", False):
        raise InputFileError(path, "global.core:metadata_only", "metadata without samples", "a recording with samples")
    if name is None:
        return sample_file(path, "data", path.name.removesuffix(META) + DATA)
    return sample_file(path, "global.core:dataset", name)


def _start(path: Path, capture: Mapping[str, Any]) -> tuple[GalileoTime | None, bool]:
    """Return the time tag of a capture or None, and whether the time tag comes from `vestige:start_gst`."""
    key, label = "vestige:start_gst", None
    exact, coarse = capture.get("vestige:start_gst"), capture.get("core:datetime")
    try:
        if coarse is not None:
            key, label = "core:datetime", coarse
            rough = GalileoTime.parse(coarse.upper(), default_scale="UTC")
        if exact is None:
            return (None, False) if coarse is None else (rough, False)
        key, label = "vestige:start_gst", exact
        if not isinstance(exact, str):
            raise ValueError("not a string")
        time = GalileoTime.parse(exact)
    except (ValueError, OverflowError) as error:
        raise InputFileError(path, f"captures.0.{key}", label, "a time within Galileo System Time") from error
    if coarse is not None and abs(time - rough) > DATETIME_RESOLUTION_S:
        raise InputFileError(path, f"captures.0.{key}", exact, f"the same time as core:datetime, {coarse}")
    return time, True


def _aligned(streams: Sequence[_Stream]) -> dict[Band, BandFile]:
    """Return the bands with start times that agree with the counter that they share."""
    labelled = [stream for stream in streams if stream.file.start is not None]
    if not labelled:
        return {stream.file.band: stream.file for stream in streams}
    reference = next((stream for stream in labelled if stream.exact_start), labelled[0])
    return {s.file.band: s.file if s is reference else _counted(s, reference) for s in streams}


def _counted(stream: _Stream, reference: _Stream) -> BandFile:
    """Return a band with the start that the counter and the reference band give, if the band's own time tag agrees."""
    file, start = stream.file, reference.file.start
    assert start is not None  # noqa: S101  (the reference has a time tag)
    try:
        counted = started(file, start, reference.file)
    except ValueError as error:
        expected = "a counter that stays within Galileo System Time"
        raise InputFileError(file.described_in, "captures.0.core:global_index", file.first_sample, expected) from error
    if file.start is None or counted.start is None:
        return counted
    both_exact = stream.exact_start and reference.exact_start
    both_count = stream.states_counter and reference.states_counter
    tolerance = EXACT_AGREEMENT_S if both_exact else DATETIME_AGREEMENT_S if both_count else DATETIME_RESOLUTION_S
    if abs(file.start - counted.start) > tolerance:
        expected = f"{counted.start}, which follows from core:global_index and the other band"
        raise InputFileError(file.described_in, "captures.0 time tag", str(file.start), expected)
    return file if both_exact else counted
