"""Read samples from a file in pieces of any size, with only the requested piece in memory.

Pieces are requested by sample numbers on the counter that both bands share. At equal sampling rates, a sample number
means the same moment on E1 and E6. The samples have the same bits whether they are read in pieces or at once.
"""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Complex64, Shaped

from vestige.crypto.file_bytes import open_file
from vestige.errors import InputFileError
from vestige.recording.description import BandFile
from vestige.recording.exact_time import samples_later
from vestige.recording.samples.sample_format import decode
from vestige.records import Band, SampleBatch
from vestige.time import GalileoTime

_log = logging.getLogger(__name__)
BLOCK_SAMPLES = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleReader:
    """Reader of the samples of a band, as returned by `open_samples`."""

    file: BandFile
    n_samples: int  # number of whole samples in the file
    notes: tuple[str, ...] = ()  # unusual features of the file, one line each
    skipped: int = 0  # number of skipped samples at the beginning of the file
    # bytes of the samples, if the samples come from a stream that cannot be read again; None for a file
    held: bytes | None = field(default=None, repr=False)

    @property
    def band(self) -> Band:
        """Band of the samples."""
        return self.file.band

    @property
    def first_sample(self) -> int:
        """Number of the first sample on the shared counter."""
        return self.file.first_sample + self.skipped

    @property
    def end_sample(self) -> int:
        """Number of the last sample plus 1."""
        return self.first_sample + self.n_samples

    @property
    def duration_s(self) -> float:
        """Time that the samples span in s."""
        return self.n_samples / self.file.sample_rate_hz

    @property
    def start(self) -> GalileoTime:
        """Receiver-clock time of the first sample.

        The function raises `InputFileError` if the start is unknown.
        """
        return self.time_of(self.first_sample)

    def time_of(self, sample: int) -> GalileoTime:
        """Return the receiver-clock time of a sample number on the shared counter.

        The function raises `InputFileError` if the start is unknown.
        """
        if self.file.start is None:
            raise InputFileError(self.file.described_in, "start time", "nothing", "a time tag, or a start to be given")
        return samples_later(self.file.start, sample - self.file.first_sample, self.file.sample_rate_hz)

    def samples(self, first: int, count: int) -> Complex64[np.ndarray, " n_samples"]:
        """Return `count` samples from number `first` on, as complex64.

        The function raises `ValueError` if the file does not have all these samples. The function raises
        `InputFileError` if the samples cannot be read, or are not finite numbers.
        """
        if count < 0 or first < self.first_sample or first + count > self.end_sample:
            raise ValueError(
                f"found samples {first} to {first + count - 1}, expected {self.first_sample} to {self.end_sample - 1}"
            )
        file = self.file
        samples = decode(self._stored(first, count), file.form, inverted=file.spectral_inversion)
        if file.form.component == "float32" and not np.isfinite(samples).all():
            bad = int(np.flatnonzero(~np.isfinite(samples))[0])
            raise InputFileError(file.path, f"sample {first + bad}", str(samples[bad]), "a finite number")
        return samples

    def _stored(self, first: int, count: int) -> Shaped[np.ndarray, " n_components"]:
        file = self.file
        n_components = count * file.form.components_per_sample * file.form.channels
        if self.held is not None:
            offset = (first - self.first_sample) * file.form.frame_bytes
            return np.frombuffer(self.held, file.form.dtype, n_components, offset)
        offset = file.header_bytes + (first - file.first_sample) * file.form.frame_bytes
        try:
            stored = np.fromfile(file.path, dtype=file.form.dtype, count=n_components, offset=offset)
        except OSError as error:
            raise InputFileError(file.path, f"byte {offset}", error.strerror or "an error", "samples") from error
        if len(stored) != n_components:
            raise InputFileError(file.path, f"byte {offset}", f"{len(stored)} values", f"{n_components} values")
        return stored

    def read(self, first: int, count: int) -> SampleBatch:
        """Return a batch of `count` samples from number `first` on.

        The function raises the errors of `samples` and `start`.
        """
        return SampleBatch(
            band=self.band,
            samples=self.samples(first, count),
            sample_rate_hz=self.file.sample_rate_hz,
            center_frequency_hz=self.file.center_frequency_hz,
            first_sample=first,
            start=self.time_of(first),
        )

    def blocks(self, size: int = BLOCK_SAMPLES) -> Iterator[SampleBatch]:
        """Yield all samples in batches of `size` samples, of which the last batch may be shorter."""
        for first in range(self.first_sample, self.end_sample, size):
            yield self.read(first, min(size, self.end_sample - first))

    def hash_agrees(self) -> bool | None:
        """Read the file, and return whether its hash agrees with the description, or None if no hash is stated."""
        if self.file.sha512 is None:
            return None
        try:
            with self.file.path.open("rb") as stream:
                return hashlib.file_digest(stream, "sha512").hexdigest() == self.file.sha512
        except OSError as error:
            raise InputFileError(self.file.path, "file", error.strerror or "an error", "samples") from error


def samples_so_far(file: BandFile) -> SampleReader:
    """Return a reader of the samples that are complete so far in a file that another process still writes.

    The reader may have no samples.

    The function raises `InputFileError` if the file cannot be read.
    """
    _, count, _ = _size(file)
    return SampleReader(file=file, n_samples=max(count, 0))


def open_samples(file: BandFile) -> SampleReader:
    """Return the reader of a sample file, after a check of the file's length.

    The function raises `InputFileError` if the file cannot be read or has no sample.
    """
    size, count, rest = _size(file)
    if count < 1:
        expected = f"at least one sample of {file.form.frame_bytes} bytes"
        if skipped := file.header_bytes + file.trailing_bytes:
            expected += f" beside {skipped} bytes to skip"
        raise InputFileError(file.path, "length", f"{size} bytes", expected)
    notes = []
    if rest:
        notes.append(f"{file.path.name} ends in the middle of a sample: it was cut off, or is not {file.form}")
    if file.stated_samples is not None and file.stated_samples != count:
        notes.append(f"{file.path.name} has {count} samples, its description states {file.stated_samples}")
    _log.info("samples in %s: %d bytes, %d of %s", file.path, size, count, file.form)
    return SampleReader(file=file, n_samples=count, notes=tuple(notes))


def _size(file: BandFile) -> tuple[int, int, int]:
    """Return the size of a file in bytes, its number of complete frames, and the number of bytes of a partial frame."""
    if file.path.is_fifo():
        raise InputFileError(file.path, "samples", "a named pipe", "a file; a pipe is for vestige live")
    with open_file(file.path) as stream:
        size = os.fstat(stream.fileno()).st_size
    return size, *divmod(size - file.header_bytes - file.trailing_bytes, file.form.frame_bytes)
