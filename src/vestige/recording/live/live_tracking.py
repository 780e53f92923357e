"""Track E1 while samples arrive, to get observations, the navigation message and the error of the time tag.

The tracking receiver processes `TRACKED_STRETCH_S` of samples at a time. If no samples are lost, the results are the
same as for the finished recording, because the stretches begin at the same samples. Pseudoranges are ambiguous by
multiples of 100 ms until a navigation message has given the time. Observations wait for the time from the message,
which resolves the ambiguity. Observations that no RECS needs any more are dropped.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol

from vestige.errors import VestigeError
from vestige.recording.description import BandFile
from vestige.recording.live.received_message import ReceivedMessage
from vestige.recording.observations.observation_file import GAP_INTERVALS, ObservationTrack
from vestige.recording.samples.sample_stream import SampleStream
from vestige.recording.tracked.track_recording import with_code_periods
from vestige.records import SampleBatch
from vestige.records.observation_epoch import ObservationEpoch
from vestige.sample_processor.tracking.settings import TrackingSettings
from vestige.sample_processor.tracking.tracking_receiver import (
    EPOCHS_PER_S,
    TRACKED_STRETCH_S,
    TrackedStretch,
    TrackingReceiver,
)
from vestige.time import GalileoTime

AT_ONCE_S = 2.0  # duration in s of the samples that are tracked at once, before other input is read
# largest duration in s of the observations that wait for the time, which a message usually gives after 30 s
WITHOUT_PERIODS_S = 200.0
# time in s before the last verdict at which tracking resumes, to get a root key, orbits and the time
RETRACKED_S = 600.0


class TrackableSamples(Protocol):
    """E1 samples that were written so far."""

    @property
    def end_sample(self) -> int:
        """Number of the last sample plus 1."""

    def read(self, first: int, count: int) -> SampleBatch:
        """Return `count` samples from number `first` on."""


@dataclass(frozen=True, slots=True)
class StreamSamples:
    """E1 samples from a pipe, for tracking."""

    stream: SampleStream
    end_sample: int  # number of the last sample plus 1, at the latest look for new data

    def read(self, first: int, count: int) -> SampleBatch:
        """Return `count` samples from number `first` on, or the part after the gap if some samples were dropped."""
        found = self.stream.cut(first, first + count)
        while found is None:
            first = self.stream.next_after(first)
            found = self.stream.cut(first, min(first + count, self.end_sample))
        return found.read(found.first_sample, found.n_samples)


class LiveTracking:
    """The tracking receiver of a recording that grows.

    Parameters
    ----------
    file
        The E1 samples.
    message
        Message to which the pages are added.
    settings
        Loop settings, the same for all channels.
    workers
        Number of threads.
    warn
        Function that gets a warning if tracking had to start anew.

    Attributes
    ----------
    track
        Observations as a function of time, from the epochs that are kept.
    time_tag_error_s
        Error of the samples' time tag in s, positive if ahead of Galileo System Time; None until a message tells the
        time.
    end_sample
        Number of the last tracked sample plus 1.
    first_observed
        Time of the first epoch with an observation, by the receiver's clock; None if there is no such epoch yet.
    seen
        Satellites that were observed so far.
    """

    def __init__(
        self,
        file: BandFile,
        message: ReceivedMessage,
        *,
        settings: TrackingSettings | None = None,
        workers: int = 1,
        warn: Callable[[VestigeError], None],
    ) -> None:
        self.message = message
        self._file, self._warn = file, warn
        self._count = round(TRACKED_STRETCH_S * file.sample_rate_hz)
        self._receiver = TrackingReceiver(settings=settings or TrackingSettings(), workers=workers)
        self._pool = ThreadPoolExecutor(workers) if workers > 1 else None
        self._first = self.end_sample = file.first_sample
        self._epochs = _KeptEpochs()
        self._ended = False
        self.time_tag_error_s: float | None = None
        self.first_observed: GalileoTime | None = None
        self.seen: set[int] = set()
        self.track = ObservationTrack(self._epochs, max_gap_s=GAP_INTERVALS / EPOCHS_PER_S + 1e-6)

    @property
    def is_told(self) -> bool:
        """Whether a navigation message has given the time."""
        return self.time_tag_error_s is not None

    @property
    def tracked_s(self) -> float:
        """Duration of the samples that were tracked so far, in s."""
        return (self.end_sample - self._first) / self._file.sample_rate_hz

    def resume(self, seconds: float) -> None:
        """Begin tracking with the stretch at the time `seconds` − `RETRACKED_S` after the first sample.

        If this time is negative, tracking begins with the first stretch. The RECS in earlier samples already have
        verdicts.
        """
        stretches = max(math.floor((seconds - RETRACKED_S) / TRACKED_STRETCH_S), 0)
        self._first = self.end_sample = self._file.first_sample + stretches * self._count

    def is_behind(self, samples: TrackableSamples) -> bool:
        """Return whether a whole stretch of samples waits to be tracked."""
        return samples.end_sample - self.end_sample >= self._count

    def advance(self, samples: TrackableSamples) -> None:
        """Track up to `AT_ONCE_S` of the available samples."""
        for _ in range(round(AT_ONCE_S / TRACKED_STRETCH_S)):
            if not self.is_behind(samples):
                return
            self._take(samples.read(self.end_sample, self._count))

    def finish(self, samples: TrackableSamples) -> None:
        """Track the remaining samples, because no more samples will come."""
        while self.is_behind(samples):
            self._take(samples.read(self.end_sample, self._count))
        if not self._ended and samples.end_sample > self.end_sample:
            self._take(samples.read(self.end_sample, samples.end_sample - self.end_sample))
        if not self._ended:
            self._ended = True
            self.message.finish()
            if self._pool is not None:
                self._pool.shutdown()

    def _take(self, batch: SampleBatch) -> None:
        if batch.first_sample != self.end_sample:
            lost_s = (batch.first_sample - self.end_sample) / self._file.sample_rate_hz
            self._warn(
                VestigeError(f"{self._file.path}: E1: {lost_s:.3f} s of samples were lost; tracking starts anew")
            )
        self.end_sample = batch.first_sample + batch.samples.size
        if batch.samples.size:
            self.take(self._receiver.track(batch, self._pool), self._told_s())

    def take(self, stretch: TrackedStretch, told_s: float | None) -> None:
        """Add the observations of a stretch of samples, and store the error of the time tag after the stretch."""
        for epoch in stretch.epochs:
            if epoch.observations:
                self.first_observed = self.first_observed or epoch.time
                self.seen.update(epoch.observations)
        if told_s is None:
            self._epochs.wait(stretch.epochs)
        else:
            self.time_tag_error_s = told_s
            self._epochs.place(told_s)
            self._epochs.add(stretch.epochs)
        self.message.take(stretch.pages)

    def _told_s(self) -> float | None:
        return self._receiver.time_tag_error_s if self._receiver.time_is_told else None

    def place_by_time_tag(self) -> None:
        """Take the time from the time tag, whose error is known to be at most 40 ms, if no message tells the time."""
        self._epochs.place(self._receiver.time_tag_error_s)

    def release(self, before: GalileoTime) -> None:
        """Drop the observations before a time."""
        self._epochs.release(before)


class _KeptEpochs:
    """Observations that an `ObservationTrack` still needs, and observations that wait for the time."""

    def __init__(self) -> None:
        self._without_code_periods: deque[ObservationEpoch] = deque(maxlen=round(WITHOUT_PERIODS_S * EPOCHS_PER_S))
        self._placed: deque[ObservationEpoch] = deque()
        self.first = 0  # number of the first epoch in `_placed`

    def wait(self, epochs: Sequence[ObservationEpoch]) -> None:
        """Keep epochs until a message tells the time."""
        self._without_code_periods.extend(epochs)

    def add(self, epochs: Sequence[ObservationEpoch]) -> None:
        """Keep epochs whose pseudoranges are no longer ambiguous, because a message has told the time."""
        self._placed.extend(epochs)

    def place(self, time_tag_error_s: float) -> None:
        while self._without_code_periods:
            self._placed.append(with_code_periods(self._without_code_periods.popleft(), time_tag_error_s))

    def release(self, before: GalileoTime) -> None:
        while self._placed and self._placed[0].time < before:
            self._placed.popleft()
            self.first += 1

    def at(self, number: int) -> ObservationEpoch | None:
        place = number - self.first
        return self._placed[place] if place < len(self._placed) else None

    def __iter__(self) -> Iterator[ObservationEpoch]:
        return _EpochIterator(self)


class _EpochIterator:
    """Iterator that stops at the present end of the observations, and continues when more observations come."""

    def __init__(self, kept: _KeptEpochs) -> None:
        self._kept, self._number = kept, kept.first

    def __iter__(self) -> Iterator[ObservationEpoch]:
        return self

    def __next__(self) -> ObservationEpoch:
        self._number = max(self._number, self._kept.first)
        epoch = self._kept.at(self._number)
        if epoch is None:
            raise StopIteration
        self._number += 1
        return epoch
