"""A recording that another process is still writing, as far as it goes: sample files, or E6 from a pipe.

`look` says what is new. Out of files every window can be read at any time. Out of a pipe the windows of RECS epochs are
cut when they are complete, and held until their snapshot was processed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from pathlib import Path

from vestige.acas_processor.vestigial import TRAVEL_TIME_S
from vestige.errors import InputFileError, VestigeError
from vestige.recording.description import RecordingDescription
from vestige.recording.growing_observations import GrowingObservations
from vestige.recording.observations import ObservationTrack
from vestige.recording.recording import Recording, observation_names
from vestige.recording.sample_stream import SampleStream
from vestige.recording.samples import SampleReader, samples_so_far
from vestige.recording.snapshots import E1_WINDOW_S
from vestige.records import Band
from vestige.records.recs_block import SEGMENT_WINDOW_S
from vestige.time import GalileoTime

BEFORE_S = SEGMENT_WINDOW_S - TRAVEL_TIME_S[0] + 0.1
AFTER_S = SEGMENT_WINDOW_S + TRAVEL_TIME_S[1] + E1_WINDOW_S + 0.1


class LiveRecording:
    """A recording that grows.

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
        Is told what is wrong with a line of observations.

    Raises
    ------
    InputFileError
        If there are no E6 samples, or nothing tells their time.
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
        self._held: dict[GalileoTime, SampleReader] = {}
        self._seen: tuple[int, ...] = ()
        self.look()
        self.start = SampleReader(file=description.bands[Band.E6], n_samples=0).start  # fails if nothing tells it

    def look(self) -> bool:
        """Look at what was written, and return whether there is more of it."""
        files = {band: file for band, file in self.description.bands.items() if self._stream is None or band is Band.E1}
        self._readers = {band: samples_so_far(file) for band, file in files.items()}
        ends = [reader.end_sample for reader in self._readers.values()]
        if self._stream is not None:
            ends.append(self._stream.end_sample)
        seen = (*ends, 0 if self._observations is None else self._observations.n_bytes)
        before, self._seen = self._seen, seen
        if any(now < then for now, then in zip(ends, before, strict=False)):
            raise InputFileError(self.description.path, "samples", "fewer than before", "a recording that grows")
        return seen != before

    def observed(self) -> ObservationTrack | None:
        """Return the observations to judge an epoch by that is not waited for any longer; None to measure E1 anew.

        Raises
        ------
        InputFileError
            If nothing more is written, and no observation was.
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
        if self._stream is not None:
            return self._stream.end
        reader = self._readers[Band.E6]
        return reader.time_of(reader.end_sample)

    @property
    def ended(self) -> bool:
        """Whether no more samples can come; a file does not say so."""
        return self._stream is not None and self._stream.ended

    def complete(self, sent: GalileoTime, travel_s: float = 0.0) -> bool:
        """Return whether all samples are there that a snapshot of the RECS of a time may need.

        Parameters
        ----------
        travel_s
            Longest time that one of them was under way by the receiver's clock, if it is known.
        """
        ends = [reader.time_of(reader.end_sample) for reader in self._readers.values()] + [self.end]
        return min(ends) - sent >= self._after_s + max(travel_s - TRAVEL_TIME_S[1], 0.0)

    def hold(self, sent: Iterable[GalileoTime]) -> None:
        """Cut the windows of the RECS of these times, all complete, out of a pipe; let go of what is before."""
        if self._stream is None:
            return
        for one in sent:
            if one not in self._held:
                self._held[one] = self._window(self._stream, one)
        span_s = self._before_s + self._after_s
        self._stream.forget(self._stream.end_sample - round(span_s * self._stream.file.sample_rate_hz))

    def recording(self, sent: GalileoTime) -> Recording:
        """Return the recording in which to process the RECS of a time."""
        e6 = self._readers.get(Band.E6)
        if self._stream is not None:
            e6 = self._held.get(sent) or self._window(self._stream, sent)
        return Recording(description=self.description, e1=self._readers.get(Band.E1), e6=e6, observations=None)

    def release(self, sent: GalileoTime) -> None:
        """Let go of the window of the RECS of a time."""
        self._held.pop(sent, None)

    def wait(self, timeout_s: float) -> None:
        """Wait until it is worth another look, at most so long."""
        if self._stream is None:
            time.sleep(timeout_s)
        else:
            self._stream.wait(timeout_s)

    def finish(self) -> None:
        """Say that no more is written."""
        if self._observations is not None:
            self._observations.end()

    def _window(self, stream: SampleStream, sent: GalileoTime) -> SampleReader:
        rate_hz, start = stream.file.sample_rate_hz, stream.file.first_sample
        since_s = sent - self.start
        first, end = (start + round((since_s + s) * rate_hz) for s in (-self._before_s, self._after_s))
        return stream.cut(first, end)


def buffer_s(uncertainty_s: float) -> float:
    """Return how many seconds of a pipe one RECS needs, its place being known to ± `uncertainty_s`."""
    return BEFORE_S + AFTER_S + 2 * uncertainty_s


def awaited_observations(description: RecordingDescription) -> Path | None:
    """Return the file of a recording's folder that will hold observations by its name, but has no first line yet."""
    return next((path for path in observation_names(description) if b"\n" not in _beginning(path)), None)


def _beginning(path: Path) -> bytes:
    with path.open("rb") as stream:
        return stream.readline(1 << 16)
