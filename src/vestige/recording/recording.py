"""Open a recording, and read the samples by band and time, and the E1 observations.

A recording is given as:

* a folder with a `recording.toml`, or the `recording.toml` itself (raw samples, described by hand);
* a folder with a `.sigmf-collection`, or the `.sigmf-collection` itself;
* a folder with a `.sigmf-meta` file for each band, or a single `.sigmf-meta` file;
* a folder with an `.sdrx` file, or the path of an `.sdrx` or `.xml` file: ION GNSS SDR metadata.

If a folder contains descriptions of several kinds, the first kind in this list is used. A recording may have a file of
E1 observations. `recording.toml` names this file. With any other description, the file is in the same folder. The first
line of the file of observations tells the format (RINEX or CSV).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from pathlib import Path

from vestige.errors import InputFileError, UnsupportedError
from vestige.recording.description import RecordingDescription, redated
from vestige.recording.observations.observation_file import ObservationFile, observation_kind, open_observations
from vestige.recording.recording_toml import NAME, read_recording_toml
from vestige.recording.samples.ion_metadata import ION_SUFFIX, ION_SUFFIXES, read_ion_metadata
from vestige.recording.samples.sample_file import SampleReader, open_samples
from vestige.recording.samples.sigmf_file import ARCHIVE, COLLECTION, DATA, META, read_collection, read_sigmf
from vestige.records import Band, SampleBatch
from vestige.time import GalileoTime

OBSERVATION_NAMES = re.compile(r".*\.(rnx|obs|csv|\d\do|crx|\d\dd)", re.IGNORECASE)
SAMPLE_TOLERANCE = 1e-3  # share of a sampling interval by which a time may differ from the exact time of a sample


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A recording whose samples can be read.

    Attributes
    ----------
    description
        Description of the samples; `time_uncertainty_s` is infinite if the recording states no time uncertainty.
    e1, e6
        Reader of the samples of each band; None if the band was not recorded. Sample numbers refer to the counter that
        both bands share.
    observations
        The file of E1 observations, or None.
    """

    description: RecordingDescription
    e1: SampleReader | None
    e6: SampleReader | None
    observations: ObservationFile | None

    def reader(self, band: Band) -> SampleReader | None:
        """Return the reader of the samples of a band, or None if the band was not recorded."""
        return self.e1 if band is Band.E1 else self.e6

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the recording for the user, one line each."""
        readers = [reader for reader in (self.e1, self.e6) if reader is not None]
        return self.description.notes + tuple(note for reader in readers for note in reader.notes)

    def batch(self, band: Band, start_time: GalileoTime, duration_s: float) -> SampleBatch | None:
        """Return the samples of a band in a window of receiver-clock time, or None if the window has none.

        The batch begins with the first sample at or after `start_time`. A sample up to a thousandth of a sampling
        interval before `start_time` is also included. The batch has ⌈`duration_s` · rate − 0.001⌉ samples, the same
        number for every position of the window. Samples outside the recording are left out. If samples are left out,
        `start`, `first_sample` and the length of the batch describe the remaining samples.

        The function raises `InputFileError` if the samples cannot be read. The function raises `ValueError` if
        `duration_s` is not positive and finite.
        """
        if not duration_s > 0 or math.isinf(duration_s):
            raise ValueError(f"found a window of {duration_s} s, expected a positive, finite duration")
        reader = self.reader(band)
        if reader is None:
            return None
        rate = reader.file.sample_rate_hz
        first = reader.first_sample + math.ceil((start_time - reader.start) * rate - SAMPLE_TOLERANCE)
        end = min(first + math.ceil(duration_s * rate - SAMPLE_TOLERANCE), reader.end_sample)
        first = max(first, reader.first_sample)
        return reader.read(first, end - first) if first < end else None


def find_recording(path: Path) -> Path | None:
    """Return the path of the description of the recording at `path`, or None without a description.

    If a folder has `.sigmf-meta` files, but no `recording.toml` and no collection, the path of the folder is returned.

    The function raises `InputFileError` if a folder without `recording.toml` has more than one collection, or more than
    one `.sdrx` file and no SigMF. The function raises `UnsupportedError` for a SigMF archive.
    """
    if path.is_file():
        if path.suffix == DATA:
            path = path.with_suffix(META)
        if path.suffix == ARCHIVE:
            raise UnsupportedError(f"{path}: SigMF archives are not read; unpack it with tar")
        return path if path.suffix in (".toml", META, COLLECTION, *ION_SUFFIXES) else None
    if not path.is_dir():
        return None
    if (path / NAME).is_file():
        return path / NAME
    if collection := _only(path, COLLECTION, "collection"):
        return collection
    return path if any(path.glob(f"*{META}")) else _only(path, ION_SUFFIX, "ION metadata file")


def _only(folder: Path, suffix: str, what: str) -> Path | None:
    """Return the only file with a suffix in a folder, or None."""
    found = sorted(folder.glob(f"*{suffix}"))
    if len(found) > 1:
        names = ", ".join(one.name for one in found)
        raise InputFileError(folder, "folder", names, f"one {what}; name the file to use")
    return found[0] if found else None


def describe_recording(path: Path) -> RecordingDescription:
    """Return the description of the recording at `path` without reading samples.

    The function raises `InputFileError` if there is no recording, if a description is not usable, or if the folder has
    several files of E1 observations. The function raises `UnsupportedError` if the description is valid, but of a kind
    that vestige does not read.
    """
    found = find_recording(path)
    if found is None:
        expected = f"a {NAME}, {COLLECTION}, {META} or {ION_SUFFIX} file, or a folder with one"
        raise InputFileError(path, "recording", "no description of samples" if path.exists() else "nothing", expected)
    if found.suffix == ".toml":
        return read_recording_toml(found)
    if found.suffix == COLLECTION:
        description = read_collection(found)
    elif found.suffix in ION_SUFFIXES:
        description = read_ion_metadata(found)
    else:
        metas = sorted(found.glob(f"*{META}")) if found.is_dir() else [found]
        description = read_sigmf(metas, described_in=found)
    return replace(description, observations=find_observations(found if found.is_dir() else found.parent))


def find_observations(folder: Path) -> Path | None:
    """Return the only file of E1 observations in a folder, or None.

    The function raises `InputFileError` if there are several files of E1 observations.
    """
    paths = [
        path for path in sorted(folder.iterdir()) if OBSERVATION_NAMES.fullmatch(path.name) and observation_kind(path)
    ]
    if len(paths) > 1:
        expected = "one file of E1 observations"
        raise InputFileError(folder, "observations", " and ".join(path.name for path in paths), expected)
    return paths[0] if paths else None


def named_observations(description: RecordingDescription) -> bool:
    """Return whether only the description can name the observation file, so that the folder is not searched."""
    return description.path.suffix == ".toml" or description.path == Path("-")


def observation_names(description: RecordingDescription) -> list[Path]:
    """Return the files of a recording's folder with names of observation files; [] if the folder is not searched."""
    if named_observations(description):
        return []
    folder = description.path if description.path.is_dir() else description.path.parent
    return [path for path in sorted(folder.iterdir()) if OBSERVATION_NAMES.fullmatch(path.name) and path.is_file()]


