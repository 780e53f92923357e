"""Yield the snapshots of a recording that is still being written, each when its data are complete or its wait is over.

Theory of operation
-------------------
A snapshot needs its RECS (usually downloaded days before), its samples, the E1 observations around its time, and the
OSNMA key. The key is complete 9 to 61 s after the samples were taken. With a second channel or with accelerometers, the
snapshot also waits for the keys and the accelerations of its time. A snapshot with all data equals the snapshot from
the finished recording, bit for bit. The reason is that the snapshot's samples cover the range of every search, and
later observations change nothing (`ObservationTrack.settled`).

Snapshots are yielded in the order of time, because the receiver state passes from each snapshot to the next. A snapshot
that waits for its key delays the later snapshots, but the keys of later snapshots also come later. A missing key must
not stop the receiver. So a snapshot with all samples waits at most `wait_s`, and longer only while samples wait to be
tracked. If the key is missing, the verdict states the missing key as its reason.

If E1 is tracked in the samples, tracking also gives the observations, the keys and the time of the recording. Then a
snapshot also waits for a navigation message that gives the time. A key counts as missing if tracking is `wait_s` past
the snapshot and the key has not come. In tracking, `wait_s` is in the time of the signal, so this limit does not depend
on the speed at which a file is read.

Samples from a pipe cannot be read again. After each look for new data, `LiveRecording.keep` gets the times of the RECS
that still need a snapshot. Every decision about samples refers to the data at the latest look for new data.

A file has no mark of its end. So a recording counts as finished after `idle_s` without new data. A recording from pipes
also counts as finished when all pipes have ended. After the end of the recording, the remaining snapshots are yielded
with the available data, as from a finished recording.
"""

from __future__ import annotations

import math
import time
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, replace

from vestige.acas_processor.searches.vestigial import TRAVEL_TIME_S
from vestige.constants import MEDIAN_TRAVEL_TIME_S, SPEED_OF_LIGHT_MPS, SUBFRAME_S
from vestige.recording.assistance.growing_assistance import GrowingAssistance
from vestige.recording.live.live_recording import LiveRecording
from vestige.recording.observations.accelerations import GrowingAccelerations
from vestige.recording.recorded_block import OtherChannels
from vestige.recording.snapshots import RecordingSource
from vestige.records import Assistance, EncryptedSegment, Snapshot
from vestige.records.recs_block import segments_between
from vestige.sample_processor.e1_snapshot import E1_WINDOW_S, NOISE_FLOOR
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class WaitLimits:
    """Limits of the waiting times, in s."""

    poll_s: float = 1.0  # time between two looks for new data
    wait_s: float = 180.0  # longest wait for the key and the observations of a snapshot with all samples
    idle_s: float | None = None  # time without new data that ends the recording; None to wait without limit


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowedEpoch:
    """A snapshot that no longer waits for data, with the assistance for its verdicts."""

    sent: GalileoTime  # time of transmission of the snapshot's RECS
    snapshot: Snapshot
    assistance: Assistance  # assistance that is known so far
    # OSNMA that the second channel has received so far, and the accelerations since the previous snapshot
    channels: OtherChannels
    time_tag_error_s: float = 0.0  # error of the receiver clock in s, positive if ahead of Galileo System Time


