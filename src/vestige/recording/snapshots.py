"""Make snapshots from a recording, one for each time of transmission of RECS in the E6 samples.

A snapshot is made for every time of transmission whose RECS can arrive during the E6 samples. The E1 pseudoranges give
the arrival of each RECS. The E6 samples of a snapshot begin 1 ms before the first RECS arrives, and end 1 ms after the
last RECS has arrived, if the recording has these samples. The observations come from the observation file, from
tracking, or from 100 ms of E1 samples around the arrival of the RECS. Only short windows of samples are read, so a
recording may be far larger than memory.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypedDict

from vestige.acas_processor.searches.vestigial import TRAVEL_TIME_S
from vestige.constants import MAX_SVID, MEDIAN_TRAVEL_TIME_S, SPEED_OF_LIGHT_MPS
from vestige.recording.observations.e1_observation import observe
from vestige.recording.observations.observation_file import ObservationTrack
from vestige.recording.recorded_block import OtherChannels, tracked_block, with_correlators
from vestige.recording.recording import Recording
from vestige.recording.samples.front_end_power import front_end_status
from vestige.recording.samples.sample_file import SampleReader
from vestige.records import Assistance, Band, E1Observation, EncryptedSegment, FrontEndStatus, SampleBatch, Snapshot
from vestige.records.observation_epoch import ObservationEpoch
from vestige.records.snapshot_block import SnapshotBlock
from vestige.sample_processor.correlator import CorrelatableSamples
from vestige.sample_processor.e1_snapshot import E1_WINDOW_S, NOISE_FLOOR
from vestige.signals.definitions import E6C
from vestige.time import GalileoTime
from vestige.valid_numbers import require_time_uncertainty

MARGIN_S = 1e-3  # duration in s of E6 samples before and after the RECS, for hardware bias, correlators and E1 errors
ALL_SVIDS = range(1, MAX_SVID + 1)


class _E1AndFrontEnds(TypedDict, total=False):
    e1: SampleBatch | None
    front_end: Mapping[Band, FrontEndStatus]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSource:
    """Iterable of the snapshots of a recording, each as a `SnapshotBlock`.

    Attributes
    ----------
    recording
        The opened recording.
    assistance
        RECS, group delays, keys and corrections.
    tracked
        Observations from tracking the E1 samples, in place of an observation file; None if E1 was not tracked.
    time_uncertainty_s
        Upper limit of the receiver clock's error in s; None for the limit that the recording states.
    time_tag_error_s
        Error of the samples' time tag in s, positive if the time tag is ahead of Galileo System Time. The error comes
        from the navigation message or from `time_tag_search`. The error is needed to find a RECS in the recording, and
        to resolve the ambiguity of 100 ms in the E1 ranges.
    searchable
        Whether snapshots contain the E1 samples around the RECS and give access to all E6 samples. Mitigation levels 2
        and 3 need these samples for searches.
    cn0_estimator
        Name of the estimator for the C/N0 of E1 when E1 is measured in the samples; see `measure_e1`.
    channels
        Data of a second OSNMA channel and of inertial sensors; empty by default.
    progress
        Function that is called during long steps with the name of the step, the finished amount and the whole amount.

    Raises
    ------
    VestigeError
        If the time uncertainty is negative or NaN.

    Examples
    --------
    >>> import vestige as vs
    >>> assistance = vs.read_assistance("night/assistance").assistance
    >>> source = vs.RecordingSource(recording=vs.open_recording("night/"), assistance=assistance)
    >>> [(f"E{verdict.svid:02d}", verdict.status.name) for verdict in vs.AcasProcessor().run(source)]
    [('E11', 'AUTHENTIC')]
    """

    recording: Recording
    assistance: Assistance
    tracked: Sequence[ObservationEpoch] | None = None
    time_uncertainty_s: float | None = None
    time_tag_error_s: float = 0.0
    searchable: bool = False
    cn0_estimator: str = NOISE_FLOOR
    channels: OtherChannels = OtherChannels()  # noqa: RUF009  (frozen)
    progress: Callable[[str, int, int], None] | None = None

    def __post_init__(self) -> None:
        if self.time_uncertainty_s is not None:
            require_time_uncertainty(self.time_uncertainty_s)

    def __iter__(self) -> Iterator[SnapshotBlock]:
        """Yield a block for each snapshot, and for each other whole second at which E1 tracking has observations.

        The blocks of E1 tracking are made only if `tracked` is given and `searchable` is true. The checks of level 1 do
        not use E1 between two RECS.
        """
        between = deque(self.tracked if self.tracked is not None and self.searchable else ())
        since, index, last = None, 0, None
        for snapshot in self.snapshots():
            while between and between[0].time <= snapshot.time:
                last = between.popleft()
                if last.time.fraction == 0.0 and last.observations and last.time < snapshot.time:
                    yield self._tracked_block(index, last, since)
                    since, index = last.time, index + 1
            block = self.channels.block(replace(snapshot, index=index), self.assistance, since)
            yield block if last is None else with_correlators(block, last)
            since, index = snapshot.time, index + 1
        for epoch in between:
            if epoch.time.fraction == 0.0 and epoch.observations:
                yield self._tracked_block(index, epoch, since)
                since, index = epoch.time, index + 1

    def _tracked_block(self, index: int, epoch: ObservationEpoch, since: GalileoTime | None) -> SnapshotBlock:
        accelerations = self.channels.accelerations
        block = tracked_block(
            index,
            epoch,
            time_uncertainty_s=self._time_uncertainty_s,
            increments=None if accelerations is None else accelerations.increments(since, epoch.time),
        )
        return self.channels.joined(block, self.assistance, since)

    @property
    def _time_uncertainty_s(self) -> float:
        stated = self.time_uncertainty_s
        return self.recording.description.time_uncertainty_s if stated is None else stated

    def snapshots(self) -> Iterator[Snapshot]:
        """Yield one snapshot for each time of transmission that `epochs` returns."""
        observations = self.recording.observations if self.tracked is None else self.tracked
        track = ObservationTrack(observations) if observations is not None else None
        for index, (transmit_time, segments) in enumerate(self.epochs().items()):
            yield self.snapshot(index, transmit_time, segments, track)

    def epochs(self) -> dict[GalileoTime, tuple[EncryptedSegment, ...]]:
        """Return the RECS that can be in the E6 samples, by time of transmission."""
        span = time_span(self.recording, self.time_tag_error_s)
        if span is None:
            return {}
        epochs: dict[GalileoTime, tuple[EncryptedSegment, ...]] = {}
        for segment in self.assistance.segments:
            if span[0] <= segment.transmit_time <= span[1]:
                epochs[segment.transmit_time] = (*epochs.get(segment.transmit_time, ()), segment)
        return dict(sorted(epochs.items()))

    def snapshot(
        self,
        index: int,
        transmit_time: GalileoTime,
        segments: tuple[EncryptedSegment, ...],
        track: ObservationTrack | None,
    ) -> Snapshot:
        """Return the snapshot of the RECS that have one time of transmission.

        If `track` is None, the observations are measured in the E1 samples.
        """
        svids = frozenset(segment.svid for segment in segments)
        time, observations = self._observe(transmit_time, svids, track)
        duration_s = max(segment.n_chips for segment in segments) / E6C.chip_rate_hz
        batch = self._e6(transmit_time, observations, duration_s)
        return Snapshot(
            index=index,
            time=time,
            received_at=time if batch is None else batch.end,
            time_uncertainty_s=self._time_uncertainty_s,
            observations=observations,
            recs=svids,
            e6=None if batch is None else CorrelatableSamples(batch, self.recording.e6 if self.searchable else None),
            **(self._for_searches(transmit_time, batch) if self.searchable else {}),
        )

    def _for_searches(self, transmit_time: GalileoTime, e6: SampleBatch | None) -> _E1AndFrontEnds:
        """Return the E1 samples around the RECS, and the status of each front end from its samples."""
        e1 = None if self.recording.e1 is None else self._e1(self.recording.e1, transmit_time)
        readers = ((self.recording.e1, e1), (self.recording.e6, e6))
        status = {
            reader.band: front_end_status(batch, reader.file.form)
            for reader, batch in readers
            if reader is not None and batch is not None and batch.samples.size
        }
        return {"e1": e1, "front_end": status}

    def _e1(self, reader: SampleReader, transmit_time: GalileoTime) -> SampleBatch:
        return e1_window(reader, transmit_time + (MEDIAN_TRAVEL_TIME_S + self.time_tag_error_s))

    def _observe(
        self, transmit_time: GalileoTime, svids: frozenset[int], track: ObservationTrack | None
    ) -> tuple[GalileoTime, dict[int, E1Observation]]:
        if track is not None:
            time = transmit_time + (MEDIAN_TRAVEL_TIME_S + self.time_tag_error_s)
            return time, {svid: seen for svid, seen in track.at(time).items() if svid in svids}
        reader = self.recording.e1
        if reader is None:
            return transmit_time + MEDIAN_TRAVEL_TIME_S, {}
        window = self._e1(reader, transmit_time)
        step = self._step(f"E1 search for the RECS of {transmit_time}")
        return observe(
            window,
            sorted(svids),
            time_tag_error_s=self.time_tag_error_s,
            cn0_estimator=self.cn0_estimator,
            progress=step,
        )

    def _step(self, name: str) -> Callable[[int, int], None] | None:
        report = self.progress
        return None if report is None else lambda done, total: report(name, done, total)

    def _e6(
        self, transmit_time: GalileoTime, observations: dict[int, E1Observation], duration_s: float
    ) -> SampleBatch | None:
        if not observations:
            return None
        travel_s = [one.pseudorange_m / SPEED_OF_LIGHT_MPS for one in observations.values()]
        start = transmit_time + (min(travel_s) - MARGIN_S)
        return self.recording.batch(Band.E6, start, max(travel_s) - min(travel_s) + duration_s + 2 * MARGIN_S)


def time_span(
    recording: Recording, time_tag_error_s: float = 0.0, uncertainty_s: float = 0.0
) -> tuple[GalileoTime, GalileoTime] | None:
    """Return the earliest and the latest time of transmission of signals in the E6 samples, or None without E6 samples.

    The time tag of the samples is ahead of Galileo System Time by `time_tag_error_s` ± `uncertainty_s`, in s.
    """
    reader = recording.e6
    if reader is None:
        return None
    return (
        reader.start + (-TRAVEL_TIME_S[1] - time_tag_error_s - uncertainty_s),
        reader.start + (reader.duration_s - TRAVEL_TIME_S[0] - time_tag_error_s + uncertainty_s),
    )


def e1_window(reader: SampleReader, middle: GalileoTime) -> SampleBatch:
    """Return up to 100 ms of E1 samples around a time.

    Near an end of the recording, the window of samples is moved into the recording.
    """
    count = min(round(E1_WINDOW_S * reader.file.sample_rate_hz), reader.n_samples)
    wish = reader.first_sample + round((middle - reader.start) * reader.file.sample_rate_hz) - count // 2
    return reader.read(min(max(wish, reader.first_sample), reader.end_sample - count), count)


def svids_in_view(
    recording: Recording, svids: Iterable[int] = ALL_SVIDS, *, progress: Callable[[int, int], None] | None = None
) -> dict[int, E1Observation]:
    """Return the first E1 observations of `svids` in a recording; {} if the recording has no data of E1."""
    if recording.observations is not None:
        epoch = next(iter(recording.observations), None)
        return {} if epoch is None else {svid: one for svid, one in epoch.observations.items() if svid in set(svids)}
    if recording.e1 is None:
        return {}
    window = e1_window(recording.e1, recording.e1.start + E1_WINDOW_S / 2)
    return observe(window, svids, progress=progress)[1]
