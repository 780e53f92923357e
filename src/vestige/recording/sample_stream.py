"""Samples out of a pipe: the last seconds of them, from which windows are cut.

A thread reads, so that the recorder at the other end is not held up while a snapshot is processed. What was read waits
in blocks until somebody says that it is not needed any more; at `capacity_bytes` the thread stops reading, and what
then happens is up to the recorder: a program that plays a file waits, a receiver loses samples.
"""

from __future__ import annotations

import os
import threading
from collections import deque

from vestige.errors import InputFileError
from vestige.recording.description import BandFile
from vestige.recording.samples import SampleReader
from vestige.time import GalileoTime

BLOCK_BYTES = 1 << 20


class SampleStream:
    """Samples of one band out of a file descriptor; starts to read at once.

    Parameters
    ----------
    descriptor
        Open for reading.
    file
        What the samples are; its path names them in messages.
    capacity_bytes
        How much may wait.
    """

    def __init__(self, descriptor: int, file: BandFile, *, capacity_bytes: int) -> None:
        self.file = file
        self._descriptor = descriptor
        self._capacity = capacity_bytes
        self._blocks: deque[bytes] = deque()
        self._first_byte = 0  # of the blocks, in the stream
        self._end_byte = 0
        self._ended = False
        self._error: OSError | None = None
        self._changed = threading.Condition()
        threading.Thread(target=self._fill, name="samples", daemon=True).start()

    @property
    def ended(self) -> bool:
        """Whether the other end was closed.

        Raises
        ------
        InputFileError
            If reading failed.
        """
        if self._error is not None:
            found = self._error.strerror or "an error"
            raise InputFileError(self.file.path, "standard input", found, "samples") from self._error
        return self._ended

    @property
    def end_sample(self) -> int:
        """Number after that of the last whole sample, on the counter that the bands share."""
        read = max(self._end_byte - self.file.header_bytes, 0)
        return self.file.first_sample + read // self.file.form.sample_bytes

    @property
    def end(self) -> GalileoTime:
        """Receiver-clock time after the last whole sample."""
        return self._reader(0, b"").time_of(self.end_sample)

    def cut(self, first: int, end: int) -> SampleReader:
        """Return the samples from number `first` to before `end`, as far as they are still, or already, there."""
        size = self.file.form.sample_bytes
        origin = self.file.header_bytes - self.file.first_sample * size  # byte of sample 0 of the counter
        with self._changed:
            first = max(first, self.file.first_sample, -((origin - self._first_byte) // size))
            end = max(min(end, self.end_sample), first)
            pieces, at = [], self._first_byte
            for block in self._blocks:
                low, high = origin + first * size - at, origin + end * size - at
                if high > 0 and low < len(block):
                    pieces.append(block[max(low, 0) : high])
                at += len(block)
        return self._reader(first - self.file.first_sample, b"".join(pieces))

    def forget(self, before: int) -> None:
        """Let go of samples below a number."""
        byte = self.file.header_bytes + (before - self.file.first_sample) * self.file.form.sample_bytes
        with self._changed:
            while self._blocks and self._first_byte + len(self._blocks[0]) <= byte:
                self._first_byte += len(self._blocks.popleft())
            self._changed.notify_all()

    def wait(self, timeout_s: float) -> None:
        """Wait that long, or until there is no room for more, or no more comes."""
        with self._changed:
            self._changed.wait_for(lambda: self._ended or self._full, timeout_s)

    @property
    def _full(self) -> bool:
        return self._end_byte - self._first_byte >= self._capacity

    def _reader(self, skipped: int, held: bytes) -> SampleReader:
        n_samples = len(held) // self.file.form.sample_bytes
        return SampleReader(file=self.file, n_samples=n_samples, skipped=skipped, held=held)

    def _fill(self) -> None:
        while not self._ended:
            with self._changed:
                self._changed.wait_for(lambda: not self._full)
            block = b""
            try:
                block = os.read(self._descriptor, BLOCK_BYTES)
            except OSError as error:
                self._error = error
            with self._changed:
                self._blocks.append(block)
                self._end_byte += len(block)
                self._ended = not block
                self._changed.notify_all()
