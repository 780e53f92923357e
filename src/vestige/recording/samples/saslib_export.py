"""Write keys and samples of a recording for GalileoSASlib [SASLIB], which reads the start time from the file name.

GalileoSASlib needs int16 I/Q samples and a file name with the UTC of the first sample, `YYYYMMDD_HHMMSSZ`. The keys are
a table with two columns. `epoch` is the start of the key's subframe in seconds since the start of Galileo System Time
(week · 604800 + TOW). `osnma_key` is the key in hexadecimal. GalileoSASlib reads RECS and group delays directly from
the assistance folder.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable
from pathlib import Path

from vestige.errors import UnsupportedError
from vestige.recording.assistance.folder import read_assistance
from vestige.recording.recording import Recording
from vestige.recording.samples.sample_file import SampleReader
from vestige.recording.samples.sample_format import SampleFormat
from vestige.records import Band

KEYS_TABLE = "osnma_keys.csv"
_SC16 = SampleFormat(component="int16", layout="iq")

_README = """\
GalileoSASlib, version 1.0:

  {samples}
      sc16 samples at {rate} Hz; sample_rate_hz = {rate} in SignalCorrelation
      the first sample is {late:.6f} s after the second in the name
  {keys}
      OSNMA keys, for tesla_keys_path or manual_xml_path
  ../assistance/
      RECS (*.bin, *.RCS) and group delays (*.BGD)
  satellites with encrypted E6-C
      {satellites}
"""


def export_saslib(recording: Recording, folder: Path, svids: Iterable[int]) -> tuple[Path, ...]:
    """Write samples, keys and a README.txt for GalileoSASlib into `folder`, and return their paths.

    The files of samples are hard links to the files of the recording, or copies if the file system has no hard links.

    Parameters
    ----------
    recording
        The recording, whose folder contains the keys.
    folder
        Folder inside the folder of the recording.
    svids
        SVIDs of the satellites in the recording.

    Raises
    ------
    UnsupportedError
        If the samples are not int16 I/Q, if their spectrum is reversed, or if a file has a header.
    OSError
        If a file cannot be written.
    """
    readers = [reader for reader in (recording.e1, recording.e6) if reader is not None]
    samples = [_samples(reader, folder) for reader in readers]
    keys = read_assistance(folder.parent).assistance.keys
    rows = [f"{key.time.gst_seconds},{key.data.hex().upper()}" for key in keys]
    table = folder / KEYS_TABLE
    table.write_text("\n".join(["epoch,osnma_key", *rows]) + "\n", "ascii", newline="\n")
    readme = folder / "README.txt"
    text = _README.format(
        samples=", ".join(path.name for path in samples),
        rate=f"{readers[0].file.sample_rate_hz:.10g}",
        late=readers[0].start.fraction,
        keys=table.name,
        satellites=",".join(str(svid) for svid in svids),
    )
    readme.write_text(text, "ascii", newline="\n")
    return (*samples, table, readme)


def check_saslib_form(form: SampleFormat) -> None:
    """Raise `UnsupportedError` if GalileoSASlib cannot read samples of the format `form`."""
    if form != _SC16:
        raise UnsupportedError(
            f"--export saslib: GalileoSASlib reads int16 I,Q, not {form}; write it with --format int16"
        )


def _samples(reader: SampleReader, folder: Path) -> Path:
    """Link the sample file of a band under a name with the start time of the samples; return the path of the link."""
    file = reader.file
    check_saslib_form(file.form)
    if file.spectral_inversion or file.header_bytes:
        raise UnsupportedError(f"{file.path}: GalileoSASlib reads upright samples without a header")
    path = folder / f"{Band(file.band).value}_{reader.start.utc:%Y%m%d_%H%M%SZ}.sc16"
    try:
        os.link(file.path, path)
    except OSError:  # the file system has no hard links
        shutil.copyfile(file.path, path)
    return path