@dataclass(slots=True, kw_only=True)
class Following:
    """Snapshots of a recording that grows; the snapshots can be iterated over only once."""

    live: LiveRecording
    folder: GrowingAssistance
    second: GrowingAssistance | None = None  # folder of OSNMA keys of the second channel
    accelerations: GrowingAccelerations | None = None  # file of inertial sensors
    time_uncertainty_s: float  # upper limit of the receiver clock's error in s
    searchable: bool  # parameter `searchable` of `RecordingSource`
    cn0_estimator: str = NOISE_FLOOR  # parameter `cn0_estimator` of `RecordingSource`
    # delay of the receiver on E6 minus the delay on E1 in s, in place of the folder's value
    hardware_bias_s: float | None = None
    patience: WaitLimits
    index: int = 0  # number of the next snapshot
    after: GalileoTime | None = None  # time of the last RECS that no longer needs a snapshot; None at first

    def __iter__(self) -> Iterator[FollowedEpoch]:
        """Yield the snapshots in the order of time, and raise the errors of files that cannot be read."""
        complete_since: dict[GalileoTime, float] = {}
        news_s = time.monotonic()
        while True:
            if self._look(complete_since) or self.live.full:  # a full buffer stops the pipe, so no new data can come
                news_s = time.monotonic()
            while (epoch := self._next(complete_since, finished=False)) is not None:
                yield epoch
                news_s = time.monotonic()
                self._look(complete_since)
            if self.live.ended or self._is_idle(news_s):
                break
            self.live.wait(self.patience.poll_s)
        self.live.finish()
        self._look(complete_since, at_once=True)
        while (epoch := self._next(complete_since, finished=True)) is not None:
            yield epoch
            self._look(complete_since)
        for growing in (self.folder, self.second):
            if growing is not None:
                growing.tell()

    def _is_idle(self, news_s: float) -> bool:
        """Return whether the recording counts as finished, because no new data have come for `idle_s`.

        While samples wait to be tracked, the result is False, because this process causes the delay and not the writer.
        """
        idle_s = self.patience.idle_s
        return idle_s is not None and time.monotonic() - news_s >= idle_s and not self.live.is_behind

    def _look(self, complete_since: dict[GalileoTime, float], *, at_once: bool = False) -> bool:
        """Read new data, and return whether new data were found."""
        changed = self.live.look()
        self.live.say_held_up(self.patience.wait_s)
        changed |= self._look_at_folder(at_once=at_once)
        if self.second is not None:
            # RECS of the second channel's folder are not needed, because the second channel gives only keys
            changed |= self.second.look(self.live.start, self.live.start)
        if self.accelerations is not None:
            changed |= self.accelerations.look()
        for one in [one for one in complete_since if self.after is not None and one <= self.after]:
            del complete_since[one]
        to_come = self._to_come()
        for number, one in enumerate(to_come):
            if self.live.complete(one) or self.live.stalled(one) or (self.live.full and number == 0):
                complete_since.setdefault(one, time.monotonic())
        self.live.keep(to_come, self._known_until)
        return changed

    def _look_at_folder(self, *, at_once: bool) -> bool:
        begin = self.live.start + -TRAVEL_TIME_S[1]
        since = begin if self.after is None else self.after
        return self.folder.look(since, max(self.live.end, begin), at_once=at_once)

    @property
    def _known_until(self) -> GalileoTime:
        """Time of transmission up to which the RECS that may be in the samples are known."""
        return min(self.live.end + -TRAVEL_TIME_S[0], self.folder.until)

    def _to_come(self) -> list[GalileoTime]:
        """Return the times of the RECS that still need a snapshot and may be in the samples so far."""
        segments = self.folder.found.assistance.segments
        low = bisect_left(segments, self.live.start + -TRAVEL_TIME_S[1], key=_sent)
        if self.after is not None:
            low = max(low, bisect_right(segments, self.after, key=_sent))
        high = bisect_right(segments, self._known_until, key=_sent)
        return sorted({one.transmit_time for one in segments[low:high]})

    def _next(self, complete_since: dict[GalileoTime, float], *, finished: bool) -> FollowedEpoch | None:
        """Return the next snapshot if its data are complete, its wait is over, or no more data will come."""
        sent = next(iter(self._to_come()), None)
        if sent is None:
            return None
        if not finished:
            waited_s = time.monotonic() - complete_since.get(sent, math.inf)
            # the key may be in samples that are not tracked yet
            overdue = waited_s >= self.patience.wait_s and not self.live.is_behind
            if not self._is_ready(sent):
                if not (overdue or self._is_passed(sent)):
                    return None
                self._look_at_folder(at_once=True)  # missing data may have come since the last look
        return self._handed_out(sent)

    def _is_passed(self, sent: GalileoTime) -> bool:
        """Return whether tracking has passed a snapshot by `wait_s`, so that the snapshot's key should be known."""
        tracked = self.live.tracked
        return tracked is not None and self.live.complete(sent) and tracked - sent >= self.patience.wait_s

    def _is_ready(self, sent: GalileoTime) -> bool:
        """Return whether all data are available that the finished recording will contain for a snapshot."""
        return self.live.complete(sent) and self._has_keys(sent) and self._is_observed(sent) and self._is_sensed(sent)

    def _has_keys(self, sent: GalileoTime) -> bool:
        assistance = self.folder.found.assistance
        known = {key.time for key in assistance.keys}
        if not all(one.key_time in known for one in segments_between(assistance, sent, sent)):
            return False
        # The newest key that a finished recording compares with the second channel belongs to the subframe of the RECS.
        return self.second is None or any(sent - one.time < SUBFRAME_S for one in self.second.found.assistance.keys)

    def _is_observed(self, sent: GalileoTime) -> bool:
        """Return whether the observations are final, and the samples reach as far as the observations require."""
        track, at = self.live.track, sent + (MEDIAN_TRAVEL_TIME_S + self.live.time_tag_error_s)
        if track is None:
            return True
        if (self.live.tracking is not None and not self.live.tracking.is_told) or not track.settled(at):
            return False
        self.live.place([one.pseudorange_m / SPEED_OF_LIGHT_MPS for one in track.at(at).values()])
        return self.live.complete(sent)

    def _is_sensed(self, sent: GalileoTime) -> bool:
        """Return whether the accelerations reach the latest possible time of the snapshot."""
        return self.accelerations is None or self.accelerations.reaches(
            sent + (MEDIAN_TRAVEL_TIME_S + E1_WINDOW_S + self.live.time_tag_error_s)
        )

    def _handed_out(self, sent: GalileoTime) -> FollowedEpoch:
        assistance = self.folder.found.assistance
        if self.hardware_bias_s is not None:
            assistance = replace(assistance, hardware_bias_e1_e6_s=self.hardware_bias_s)
        source = RecordingSource(
            recording=self.live.recording(sent),
            assistance=assistance,
            time_uncertainty_s=self.time_uncertainty_s,
            time_tag_error_s=self.live.time_tag_error_s,
            searchable=self.searchable,
            cn0_estimator=self.cn0_estimator,
        )
        own = tuple(one for one in segments_between(assistance, sent, sent) if one.transmit_time == sent)
        snapshot = source.snapshot(self.index, sent, own, self.live.observed())
        self.index, self.after = self.index + 1, sent
        second = None if self.second is None else self.second.found.assistance
        sensed = None if self.accelerations is None else self.accelerations.found
        if self.accelerations is not None:
            self.accelerations.release(snapshot.time)
        return FollowedEpoch(
            sent=sent,
            snapshot=snapshot,
            assistance=assistance,
            channels=OtherChannels(second_channel=second, accelerations=sensed),
            time_tag_error_s=self.live.time_tag_error_s,
        )


def _sent(segment: EncryptedSegment) -> GalileoTime:
    return segment.transmit_time