def unread_observations(description: RecordingDescription) -> tuple[InputFileError, ...]:
    """Return the errors of files whose names contain `obs` and suit an observation file, but whose contents do not."""
    wrong = []
    for path in observation_names(description):
        if "obs" in path.name.lower():
            try:
                open_observations(path)
            except InputFileError as error:
                wrong.append(error)
    return tuple(wrong)


def open_recording(path: Path | str, *, start: GalileoTime | None = None) -> Recording:
    """Return the recording at `path`, ready to be processed.

    Samples are read only when they are requested, so a recording may be larger than memory.

    Parameters
    ----------
    path
        Folder of the recording, or its description: `recording.toml`, SigMF or ION metadata.
    start
        Receiver-clock time of the earliest sample, used in place of the time tags of the recording.

    Returns
    -------
    Recording
        Readers of E1 and E6, E1 observations if there are any, and the description.

    Raises
    ------
    InputFileError
        If there is no recording, if its description, samples or file of E1 observations are not usable, or if neither
        the description nor `start` gives the time.
    UnsupportedError
        If the description is valid, but of a kind that vestige does not read.

    Examples
    --------
    >>> import vestige as vs
    >>> recording = vs.open_recording("night/")
    >>> sorted(band.value for band in recording.description.bands)
    ['E1', 'E6']
    >>> recording.e6.file.sample_rate_hz
    6200000.0
    """
    description = describe_recording(Path(path))
    if start is not None:
        description = redated(description, start)
    readers = {band: open_samples(file) for band, file in description.bands.items()}
    for reader in readers.values():
        _ = reader.start  # an unknown time raises an error here, and not only at the first sample
    observations = None if description.observations is None else open_observations(description.observations)
    if observations is None:
        notes = tuple(f"{wrong}; not used" for wrong in unread_observations(description))
        description = replace(description, notes=description.notes + notes)
    return Recording(
        description=description, e1=readers.get(Band.E1), e6=readers.get(Band.E6), observations=observations
    )
