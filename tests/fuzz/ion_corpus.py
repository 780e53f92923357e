"""A recording that ION metadata describe, to be spoiled."""

from __future__ import annotations

from pathlib import Path

from fuzz.authority import START, files_of
from fuzz.engine import Files
from vestige.recording.description import BandFile, RecordingDescription
from vestige.recording.samples.ion_metadata_writer import write_ion_metadata
from vestige.recording.samples.sample_format import SampleFormat
from vestige.records import Band


def ion_recording() -> Files:
    """Return an `.sdrx` file and 40 bytes of samples of each band."""

    def write(folder: Path) -> None:
        bands = {}
        for band, center_hz in ((Band.E1, 1575.42e6), (Band.E6, 1278.75e6)):
            path = folder / f"{band.value}.bin"
            path.write_bytes(bytes(40))
            bands[band] = BandFile(
                band=band, path=path, described_in=folder, form=SampleFormat(component="int16", layout="iq"),
                sample_rate_hz=12.5e6, center_frequency_hz=center_hz, start=START, bandwidth_hz=1e7, header_bytes=4,
            )  # fmt: skip
        write_ion_metadata(folder / "recording.sdrx", RecordingDescription(path=folder, bands=bands))

    return files_of(write)
