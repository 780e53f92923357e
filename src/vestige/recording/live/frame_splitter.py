"""Split the samples of several channels in a common pipe, so that each channel is read as if from its own pipe.

A recorder with two front ends writes frames with one sample of each channel: `E1[0] E6[0] E1[1] E6[1] …`. Each channel
has a thread that reads the channel. If a thread has no data for its channel, the thread reads the pipe for all
channels. Bytes that the other threads have not taken yet are buffered. If the buffer of a channel has `WAITING_BYTES`
or more, the thread waits for the other threads before the next read.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable

import numpy as np

# number of waiting bytes of a channel at which the pipe is not read further; the buffers of the streams come in
# addition
WAITING_BYTES = 1 << 20
_BLOCK_FRAMES = 1 << 15


class FrameSplitter:
    """Splitter of the frames of a pipe into channels.

    An incomplete frame at the end is dropped.

    Parameters
    ----------
    read
        Function that returns at most the given number of bytes from the pipe, and no byte at the end of the pipe. The
        function may wait, and may raise `OSError`.
    sample_bytes
        Bytes of one sample, the same for all channels.
    n_channels
        Number of samples in a frame.
    wanted
        The channels that are read; samples of other channels are dropped. None for all channels.
    header_bytes
        Bytes before the first frame, which are skipped.

    Examples
    --------
    >>> pieces = iter([b"aAbB", b"cC", b""])
    >>> splitter = FrameSplitter(lambda n: next(pieces), sample_bytes=1, n_channels=2, wanted=[1])
    >>> splitter.read(1, 10), splitter.read(1, 10), splitter.read(1, 10)
    (b'AB', b'C', b'')
    """

    def __init__(
        self,
        read: Callable[[int], bytes],
        *,
        sample_bytes: int,
        n_channels: int,
        wanted: Iterable[int] | None = None,
        header_bytes: int = 0,
    ) -> None:
        self._read = read
        self._sample_bytes, self._n_channels, self._header = sample_bytes, n_channels, header_bytes
        self._parts = {one: bytearray() for one in (range(n_channels) if wanted is None else wanted)}
        self._rest = b""  # incomplete frame at the end of the bytes that were read
        self._reading = self._ended = False
        self._error: OSError | None = None
        self._changed = threading.Condition()

    def read(self, channel: int, at_most: int) -> bytes:
        """Return the next bytes of a channel as soon as bytes are available, or no bytes at the end of the pipe.

        The function raises `OSError` if the pipe could not be read.
        """
        part = self._parts[channel]
        while True:
            with self._changed:
                self._changed.wait_for(lambda: part or self._ended or (not self._reading and not self._crowded))
                if part:
                    found = bytes(part[:at_most])
                    del part[:at_most]
                    self._changed.notify_all()
                    return found
                if self._error is not None:
                    raise self._error
                if self._ended:
                    return b""
                self._reading = True
            self._take()

    @property
    def _crowded(self) -> bool:
        return any(len(part) >= WAITING_BYTES for part in self._parts.values())

    def _take(self) -> None:
        """Read some frames from the pipe, and append the samples to the buffers of the channels.

        Only one thread reads at a time. The reading thread does not hold the lock during the read.
        """
        block, error = b"", None
        try:
            block = self._read(_BLOCK_FRAMES * self._n_channels * self._sample_bytes)
        except OSError as failure:
            error = failure
        ended = not block
        skipped = min(self._header, len(block))
        self._header -= skipped
        frame_bytes = self._n_channels * self._sample_bytes
        block = self._rest + block[skipped:]
        whole = len(block) - len(block) % frame_bytes
        self._rest = block[whole:]
        frames = np.frombuffer(block, np.dtype((np.void, self._sample_bytes)), whole // self._sample_bytes)
        frames = frames.reshape(-1, self._n_channels)
        with self._changed:
            for channel in self._parts:
                self._parts[channel] += frames[:, channel].tobytes()
            self._reading, self._ended, self._error = False, ended, error
            self._changed.notify_all()
