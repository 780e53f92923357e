"""A recording that another process is still writing, as far as it goes: sample files, or E6 from a pipe.

`look` says what is new, and until the next look everything here is as of that moment. Out of files every window can be
read at any time. Out of a pipe `keep` says which RECS still need a snapshot; the samples of all others are let go.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from vestige.acas_processor.searches.vestigial import TRAVEL_TIME_S
from vestige.errors import InputFileError, VestigeError
from vestige.recording.description import RecordingDescription
from vestige.recording.observations.growing_observations import GrowingObservations
from vestige.recording.observations.observation_file import ObservationTrack
from vestige.recording.recording import Recording, observation_names
from vestige.recording.samples.sample_file import SampleReader, samples_so_far
from vestige.recording.samples.sample_stream import SampleStream, StreamState
from vestige.records import Band
from vestige.records.recs_block import SEGMENT_WINDOW_S
from vestige.sample_processor.e1_snapshot import E1_WINDOW_S
from vestige.time import GalileoTime

BEFORE_S = SEGMENT_WINDOW_S - TRAVEL_TIME_S[0] + 0.1
AFTER_S = SEGMENT_WINDOW_S + TRAVEL_TIME_S[1] + E1_WINDOW_S + 0.1
ROOM = 1.5  # windows that a buffer has to hold at least


class LiveRecording:
    """A recording that grows.

    Raises `InputFileError` if there are no E6 samples, or nothing tells their time.

    Parameters
    ----------
    description
        What it is.
    observations
        The file of E1 observations, which need not be there yet; None to measure them in the E1 samples.
    replaceable
        Whether E1 is measured in the samples if that file stays empty, as in a finished recording.
    stream
        The E6 samples, if they come from a pipe.
    uncertainty_s
        How far from their place a search may look for the RECS, in s.
    warn
        Is told what is wrong with a line of observations, which samples were dropped, and that the writer of a pipe is
        held up.

    Attributes
    ----------
    n_dropped
        Snapshots so far whose samples were read out of a pipe and dropped.
    full
        Whether nothing more can be read out of a pipe before a RECS that waits has its snapshot.
    """

    def __init__(
        self,
        description: RecordingDescription,
        *,
        observations: Path | None,
        replaceable: bool = False,
        stream: SampleStream | None = None,
        uncertainty_s: float = 0.0,
        warn: Callable[[VestigeError], None],
    ) -> None:
        if Band.E6 not in description.bands:
            raise InputFileError(description.path, "E6", "no samples", "E6 samples, in which the RECS are")
        self.description = description
        self._replaceable, self._warn = replaceable and Band.E1 in description.bands, warn
        self._stream = stream
        self._before_s, self._after_s = BEFORE_S + uncertainty_s, AFTER_S + uncertainty_s
        self._observations = None if observations is None else GrowingObservations(observations, warn=warn)
        self.track = None if self._observations is None else ObservationTrack(self._observations)
        self._readers: dict[Band, SampleReader] = {}
        self._read: StreamState | None = None
        self._clock_s: tuple[float, float] | None = None  # by how much earlier and later the latest observations are
        self._seen: tuple[int, ...] = ()
        self.n_dropped, self.full = 0, False
        self.look()
        self.start = SampleReader(file=description.bands[Band.E6], n_samples=0).start  # fails if nothing tells it

    def look(self) -> bool:
        """Look at what was written, and return whether there is more of it."""
        files = {band: file for band, file in self.description.bands.items() if self._stream is None or band is Band.E1}
        self._readers = {band: samples_so_far(file) for band, file in files.items()}
        ends = [reader.end_sample for reader in self._readers.values()]
        if self._stream is not None:
            self._read = self._stream.look()
            ends.append(self._read.end_sample)
        seen = (*ends, 0 if self._observations is None else self._observations.n_bytes)
        before, self._seen = self._seen, seen
        if any(now < then for now, then in zip(ends, before, strict=False)):
            raise InputFileError(self.description.path, "samples", "fewer than before", "a recording that grows")
        return seen != before

    def observed(self) -> ObservationTrack | None:
        """Return the observations to judge an epoch by that is not waited for any longer; None to measure E1 anew.

        Raises `InputFileError` if nothing more is written, and no observation was.
        """
        file = self._observations
        if file is None or file.begun:
            return self.track
        if self._replaceable:
            self._warn(VestigeError(f"{file.missing()}; E1 is measured in the samples"))
            return None
        if file.ended:
            raise file.missing()
        self._warn(file.missing())
        return self.track

    @property
    def extent(self) -> str:
        """How much of E6 there is, in words."""
        span_s = self.end - self.start
        where = "standard input" if self._stream is not None else str(self.description.bands[Band.E6].path)
        return f"{where}: {span_s:g} s of E6 samples from {self.start} on" if span_s else f"{where}: no E6 sample"

    @property
    def end(self) -> GalileoTime:
        """Receiver-clock time after the last E6 sample."""
        if self._read is not None:
            return SampleReader(file=self.description.bands[Band.E6], n_samples=0).time_of(self._read.end_sample)
        reader = self._readers[Band.E6]
        return reader.time_of(reader.end_sample)

    @property
    def ended(self) -> bool:
        """Whether no more samples can come; a file does not say so."""
        return self._read is not None and self._read.ended

    def complete(self, sent: GalileoTime) -> bool:
        """Return whether all samples are there that a snapshot of the RECS of a time may need."""
        ends = [reader.time_of(reader.end_sample) for reader in self._readers.values()] + [self.end]
        return min(ends) - sent >= self._span_s[1]

    def place(self, travel_s: Sequence[float]) -> None:
        """Take in how long signals are under way by the receiver's clock: its error places the windows of all RECS."""
        if travel_s:
            early, late = TRAVEL_TIME_S
            most_s = self._most_clock_s
            self._clock_s = (min(max(early - min(travel_s), 0.0), most_s), min(max(max(travel_s) - late, 0.0), most_s))

    def keep(self, sent: Sequence[GalileoTime], until: GalileoTime) -> None:
        """Let go of what was read out of a pipe and is not needed any more.

        Parameters
        ----------
        sent
            Times of the RECS that need a snapshot yet, as far as they are known.
        until
            Up to when they are known.
        """
        if self._stream is None:
            return
        windows, (first, _) = [self._window(one) for one in sent], self._window(until)
        unplaced = self._observations is not None and self._clock_s is None  # by how much the clock is wrong is unknown
        if unplaced and self._stream.keep(windows, self._stream.file.first_sample):
            self.full = False
        else:
            self.full = not self._stream.keep(windows, first)

    def recording(self, sent: GalileoTime) -> Recording:
        """Return the recording in which to process the RECS of a time; warns if its samples were dropped."""
        e6 = self._readers.get(Band.E6)
        if self._stream is not None:
            e6 = self._stream.cut(*self._window(sent))
            if e6 is None:  # a part of a window would be searched in vain
                self._say_dropped(self._stream, sent)
                e6 = self._stream.nothing()
        return Recording(description=self.description, e1=self._readers.get(Band.E1), e6=e6, observations=None)

    def _say_dropped(self, stream: SampleStream, sent: GalileoTime) -> None:
        self.n_dropped += 1
        full = "" if stream.can_wait else "the buffer was full (--buffer-mb), or "
        self._warn(VestigeError(f"RECS of {sent}: the E6 samples were dropped: {full}the RECS came too late"))

    def wait(self, timeout_s: float) -> None:
        """Wait until it is worth another look, at most so long."""
        if self._stream is None:
            time.sleep(timeout_s)
            return
        if self.full:
            then = (
                "the program that writes the pipe has to wait (a receiver that cannot wait: --real-time)"
                if self._stream.can_wait
                else "samples are dropped"
            )
            self._warn(
                VestigeError(
                    "standard input: the buffer is full of RECS whose keys or observations are not there yet: "
                    f"{then}; a larger --buffer-mb holds more"
                )
            )
        self._stream.wait(timeout_s)

    def finish(self) -> None:
        """Say that no more is written."""
        if self._observations is not None:
            self._observations.end()

    def _window(self, sent: GalileoTime) -> tuple[int, int]:
        """Return the first E6 sample and the end of what a RECS of a time may need."""
        file, since_s = self.description.bands[Band.E6], sent - self.start
        first, end = (file.first_sample + round((since_s + s) * file.sample_rate_hz) for s in self._span_s)
        return first, end

    @property
    def _span_s(self) -> tuple[float, float]:
        """From when to when the samples are that a RECS may need, after it was sent."""
        early_s, late_s = self._clock_s or (0.0, 0.0)
        return -self._before_s - early_s, self._after_s + late_s

    @property
    def _most_clock_s(self) -> float:
        """Clock error up to which windows fit into the buffer; an absurd observation must not fill it."""
        if self._stream is None:
            return math.inf
        file = self._stream.file
        capacity_s = self._stream.capacity_bytes / file.form.sample_bytes / file.sample_rate_hz
        return max(capacity_s / ROOM - self._before_s - self._after_s, 0.0) / 2


def buffer_s(uncertainty_s: float) -> float:
    """Return how many seconds of a pipe a buffer has to hold, the place of a RECS being known to ± `uncertainty_s`."""
    return ROOM * (BEFORE_S + AFTER_S + 2 * uncertainty_s)


def awaited_observations(description: RecordingDescription) -> Path | None:
    """Return the file of a recording's folder that will hold observations by its name, but has no first line yet."""
    return next((path for path in observation_names(description) if b"\n" not in _beginning(path)), None)


def _beginning(path: Path) -> bytes:
    with path.open("rb") as stream:
        return stream.readline(1 << 16)
