"""Read `recording.toml`, the description of a raw recording that is written by hand beside the sample files.

::

    start = "2021-11-25T00:40:00 UTC"     # receiver-clock time of sample 0; GST when no scale is given
    time_uncertainty_s = 1.0              # upper limit of the receiver clock's error against Galileo System Time
    sample_rate_hz = 12e6
    frame = ["e1", "e6"]                  # optional: both bands are in one file or pipe, see below
    [e1]
    file = "L1.bin"                       # relative to this file, or absolute
    format = "int8"                       # int8, uint8 (offset binary), int16, uint16, float32; little endian
    layout = "real"                       # real, iq, qi
    center_frequency_hz = 1572.42e6       # radio frequency that appears at 0 Hz in the samples
    [e6]
    file = "L6.bin"                       # "-": standard input, for vestige live
    format = "int8"
    layout = "iq"
    center_frequency_hz = 1278.75e6
    spectral_inversion = true             # optional, like all keys below
    bandwidth_hz = 8.7e6                  # bandwidth of the front end, two-sided
    first_sample = 0                      # number of the first sample on the shared counter
    header_bytes = 0                      # bytes to skip before the first sample
    sample_rate_hz = 12e6                 # if different from the other band's rate
    [observations]                        # optional
    file = "observations.rnx"             # RINEX 3 or 4, or CSV

With `frame` the file contains a sample of each band in turn, in the order of `frame`: `E1[0] E6[0] E1[1] E6[1] …`. Some
recorders with two front ends write such files. With `frame`, the tables `[e1]` and `[e6]` must have the same file,
format, layout, sampling rate, first sample and header. The example above shows every key, but a description with
`frame` has equal file names in both tables.

`start` may be left out if the caller gives the start when opening the recording. Unknown keys are errors.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vestige.crypto.file_toml import read_toml_file
from vestige.errors import InputFileError
from vestige.recording.description import (
    FIRST_SAMPLE,
    SAMPLE_RATE_RANGE_HZ,
    TIME_UNCERTAINTY_S,
    BandFile,
    RecordingDescription,
    band_of,
    counter_seconds,
    sample_file,
)
from vestige.recording.exact_time import later
from vestige.recording.samples.sample_format import Layout, SampleFormat, SampleType
from vestige.records import Band
from vestige.time import GalileoTime

NAME = "recording.toml"
STANDARD_INPUT = Path("-")
_MAX_BYTES = 1 << 20

SampleRate = Annotated[float, Field(ge=SAMPLE_RATE_RANGE_HZ[0], le=SAMPLE_RATE_RANGE_HZ[1])]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class _BandTable(_Table):
    file: str
    format: SampleType
    layout: Layout
    center_frequency_hz: Annotated[float, Field(gt=0, le=1e12)]
    spectral_inversion: bool = False
    bandwidth_hz: Annotated[float, Field(gt=0, le=1e12)] | None = None
    first_sample: Annotated[int, Field(ge=FIRST_SAMPLE[0], le=FIRST_SAMPLE[1])] = 0
    header_bytes: Annotated[int, Field(ge=0, le=1 << 40)] = 0
    sample_rate_hz: SampleRate | None = None


class _ObservationsTable(_Table):
    file: str


class _RecordingTable(_Table):
    start: str | None = None
    time_uncertainty_s: Annotated[float, Field(ge=TIME_UNCERTAINTY_S[0], le=TIME_UNCERTAINTY_S[1])] = math.inf
    sample_rate_hz: SampleRate
    frame: Annotated[list[Literal["e1", "e6"]], Field(min_length=2, max_length=2)] | None = None
    e1: _BandTable | None = None
    e6: _BandTable | None = None
    observations: _ObservationsTable | None = None


def read_recording_toml(path: Path) -> RecordingDescription:
    """Return the description of the recording in the file `path`.

    The function raises `InputFileError` if the file is not TOML, lacks a required key, has an unknown key, if a value
    or file name is not usable, or if the tables of the two bands do not fit together.
    """
    table = _table(path)
    start = None if table.start is None else _time(path, table.start)
    bands = {}
    for band, entry in ((Band.E1, table.e1), (Band.E6, table.e6)):
        if entry is not None:
            bands[band] = _band_file(path, band, entry, table.sample_rate_hz, start)
    if not bands:
        raise InputFileError(path, "e1, e6", "neither", "a table that describes the samples of at least one band")
    if table.frame is not None:
        bands = _framed(path, table.frame, bands)
    elif len(bands) == 2 and bands[Band.E1].path == bands[Band.E6].path:
        found = f"the same file for both bands, {bands[Band.E1].path}"
        raise InputFileError(path, "e1.file, e6.file", found, 'two files, or frame = ["e1", "e6"] if samples alternate')
    observations = None
    if table.observations is not None:
        observations = sample_file(path, "observations.file", table.observations.file)
    return RecordingDescription(
        path=path, bands=bands, time_uncertainty_s=table.time_uncertainty_s, observations=observations
    )


def recording_schema() -> dict[str, Any]:
    """Return the JSON schema of `recording.toml`, for editors and other programs.

    Examples
    --------
    >>> recording_schema()["required"]
    ['sample_rate_hz']
    """
    schema = _RecordingTable.model_json_schema()
    del schema["properties"]["time_uncertainty_s"]["default"]  # the default is infinite, which JSON cannot express
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | schema | {"title": "vestige recording.toml"}


def _table(path: Path) -> _RecordingTable:
    content = read_toml_file(path, at_most=_MAX_BYTES)
    try:
        return _RecordingTable.model_validate(content)
    except ValidationError as error:
        # A misspelt key may give two errors, unknown and missing; the message names the unknown key.
        first = min(error.errors(include_url=False), key=lambda one: one["type"] != "extra_forbidden")
        found, expected = first["input"], first["msg"]
        if first["type"] == "missing":
            found, expected = "nothing", "a value"
        elif first["type"] == "extra_forbidden":
            found, expected = "an unknown key", f"one of {', '.join(_known_keys(first['loc']))}"
        raise InputFileError(path, _place(first["loc"]), found, expected.removeprefix("Input should be ")) from error


def _known_keys(location: tuple[Any, ...]) -> list[str]:
    tables: dict[Any, type[_Table]] = {"e1": _BandTable, "e6": _BandTable, "observations": _ObservationsTable}
    return list((tables[location[0]] if len(location) > 1 else _RecordingTable).model_fields)


def _place(location: tuple[Any, ...]) -> str:
    text = ".".join(str(key) for key in location)
    return "".join(character if character.isprintable() else "?" for character in text)[:80]


def _time(path: Path, text: str) -> GalileoTime:
    try:
        return GalileoTime.parse(text)
    except (ValueError, OverflowError) as error:
        raise InputFileError(path, "start", text, "a time, such as 2021-11-25T00:40:00.5 UTC") from error


def _band_file(path: Path, band: Band, entry: _BandTable, sample_rate_hz: float, start: GalileoTime | None) -> BandFile:
    name = band.name.lower()
    rate = sample_rate_hz if entry.sample_rate_hz is None else entry.sample_rate_hz
    if band_of(entry.center_frequency_hz, rate) is not band:
        expected = f"the {band.name} carrier within half a sample rate ({rate / 2:g} Hz) of this frequency"
        raise InputFileError(path, f"{name}.center_frequency_hz", entry.center_frequency_hz, expected)
    file = BandFile(
        band=band,
        path=STANDARD_INPUT if entry.file == str(STANDARD_INPUT) else sample_file(path, f"{name}.file", entry.file),
        described_in=path,
        form=SampleFormat(component=entry.format, layout=entry.layout),
        sample_rate_hz=rate,
        center_frequency_hz=entry.center_frequency_hz,
        spectral_inversion=entry.spectral_inversion,
        first_sample=entry.first_sample,
        bandwidth_hz=entry.bandwidth_hz,
        header_bytes=entry.header_bytes,
    )
    return file if start is None else replace(file, start=later(start, counter_seconds(file)))


def _framed(path: Path, frame: list[Literal["e1", "e6"]], bands: dict[Band, BandFile]) -> dict[Band, BandFile]:
    """Return the bands as channels of one file.

    The function raises `InputFileError` if a band is missing or repeated, or if the tables differ in a value that the
    common file fixes.
    """
    order = [Band[name.upper()] for name in frame]
    if len(set(order)) < 2 or len(bands) < 2:
        found = f"{frame} and tables of {', '.join(band.name.lower() for band in bands)}"
        raise InputFileError(path, "frame", found, 'e1 and e6 once each, such as ["e1", "e6"], and a table for each')
    first, second = (bands[band] for band in order)
    for name, one, other in (
        ("file", first.path, second.path),
        ("format and layout", str(first.form), str(second.form)),
        ("sample_rate_hz", first.sample_rate_hz, second.sample_rate_hz),
        ("first_sample", first.first_sample, second.first_sample),
        ("header_bytes", first.header_bytes, second.header_bytes),
    ):
        if one != other:
            raise InputFileError(path, name, f"{one} and {other}", "the same for both bands, which share frames")
    return {
        band: replace(file, form=replace(file.form, channels=2, channel=order.index(band)))
        for band, file in bands.items()
    }
