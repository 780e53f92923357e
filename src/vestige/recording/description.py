"""Describe a recording before any sample is read: file, sample format and start of each band.

A recording has up to two bands, which share one clock and one sample counter. Sample 0 of both bands belongs to the
same time. Sample n of a band comes n sampling intervals of that band after sample 0. A file may start at any sample
number (`first_sample`), so front ends that started at different times share the counter.

`center_frequency_hz` is the radio frequency that appears at 0 Hz in the *stored* samples. For example, a real IF
recording with a local oscillator at 1572.42 MHz has the value 1572.42e6. In the samples of this recording, E1 is at +3
MHz.
"""

from __future__ import annotations

import math
import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

from vestige.errors import InputFileError
from vestige.recording.exact_time import later
from vestige.recording.samples.sample_format import SampleFormat
from vestige.records import Band
from vestige.signals.definitions import CARRIER_HZ
from vestige.time import GalileoTime
from vestige.valid_numbers import require_time_uncertainty

# Smallest and largest plausible value of each number in a description.
SAMPLE_RATE_RANGE_HZ = (1e5, 1e10)
FIRST_SAMPLE = (0, 1 << 53)  # smallest and largest sample number; the largest number is 28 years at 10 MHz
TIME_UNCERTAINTY_S = (0.0, 1e6)


@dataclass(frozen=True, slots=True, kw_only=True)
class BandFile:
    """The sample file of one band."""

    band: Band
    path: Path
    described_in: Path  # the file that contains this description; error messages name this file
    form: SampleFormat
    sample_rate_hz: float
    center_frequency_hz: float  # radio frequency that appears at 0 Hz in the stored samples
    # whether the stored spectrum is inverted, so that the reader inverts the spectrum again
    spectral_inversion: bool = False
    first_sample: int = 0  # number of the file's first sample on the counter that the bands share
    start: GalileoTime | None = None  # time of the file's first sample on the receiver's clock; None if unknown
    bandwidth_hz: float | None = None  # two-sided bandwidth of the front end; None if not stated
    header_bytes: int = 0  # bytes before the first sample
    trailing_bytes: int = 0  # bytes after the last sample
    stated_samples: int | None = None  # number of samples as the description states it; None if not stated
    sha512: str | None = None  # hash of the file as the description states it, lower-case hex; None if not stated


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingDescription:
    """Description of a recording that is known before its samples are read."""

    path: Path  # the file that describes the recording, or the folder of the recording
    bands: Mapping[Band, BandFile]  # the sample file of each recorded band
    # upper limit of the error of the receiver's clock against Galileo System Time in s; infinite if not stated
    time_uncertainty_s: float = math.inf
    observations: Path | None = None  # file with E1 observations
    notes: tuple[str, ...] = ()  # notes for the user, one line each

    def __post_init__(self) -> None:
        require_time_uncertainty(self.time_uncertainty_s)

    @property
    def files(self) -> tuple[Path, ...]:
        """Return the path of the recording, its sample files, description files and observation file."""
        described = (path for file in self.bands.values() for path in (file.path, file.described_in))
        observations = () if self.observations is None else (self.observations,)
        return tuple(dict.fromkeys((self.path, *described, *observations)))


def band_of(center_frequency_hz: float, sample_rate_hz: float) -> Band | None:
    """Return the band whose carrier is in the sampled spectrum, or None if no carrier is in the spectrum.

    If two carriers are in the spectrum, the carrier nearer to the centre frequency counts.
    """
    band = min(CARRIER_HZ, key=lambda band: abs(center_frequency_hz - CARRIER_HZ[band]))
    return band if abs(center_frequency_hz - CARRIER_HZ[band]) <= sample_rate_hz / 2 else None


def sample_file(described_in: Path, place: str, name: str) -> Path:
    """Return the path of a file that a description names, relative to the description.

    The function raises `InputFileError` if there is no regular file or named pipe of that name.
    """
    path = described_in.parent / name
    try:
        mode = os.stat(path).st_mode  # noqa: PTH116  (Path.is_file lets some errors through)
        if stat.S_ISREG(mode) or stat.S_ISFIFO(mode):
            return path
        found = f"{name}, which is not a regular file"
    except (OSError, ValueError):  # the file does not exist, or its name is impossible
        found = f"{name}, which is not there"
    raise InputFileError(described_in, place, found, "the name of a file")


def counter_seconds(band: BandFile) -> Fraction:
    """Return the exact time from sample 0 of the counter to the file's first sample, in s."""
    return Fraction(band.first_sample) / Fraction(band.sample_rate_hz)


def redated(description: RecordingDescription, start: GalileoTime) -> RecordingDescription:
    """Return `description` with the earliest sample of the recording at `start`.

    The counter gives the start of the other band.
    """
    if not description.bands:
        return description
    earliest = min(description.bands.values(), key=counter_seconds)
    return replace(
        description, bands={band: started(file, start, earliest) for band, file in description.bands.items()}
    )


def started(file: BandFile, start: GalileoTime, reference: BandFile) -> BandFile:
    """Return `file` with the start that follows from the counter when the first sample of `reference` is at `start`."""
    return replace(file, start=later(start, counter_seconds(file) - counter_seconds(reference)))
