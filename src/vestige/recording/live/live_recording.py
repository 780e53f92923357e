"""Read a recording that another process is still writing, from files or pipes.

Only `look` finds new data. Between two calls of `look` the ends of the samples do not change. Any window of a file can
be read at any time. For a pipe, `keep` gets the times of the RECS that still need a snapshot, and drops earlier samples
that neither these RECS nor tracking needs.

If E1 is tracked, the navigation message gives the error of the samples' time tag. The times that `LiveRecording`
returns are corrected for the error of the time tag as soon as this error is known.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from vestige.acas_processor.searches.vestigial import TRAVEL_TIME_S
from vestige.errors import InputFileError, VestigeError
from vestige.recording.description import RecordingDescription
from vestige.recording.live.live_tracking import LiveTracking, StreamSamples
from vestige.recording.observations.e1_observation import TIME_TAG_TOLERANCE_S
from vestige.recording.observations.growing_observations import GrowingObservations
from vestige.recording.observations.observation_file import ObservationTrack
from vestige.recording.recording import Recording, observation_names
from vestige.recording.samples.sample_file import SampleReader, samples_so_far
from vestige.recording.samples.sample_stream import SampleStream, StreamState
from vestige.recording.tracked.track_recording import MIN_TRACKED_S
from vestige.records import Band
from vestige.records.recs_block import SEGMENT_WINDOW_S
from vestige.sample_processor.e1_snapshot import E1_WINDOW_S
from vestige.time import GalileoTime

BEFORE_S = SEGMENT_WINDOW_S - TRAVEL_TIME_S[0] + 0.1
AFTER_S = SEGMENT_WINDOW_S + TRAVEL_TIME_S[1] + E1_WINDOW_S + 0.1
OBSERVED_BEFORE_S = 2.0  # duration in s of the observations that are kept before a RECS, for the interpolation
MOVED_S = 0.1  # largest move in s of a kept window when a message gives the error of the time tag
ROOM = 1.5  # smallest size of a buffer, as a multiple of the window of a RECS


class LiveRecording:
    """A recording that grows while it is processed.

    The constructor raises `InputFileError` if the recording has no E6 samples, or no time tag.

    Parameters
    ----------
    description
        Description of the recording.
    observations
        The file of E1 observations, which need not exist yet; None to measure E1 in the samples.
    replaceable
        Whether E1 is measured in the samples if the file of observations stays empty, as in a finished recording.
    streams
        The samples of the bands that come from pipes.
    tracking
        Tracking of E1, in place of a file of observations; None without tracking.
    told
        Whether the time tag is known to have an error of at most 40 ms, even without tracking.
    uncertainty_s
        Half width in s of the search window around the expected time of a RECS in the samples.
    warn
        Function that gets a warning of each faulty line of observations, of dropped samples, and of a pipe whose writer
        has to wait.

    Attributes
    ----------
    n_dropped
        Number of snapshots so far whose E6 samples came from a pipe and were dropped.
    full
        Whether a pipe cannot be read further before a waiting RECS has its snapshot.
    """

    def __init__(
        self,
        description: RecordingDescription,
        *,
        observations: Path | None,
        replaceable: bool = False,
        streams: Mapping[Band, SampleStream] | None = None,
        tracking: LiveTracking | None = None,
        told: bool = False,
        uncertainty_s: float = 0.0,
        warn: Callable[[VestigeError], None],
    ) -> None:
        if Band.E6 not in description.bands:
            raise InputFileError(description.path, "E6", "no samples", "E6 samples, in which the RECS are")
        self.description = description
        self._replaceable, self._warn = replaceable and Band.E1 in description.bands, warn
        self._streams = dict(streams or {})
        self.tracking, self._told = tracking, told
        self._before_s, self._after_s = BEFORE_S + uncertainty_s, AFTER_S + uncertainty_s
        self._observations = None if observations is None else GrowingObservations(observations, warn=warn)
        self.track = None if self._observations is None else ObservationTrack(self._observations)
        if tracking is not None:
            self.track = tracking.track
        self._readers: dict[Band, SampleReader] = {}
        self._read: dict[Band, StreamState] = {}
        # time in s by which the clock error extends the window of a RECS at the start and at the end; None if unknown
        self._clock_s: tuple[float, float] | None = None
        self._seen: tuple[int, ...] = ()
        self._told_held_up: set[Band] = set()
        self._kept_error_s: float | None = None  # first error of the time tag in s that tracking gave; None before
        self.n_dropped, self.full = 0, False
        self._look()
        self._tagged_start = SampleReader(
            file=description.bands[Band.E6], n_samples=0
        ).start  # raises an error if the recording has no time tag

    def look(self) -> bool:
        """Look for new samples, track some of the samples, and return whether new samples were found or tracked."""
        changed = self._look()
        if self.tracking is None:
            return changed
        before = self.tracking.end_sample
        self.tracking.advance(self._trackable)
        return changed or self.tracking.end_sample != before

    def _look(self) -> bool:
        files = {band: file for band, file in self.description.bands.items() if band not in self._streams}
        self._readers = {band: samples_so_far(file) for band, file in files.items()}
        self._read = {band: stream.look() for band, stream in self._streams.items()}
        ends = [reader.end_sample for reader in self._readers.values()]
        ends += [state.end_sample for state in self._read.values()]
        seen = (*ends, 0 if self._observations is None else self._observations.n_bytes)
        before, self._seen = self._seen, seen
        if any(now < then for now, then in zip(ends, before, strict=False)):
            raise InputFileError(self.description.path, "samples", "fewer than before", "a recording that grows")
        return seen != before

    def resume(self, after: GalileoTime, time_tag_error_s: float) -> None:
        """Skip the E1 samples of a file that RECS after `after` do not need, with the given time-tag error."""
        if self.tracking is not None and Band.E1 in self._readers:
            self.tracking.resume(after - self._readers[Band.E1].start + time_tag_error_s)

    @property
    def _trackable(self) -> SampleReader | StreamSamples:
        """E1 samples that are available for tracking."""
        stream = self._streams.get(Band.E1)
        return self._readers[Band.E1] if stream is None else StreamSamples(stream, self._read[Band.E1].end_sample)

    @property
    def time_tag_error_s(self) -> float:
        """Error of the samples' time tag in s, positive if ahead of Galileo System Time, or 0 if still unknown."""
        return 0.0 if self.tracking is None else self.tracking.time_tag_error_s or 0.0

    def observed(self) -> ObservationTrack | None:
        """Return the observations for a snapshot that no longer waits, or None to measure E1 in the samples.

        The function raises `InputFileError` if the recording has ended, `replaceable` is false, and the file of
        observations has no complete first line.
        """
        file = self._observations
        if self.tracking is not None:
            return self._tracked(self.tracking)
        if file is None or file.begun:
            return self.track
        if self._replaceable:
            self._warn(VestigeError(f"{file.missing()}; E1 is measured in the samples"))
            return None
        if file.ended:
            raise file.missing()
        self._warn(file.missing())
        return self.track

    def _tracked(self, tracking: LiveTracking) -> ObservationTrack | None:
        """Return the track of E1, empty if E1 has no ranges, or None if a short E1 is measured without tracking."""
        if tracking.time_tag_error_s is not None:
            return tracking.track
        if self.why_no_ranges:
            self._warn(VestigeError(self.why_no_ranges))
            return ObservationTrack(())
        if tracking.tracked_s < MIN_TRACKED_S and Band.E1 in self._readers:
            return None
        tracking.place_by_time_tag()
        return tracking.track

    @property
    def why_no_ranges(self) -> str:
        """Reason why tracked E1 has no ranges yet; "" if E1 has ranges, or is not tracked."""
        if self.tracking is None or self.tracking.is_told or self._told:
            return ""
        return (
            f"{self.description.path}: E1: no navigation message has given the time, and the time tag may be "
            f"wrong by more than {TIME_TAG_TOLERANCE_S:g} s (--time-uncertainty), so E1 has no ranges; record 30 s or "
            "more"
        )

    @property
    def start(self) -> GalileoTime:
        """Time of the first E6 sample."""
        return self._tagged_start + -self.time_tag_error_s

    @property
    def extent(self) -> str:
        """Text with the source, the duration and the start of the E6 samples so far."""
        span_s = self.end - self.start
        pipe = self.description.bands[Band.E6].path == Path("-")
        where = "standard input" if pipe else str(self.description.bands[Band.E6].path)
        return f"{where}: {span_s:g} s of E6 samples from {self.start} on" if span_s else f"{where}: no E6 sample"

    @property
    def end(self) -> GalileoTime:
        """Time after the last E6 sample."""
        return self._ends[Band.E6]

    @property
    def _ends(self) -> dict[Band, GalileoTime]:
        """Times after the last sample of each band."""
        late_s, ends = self.time_tag_error_s, {}
        for band, file in self.description.bands.items():
            count = self._readers[band].end_sample if band in self._readers else self._read[band].end_sample
            ends[band] = SampleReader(file=file, n_samples=0).time_of(count) + -late_s
        return ends

    @property
    def tracked(self) -> GalileoTime | None:
        """Time after the last E1 sample that was tracked; None if E1 is not tracked."""
        if self.tracking is None:
            return None
        e1 = SampleReader(file=self.description.bands[Band.E1], n_samples=0)
        return e1.time_of(self.tracking.end_sample) + -self.time_tag_error_s

    @property
    def ended(self) -> bool:
        """Whether all pipes have ended and no stretch of E1 waits to be tracked; always False without pipes."""
        return bool(self._read) and all(state.ended for state in self._read.values()) and not self.is_behind

    @property
    def is_behind(self) -> bool:
        """Whether a whole stretch of E1 samples waits to be tracked."""
        return self.tracking is not None and self.tracking.is_behind(self._trackable)

    def complete(self, sent: GalileoTime) -> bool:
        """Return whether the samples for a snapshot of the RECS sent at `sent` are all available and tracked."""
        ends = list(self._ends.values())
        if (tracked := self.tracked) is not None:
            ends.append(tracked)
        return min(ends) - sent >= self._span_s[1]

    def stalled(self, sent: GalileoTime) -> bool:
        """Return whether one band has all samples that a RECS may need, and all available samples are tracked.

        If `complete` is False, the other band has ended or is late, or its writer waits.
        """
        ends = self._ends
        late = max(ends.values()) - sent >= self._span_s[1] and not self.is_behind
        return late and len(ends) > 1

    def say_held_up(self, least_s: float) -> None:
        """Warn once for each band whose samples end at least `least_s` before the samples of the other band."""
        ends = self._ends
        for band, end in ends.items():
            behind_s = max(ends.values()) - end
            if behind_s >= least_s and band not in self._told_held_up:
                self._told_held_up.add(band)
                self._warn(
                    VestigeError(
                        f"{self.description.bands[band].path}: {band.name} samples are {behind_s:.1f} s behind the "
                        "other band; a RECS without samples of both bands has no verdict, or NOT_AVAILABLE"
                    )
                )

    def place(self, travel_s: Sequence[float]) -> None:
        """Update the limits of the clock error, on which the windows of RECS depend, from apparent travel times."""
        travel_s = [one - self.time_tag_error_s for one in travel_s]
        if travel_s:
            early, late = TRAVEL_TIME_S
            most_s = self._most_clock_s
            self._clock_s = (min(max(early - min(travel_s), 0.0), most_s), min(max(max(travel_s) - late, 0.0), most_s))

    def keep(self, sent: Sequence[GalileoTime], until: GalileoTime) -> None:
        """Drop the samples of a pipe that are no longer needed.

        Parameters
        ----------
        sent
            Known times of the RECS that still need a snapshot.
        until
            Time up to which the RECS are known.
        """
        if self.tracking is not None:
            self.tracking.release((min(sent) if sent else until) + (self.time_tag_error_s - OBSERVED_BEFORE_S))
        room = True
        for band, stream in self._streams.items():
            windows, (first, _) = [self._kept(one, band) for one in sent], self._kept(until, band)
            if self.tracking is not None and band is Band.E1:
                first = min(first, self.tracking.end_sample)
            everything = self._without_code_periods and stream.keep(windows, stream.file.first_sample)
            room &= everything or stream.keep(windows, first)
        self.full = not room

    @property
    def _without_code_periods(self) -> bool:
        """Whether the position of a RECS in the samples is still unknown, because the clock error is unknown."""
        if self.tracking is not None:
            return not self._told and not self.tracking.is_told
        return self._observations is not None and self._clock_s is None

    def recording(self, sent: GalileoTime) -> Recording:
        """Return the recording for the snapshot of the RECS sent at `sent`, and warn if samples were dropped."""
        readers = dict(self._readers)
        for band, stream in self._streams.items():
            found = stream.cut(*self._window(sent, band))
            if found is None:  # a part of the window is not enough for a search
                if band is Band.E6:
                    self._say_dropped(stream, sent)
                found = stream.nothing()
            readers[band] = found
        e1 = readers.get(Band.E1)
        if e1 is not None and not e1.n_samples:
            e1 = None
        return Recording(description=self.description, e1=e1, e6=readers.get(Band.E6), observations=None)

    def _say_dropped(self, stream: SampleStream, sent: GalileoTime) -> None:
        self.n_dropped += 1
        full = "" if stream.can_wait else "the buffer was full (--buffer-mb), or "
        self._warn(VestigeError(f"RECS of {sent}: the E6 samples were dropped: {full}the RECS came too late"))

    def wait(self, timeout_s: float) -> None:
        """Wait until another look for new data is useful, but at most `timeout_s`."""
        if self.is_behind:
            return
        stream = self._streams.get(Band.E6) or next(iter(self._streams.values()), None)
        if stream is None:
            time.sleep(timeout_s)
            return
        if self.full:
            then = (
                "the program that writes the pipe has to wait (for a receiver that cannot wait, give --real-time)"
                if stream.can_wait
                else "samples are dropped"
            )
            where = "standard input" if stream.file.path == Path("-") else stream.file.path
            self._warn(
                VestigeError(
                    f"{where}: the buffer is full of RECS whose keys or observations are not there yet: "
                    f"{then}; a larger --buffer-mb holds more"
                )
            )
        stream.wait(timeout_s)

    def finish(self) -> None:
        """Mark the recording as complete, and track the remaining samples."""
        if self._observations is not None:
            self._observations.end()
        if self.tracking is not None:
            self.tracking.finish(self._trackable)

    def _kept(self, sent: GalileoTime, band: Band) -> tuple[int, int]:
        """Return the window of a RECS to keep; with tracking, the first known time-tag error fixes this window."""
        if self.tracking is None:
            return self._window(sent, band)
        if self._kept_error_s is None and self.tracking.is_told:
            self._kept_error_s = self.time_tag_error_s
        error_s, margin_s = (0.0, MOVED_S) if self._kept_error_s is None else (self._kept_error_s, MOVED_S / 2)
        return self._samples(sent, band, error_s, (-self._before_s - margin_s, self._after_s + margin_s))

    def _window(self, sent: GalileoTime, band: Band) -> tuple[int, int]:
        """Return the number of the first sample that a RECS may need, and the number of the last such sample plus 1."""
        return self._samples(sent, band, self.time_tag_error_s, self._span_s)

    def _samples(self, sent: GalileoTime, band: Band, late_s: float, span_s: tuple[float, float]) -> tuple[int, int]:
        file = self.description.bands[band]
        since_s = sent - SampleReader(file=file, n_samples=0).start + late_s
        first, end = (file.first_sample + round((since_s + s) * file.sample_rate_hz) for s in span_s)
        return first, end

    @property
    def _span_s(self) -> tuple[float, float]:
        """Start and end of the samples that a RECS may need, in s after the transmission of the RECS."""
        early_s, late_s = self._clock_s or (0.0, 0.0)
        return -self._before_s - early_s, self._after_s + late_s

    @property
    def _most_clock_s(self) -> float:
        """Largest clock error in s for which the buffer has room, so that wrong observations cannot fill the buffer."""
        if not self._streams:
            return math.inf
        capacity_s = min(
            stream.capacity_bytes / stream.file.form.sample_bytes / stream.file.sample_rate_hz
            for stream in self._streams.values()
        )
        return max(capacity_s / ROOM - self._before_s - self._after_s, 0.0) / 2


def buffer_s(uncertainty_s: float) -> float:
    """Return the length in s of a pipe's buffer that is needed if the time of a RECS is known to ± `uncertainty_s`."""
    return ROOM * (BEFORE_S + AFTER_S + 2 * uncertainty_s)


def awaited_observations(description: RecordingDescription) -> Path | None:
    """Return a recording's file with the name of an observation file and no complete first line, or None."""
    return next((path for path in observation_names(description) if b"\n" not in _beginning(path)), None)


def _beginning(path: Path) -> bytes:
    with path.open("rb") as stream:
        return stream.readline(1 << 16)
