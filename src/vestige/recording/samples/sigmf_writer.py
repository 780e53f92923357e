"""Write SigMF recordings batch by batch, with limited memory.

The samples go to a `.part` file that gets its final name when the recording is complete. The metadata are written last.
So a recording with metadata is always complete. An unfinished recording has no metadata. The parameter `kept` of
`SigmfWriter` lets a later run continue from the `.part` file.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
import sigmf
from jaxtyping import Num

from vestige.errors import InputFileError
from vestige.recording.exact_time import exact_gst
from vestige.recording.samples.sample_format import SampleFormat, encode
from vestige.recording.samples.sigmf_file import COLLECTION, DATA, META, NAMESPACE, NAMESPACE_VERSION
from vestige.records import SampleBatch
from vestige.time import GalileoTime

_BLOCK_BYTES = 1 << 22

Counted = Callable[[Num[np.ndarray, " n_components"]], int]


class SigmfWriter:
    """Writer of a SigMF recording of one band, for use in a `with` statement.

    The constructor raises `InputFileError` if the recording `base` exists already. The constructor also raises
    `InputFileError` if the `.part` file has fewer samples than `kept` states, or begins with other samples than the
    first batch in `kept`.

    Parameters
    ----------
    base
        Path of the recording without suffix. The writer makes the files `base.sigmf-data` and `base.sigmf-meta`.
    form
        Format of the stored samples, see `sample_format.encode`.
    scale
        Number that is stored for a real or imaginary part of 1.0.
    spectral_inversion
        Whether the writer stores the complex conjugate of each sample, and states an inverted spectrum in the metadata.
    bandwidth_hz
        Two-sided bandwidth of the front end in Hz.
    time_uncertainty_s
        Upper limit of the receiver clock's error against Galileo System Time in s.
    description
        Description of the recording for the user, a line of text.
    kept
        Data with which the writer continues the `.part` file of a killed process: the first batch of the recording,
        made again, and the number of samples to keep. Later samples in the file are cut off.
    counted
        Function that gets stored components (real or imaginary parts) and returns how many of these components count in
        `count_share`. The function also gets the components of kept samples.

    Attributes
    ----------
    count_share
        Share of the stored components that `counted` counted, from 0 to 1.
    """

    def __init__(
        self,
        base: Path,
        *,
        form: SampleFormat,
        scale: float = 1.0,
        spectral_inversion: bool = False,
        bandwidth_hz: float | None = None,
        time_uncertainty_s: float | None = None,
        description: str = "",
        kept: tuple[SampleBatch, int] | None = None,
        counted: Counted | None = None,
    ) -> None:
        self.meta = base.with_name(base.name + META)
        self.data = base.with_name(base.name + DATA)
        self._part = self.data.with_name(self.data.name + ".part")
        if kept is not None and self.data.exists():  # the process was killed after this band was complete
            self.data.rename(self._part)
        for path in (self.meta, self.data):
            _refuse_existing(path)
        own = {"bandwidth_hz": bandwidth_hz, "time_uncertainty_s": time_uncertainty_s}
        self._fields: dict[str, Any] = {f"{NAMESPACE}:{k}": v for k, v in own.items() if v is not None}
        self._fields |= {f"{NAMESPACE}:spectral_inversion": spectral_inversion, "core:datatype": form.sigmf_datatype}
        if description:
            self._fields["core:description"] = description
        self._form, self._scale, self._inverted = form, scale, spectral_inversion
        self._first: SampleBatch | None = None
        self._count = 0
        self._hash = hashlib.sha512()
        self._counted, self._n_counted = counted, 0
        self._stream: BinaryIO
        if kept is None:
            self._part.unlink(missing_ok=True)  # a killed run may have left the file
            self._stream = self._part.open("xb")  # mode "x" does not follow a link that an attacker prepared
        else:
            self._stream = self._part.open("r+b")
            self._go_on(*kept)

    def __enter__(self) -> SigmfWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self._part.unlink(missing_ok=True)  # the file is removed first, because closing may fail on a full disk
            self._stream.close()

    def _go_on(self, first: SampleBatch, n_samples: int) -> None:
        """Keep the first `n_samples` samples of the `.part` file, and cut off all later samples."""
        begin = self._encoded(first)
        left = n_samples * self._form.sample_bytes
        found = 0
        while found < left and (block := self._stream.read(min(_BLOCK_BYTES, left - found))):
            if found == 0 and block[: len(begin)] != begin[: len(block)]:
                self._stream.close()
                expected = "the samples that this command writes; the unfinished file is removed, so begin again"
                raise InputFileError(self._part, "first samples", "other samples", expected)
            self._look_at(block)
            found += len(block)
        if found < left:
            self._stream.close()
            raise InputFileError(
                self._part, "length", f"{found} bytes", f"{left} bytes; the unfinished file is removed, so begin again"
            )
        self._stream.seek(left)
        self._stream.truncate()
        self._first, self._count = first, n_samples

    def flush(self) -> None:
        """Write all samples that were appended so far to the disk."""
        self._stream.flush()
        os.fsync(self._stream.fileno())

    @property
    def count_share(self) -> float:
        """Share of the components stored so far that `counted` counted, from 0 to 1."""
        return self._n_counted / max(self._count * self._form.components_per_sample, 1)

    def _look_at(self, raw: bytes) -> None:
        """Add stored bytes to the hash of the file, and count the components in these bytes with `counted`."""
        self._hash.update(raw)
        if self._counted is not None:
            self._n_counted += self._counted(np.frombuffer(raw, self._form.dtype))

    def _encoded(self, batch: SampleBatch) -> bytes:
        return encode(batch.samples, self._form, scale=self._scale, inverted=self._inverted).tobytes()

    def append(self, batch: SampleBatch) -> None:
        """Write the samples of the next batch.

        The function raises `ValueError` if band, rate or centre frequency of the batch differ from those of the first
        batch. The function also raises `ValueError` if the batch does not begin at the sample after the previous batch,
        or if `sample_format.encode` refuses the samples.
        """
        if self._first is None:
            self._first = batch
        first = self._first
        for name in ("band", "sample_rate_hz", "center_frequency_hz"):
            if getattr(batch, name) != getattr(first, name):
                raise ValueError(f"{name} changes from {getattr(first, name)} to {getattr(batch, name)}")
        if batch.first_sample != first.first_sample + self._count:
            raise ValueError(f"batch starts at sample {batch.first_sample}, not {first.first_sample + self._count}")
        raw = self._encoded(batch)
        self._stream.write(raw)
        self._look_at(raw)
        self._count += len(batch.samples)

    def close(self) -> None:
        """Rename the sample file to its final name and write the metadata."""
        try:
            self._stream.close()
        except OSError:
            self._part.unlink(missing_ok=True)
            raise
        if self._first is None or self._count == 0:
            self._part.unlink(missing_ok=True)
            raise ValueError("a recording must have samples")
        first = self._first
        recording = sigmf.SigMFFile(
            global_info=self._fields
            | {
                "core:sample_rate": first.sample_rate_hz,
                "core:recorder": "vestige",
                "core:sha512": self._hash.hexdigest(),
                "core:extensions": [{"name": NAMESPACE, "version": NAMESPACE_VERSION, "optional": True}],
                f"{NAMESPACE}:sample_count": self._count,
            }
        )
        capture = {
            "core:global_index": first.first_sample,
            "core:frequency": first.center_frequency_hz,
            f"{NAMESPACE}:start_gst": exact_gst(first.start),
        }
        utc = first.start.utc
        if abs(GalileoTime.from_utc(utc) - first.start) < 1e-3:  # a datetime cannot express a leap second
            capture["core:datetime"] = utc.strftime("%Y-%m-%dT%H:%M:%S.%fZ")
        recording.add_capture(0, metadata=capture)
        recording.validate()
        self._part.rename(self.data)
        recording.tofile(self.meta)


def write_sigmf(base: Path, batches: Iterable[SampleBatch], *, form: SampleFormat, **options: Any) -> Path:
    """Write a whole recording of one band, and return the path of the metadata file.

    The options are parameters of `SigmfWriter`.
    """
    with SigmfWriter(base, form=form, **options) as writer:
        for batch in batches:
            writer.append(batch)
    return writer.meta


def write_collection(base: Path, metas: Sequence[Path]) -> Path:
    """Write the file `base.sigmf-collection`, which lists recordings, and return the path of the file.

    The function raises `InputFileError` if the file exists already. The function raises `ValueError` if a recording is
    not in the folder of `base`.
    """
    path = base.with_name(base.name + COLLECTION)
    _refuse_existing(path)
    if any(meta.parent != path.parent for meta in metas):
        raise ValueError("found a recording in another folder, expected all recordings in the folder of the collection")
    collection = sigmf.SigMFCollection(metafiles=[meta.name for meta in metas], base_path=path.parent)
    collection.tofile(path)
    return path


def _refuse_existing(path: Path) -> None:
    if path.exists():
        raise InputFileError(path, "file", "an existing file", "a new name")
