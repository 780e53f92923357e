"""Buffer the last seconds of samples from a pipe, and cut windows of samples from the buffer.

A thread reads the pipe, so that the recorder does not wait while a snapshot is processed. The samples are buffered in
blocks, and `keep` drops the blocks that are no longer needed. When `capacity_bytes` are buffered, the thread stops
reading, so that a program that plays a file waits. For a receiver that cannot wait, the thread continues and drops
samples. Dropped samples are counted, so later samples keep their number and time.

The thread continues to read while samples are processed. So decisions about complete samples and about samples to drop
must use the result of the same call of `look`.
"""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from vestige.errors import InputFileError
from vestige.recording.description import BandFile
from vestige.recording.samples.sample_file import SampleReader

BLOCK_BYTES = 1 << 16  # largest size of a block, the capacity of a pipe; blocks are kept or dropped as a whole


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamState:
    """End of the samples that were read from a stream so far, and whether the stream has ended."""

    end_sample: int  # number of the last whole sample plus 1, on the counter that the bands share
    ended: bool  # whether no more samples can come


@dataclass(slots=True)
class _Block:
    first_byte: int  # number of the block's first byte in the stream
    content: bytearray

    @property
    def end_byte(self) -> int:
        return self.first_byte + len(self.content)


class SampleStream:
    """Samples of a band from a file descriptor, a named pipe or a function.

    A thread starts to read at once. The thread opens a named pipe, because opening waits for the writing program. A
    source that is a function gets the largest number of bytes to return, returns no bytes at the end, and may raise
    `OSError`. At most `capacity_bytes` are buffered. If the writer cannot wait (`can_wait` is False), samples are
    dropped when the buffer is full. A stream has the samples of a single channel. `recording.live.frame_splitter` makes
    a stream for each channel of a pipe with several channels.
    """

    def __init__(
        self, source: int | Path | Callable[[int], bytes], file: BandFile, *, capacity_bytes: int, can_wait: bool = True
    ) -> None:
        self.file = file
        self.capacity_bytes = capacity_bytes
        self.can_wait = can_wait
        self._source = source
        # number of the byte in the stream at which sample 0 begins or would begin
        self._origin = file.header_bytes - file.first_sample * file.form.sample_bytes
        self._blocks: deque[_Block] = deque()
        self._n_kept = 0  # number of bytes in the blocks
        self._end_byte = 0
        self._ended = False
        self._error: OSError | None = None
        self._crowded = False  # whether the buffer is full of samples that are still needed
        self._changed = threading.Condition()
        threading.Thread(target=self._fill, name="samples", daemon=True).start()

    def look(self) -> StreamState:
        """Return the end of the samples that were read so far, and whether the stream has ended.

        The function raises `InputFileError` if reading failed.
        """
        with self._changed:
            if self._error is not None:
                found = self._error.strerror or "an error"
                place = "standard input" if self.file.path == Path("-") else "pipe"
                raise InputFileError(self.file.path, place, found, "samples") from self._error
            read = max(self._end_byte - self.file.header_bytes, 0) // self.file.form.sample_bytes
            return StreamState(end_sample=self.file.first_sample + read, ended=self._ended)

    def cut(self, first: int, end: int) -> SampleReader | None:
        """Return the available samples from `first` to `end` − 1, or None if a sample in this range was dropped.

        Samples before the start of the stream, and samples that were not read yet, are left out.
        """
        low = max(self._byte(first), self.file.header_bytes)
        with self._changed:
            whole = self._end_byte - (self._end_byte - self.file.header_bytes) % self.file.form.sample_bytes
            high = max(min(self._byte(end), whole), low)
            pieces = [
                block.content[max(low - block.first_byte, 0) : high - block.first_byte]
                for block in self._blocks
                if block.end_byte > low and block.first_byte < high
            ]
        held = b"".join(pieces)
        return self._reader(low, held) if len(held) == high - low else None

    def next_after(self, first: int) -> int:
        """Return the number of the first sample after the first gap that ends after sample number `first`.

        If no gap ends after `first`, return the number after the last sample that was read.
        """
        size = self.file.form.sample_bytes
        with self._changed:
            ends = [high for _, high in self._gaps() if high > self._byte(first)]
            end = ends[0] if ends else self._end_byte
        return -((self._origin - end) // size)

    def nothing(self) -> SampleReader:
        """Return a reader without samples."""
        return self._reader(self.file.header_bytes, b"")

    def keep(self, windows: Iterable[tuple[int, int]], since: int) -> bool:
        """Drop each block of samples that has no sample in a window, and no sample at or after number `since`.

        A window that lost samples is useless, so the rest of the window is also dropped.

        Returns
        -------
        bool
            Whether the buffer has room for more samples. A full buffer gets room only if later calls keep fewer
            samples.
        """
        needed = sorted((max(self._byte(first), self.file.header_bytes), self._byte(end)) for first, end in windows)
        rest = self._byte(since)
        with self._changed:
            gaps = list(self._gaps())
            whole = deque((low, high) for low, high in needed if not any(a < high and low < b for a, b in gaps))
            kept: deque[_Block] = deque()
            for block in self._blocks:
                while whole and whole[0][1] <= block.first_byte:
                    whole.popleft()
                if block.end_byte > rest or (whole and whole[0][0] < block.end_byte):
                    kept.append(block)
            self._blocks, self._n_kept = kept, sum(len(block.content) for block in kept)
            self._crowded = self._full
            self._changed.notify_all()
            return not self._crowded

    def wait(self, timeout_s: float) -> None:
        """Wait until the stream ends or a buffer that had room becomes full, but at most `timeout_s`."""
        with self._changed:
            self._changed.wait_for(lambda: self._ended or (self._full and not self._crowded), timeout_s)

    @property
    def _full(self) -> bool:
        return self._n_kept + BLOCK_BYTES > self.capacity_bytes

    def _byte(self, sample: int) -> int:
        return self._origin + sample * self.file.form.sample_bytes

    def _gaps(self) -> Iterator[tuple[int, int]]:
        """Yield the beginning and the end of each gap: bytes that were read, but are not in the buffer."""
        end = 0
        for block in self._blocks:
            if block.first_byte > end:
                yield end, block.first_byte
            end = block.end_byte
        if self._end_byte > end:
            yield end, self._end_byte

    def _reader(self, first_byte: int, held: bytes) -> SampleReader:
        size = self.file.form.sample_bytes
        skipped = (first_byte - self.file.header_bytes) // size
        return SampleReader(file=self.file, n_samples=len(held) // size, skipped=skipped, held=held)

    def _fill(self) -> None:
        read: Callable[[int], bytes] | None = None
        while not self._ended:
            if self.can_wait:
                with self._changed:
                    self._changed.wait_for(lambda: not self._full)
            block, error = b"", None
            try:
                read = read or reading(self._source)
                block = read(BLOCK_BYTES)
            except OSError as failure:
                error = failure
            with self._changed:
                if not self._full:
                    self._append(block)
                self._end_byte += len(block)
                self._error, self._ended = error, not block
                self._changed.notify_all()

    def _append(self, read: bytes) -> None:
        last = self._blocks[-1] if self._blocks else None
        if last is not None and last.end_byte == self._end_byte and len(last.content) + len(read) <= BLOCK_BYTES:
            last.content += read  # small pieces are joined, because each block costs time
        else:
            self._blocks.append(_Block(self._end_byte, bytearray(read)))
        self._n_kept += len(read)


def reading(source: int | Path | Callable[[int], bytes]) -> Callable[[int], bytes]:
    """Return the function that reads a source: a file descriptor, a named pipe or a function.

    A named pipe is opened. A function is returned unchanged.

    The function raises `OSError` if the pipe cannot be opened.
    """
    if callable(source):
        return source
    descriptor = source if isinstance(source, int) else os.open(source, os.O_RDONLY)
    return partial(os.read, descriptor)
