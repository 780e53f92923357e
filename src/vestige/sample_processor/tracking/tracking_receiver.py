"""Acquire satellites in a stream of E1 samples, track the satellites, and read their messages.

`TrackingReceiver.run` takes the samples in consecutive pieces. The result does not depend on the lengths of the pieces.
The receiver looks for all satellites at the beginning. Later, the receiver looks for one untracked satellite every 5 s
(`search_every_s`). Three of four searches for untracked satellites prefer satellites that are above the horizon
according to the almanac of the message (`outlook.py`). Lost satellites are searched once per second for about two
minutes, around their last Doppler. Observables are computed at the multiples of 1/`epochs_per_s` s on the receiver's
clock.

The time of transmission becomes known in steps. The secondary code gives the time of transmission modulo 100 ms. The
message usually gives the complete time within 30 s. Until a message of some satellite has given the time, the
receiver's clock resolves the ambiguity of 100 ms (`time_tag_error_s`). Later, the median clock error of the satellites
with a known time resolves the ambiguity of all other satellites. The median is close enough, because the travel times
differ by less than 25 ms.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Complex64

from vestige.constants import E1_CODE_PERIOD_S, MAX_SVID, MEDIAN_TRAVEL_TIME_S, SECONDARY_PERIOD_S, SPEED_OF_LIGHT_MPS
from vestige.navigation.inav.page import InavPage
from vestige.records import E1Observation, SampleBatch
from vestige.records.observation_epoch import ObservationEpoch
from vestige.sample_processor.acquisition import Acquisition, acquire
from vestige.sample_processor.e1_snapshot import E1_WINDOW_S, MIN_SECONDARY_MARGIN_DB, measure_e1
from vestige.sample_processor.tracking.channel import Channel, correlator_lags, track_together
from vestige.sample_processor.tracking.channel_track import ChannelTrack, Observables
from vestige.sample_processor.tracking.outlook import Outlook
from vestige.sample_processor.tracking.page_sync import ReceivedPage
from vestige.sample_processor.tracking.settings import TrackingSettings
from vestige.signals.definitions import E1C
from vestige.time import GalileoTime

EPOCHS_PER_S = 10
# duration in s of the samples that are tracked in one call; longer stretches would need new memory in each call
TRACKED_STRETCH_S = 0.2
_SEARCHED_PERIODS = 8  # number of code periods in which satellites are searched; 8 periods are enough for 30 dBHz
_LOST_EVERY = 5  # number of stretches from a search for lost satellites to the next search
_LARGEST_SAMPLE = 1e12  # limit of a sample; the sum of squares over a second is then far below the largest float32
_FORGOTTEN_S = 120.0  # time in s after which a lost satellite counts as untracked, because its Doppler has changed
_MAX_WAITING = 60  # largest number of pages of a satellite that wait for the time: the pages of two minutes
_LOST_SPAN_HZ = 500.0  # half width in Hz of the search around the last Doppler of a lost satellite


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackedStretch:
    """Results of a tracked stretch of samples: observations, and the pages whose time is known."""

    epochs: list[ObservationEpoch]
    pages: list[InavPage]


@dataclass(slots=True, kw_only=True)
class TrackingReceiver:
    """Receiver that tracks E1 of all satellites.

    Attributes
    ----------
    svids
        SVIDs of the searched satellites.
    settings
        Settings of the tracking loops, which are equal for all channels.
    bandwidth_hz
        Two-sided bandwidth of the front end in Hz; None for the sampling rate.
    time_tag_error_s
        Known error of the samples' time tag in s, positive if the time tag is ahead of Galileo System Time.
    epochs_per_s
        Number of observation epochs per second.
    workers
        Number of threads that track the channels.
    search_every_s
        Time in s between two searches for an untracked satellite.
    outlook
        Object that chooses the next searched satellite, from the almanac of the message and the receiver's position.
    """

    svids: tuple[int, ...] = tuple(range(1, MAX_SVID + 1))
    settings: TrackingSettings = field(default_factory=TrackingSettings)
    bandwidth_hz: float | None = None
    time_tag_error_s: float = 0.0
    epochs_per_s: int = EPOCHS_PER_S
    workers: int = 1
    search_every_s: float = 5.0
    outlook: Outlook = field(default_factory=Outlook)
    tracks: dict[int, ChannelTrack] = field(default_factory=dict)
    time_is_told: bool = False  # whether a message has given the time
    _stretch: int = 0
    _end_sample: int | None = None  # number of the last tracked sample plus 1
    _origin: tuple[int, GalileoTime] | None = None  # number and time of the first sample
    _next_epoch: int | None = None  # number of the next epoch, in steps of 1/`epochs_per_s` s from the start of GST
    _waiting: dict[int, list[ReceivedPage]] = field(default_factory=dict)  # pages without a time
    _seen: set[int] = field(default_factory=set)  # satellites in the previous epoch
    _lost_at: dict[int, int] = field(default_factory=dict)  # stretch in which each satellite was first found to be lost
    _last_epoch: ObservationEpoch | None = None

    def run(self, batches: Iterable[SampleBatch]) -> Iterator[TrackedStretch]:
        """Yield the results of each stretch of `TRACKED_STRETCH_S`; a stretch before the end or a gap may be shorter.

        Parameters
        ----------
        batches
            Samples of E1 in pieces of any length. If a piece does not follow the previous piece, because samples were
            lost or the sample counter was reset, tracking starts again.
        """
        with ThreadPoolExecutor(self.workers) as pool:
            for piece in recut(batches, TRACKED_STRETCH_S):
                yield self.track(piece, pool)

    def track(self, piece: SampleBatch, pool: Executor | None = None) -> TrackedStretch:
        """Track one stretch of samples, and return observations and pages.

        Parameters
        ----------
        piece
            Samples of E1, `TRACKED_STRETCH_S` long. A stretch before an end or a gap may be shorter.
        pool
            Executor that runs channels in parallel; None to run channels one after the other.
        """
        if self._end_sample is not None and piece.first_sample != self._end_sample:
            self._start_anew()
        self._end_sample = piece.first_sample + piece.samples.size
        self._origin = self._origin or (piece.first_sample, piece.start)
        first, start = self._origin
        # `start` is computed from the first sample, so that `start` has the same bits for any division of the samples
        start = start + (piece.first_sample - first) / piece.sample_rate_hz
        samples, power = _usable(piece.samples)
        batch = replace(piece, samples=samples, start=start)
        if self._stretch or piece.samples.size >= round(E1_WINDOW_S * piece.sample_rate_hz):
            self._search(batch)
            self._stretch += 1
        return self._take(batch, power, map if pool is None else pool.map)

    def _start_anew(self) -> None:
        """Forget the channels, because the next samples are not connected to the previous samples.

        The known error of the time tag is kept, because there is no better estimate. Until a message gives the time
        again, pages wait, and no position is computed.
        """
        self.tracks.clear()
        self._waiting.clear()
        self._seen.clear()
        self._lost_at.clear()
        self._last_epoch = None
        self._stretch, self._origin, self.time_is_told = 0, None, False

    def _take(
        self, batch: SampleBatch, power: float, run_all: Callable[..., Iterator[dict[int, list[ReceivedPage]]]]
    ) -> TrackedStretch:
        running = self._alive()

        def run(tracks: list[ChannelTrack]) -> dict[int, list[ReceivedPage]]:
            found = track_together([track.channel for track in tracks], batch.samples, batch.first_sample)
            return {track.svid: track.take(tracked) for track, tracked in zip(tracks, found, strict=True)}

        shares = [running[worker :: self.workers] for worker in range(min(self.workers, len(running)))]
        found = {svid: received for share in run_all(run, shares) for svid, received in share.items()}
        pages = {track.svid: found[track.svid] for track in running}
        placed = self._place(pages, batch)
        for page in placed:
            self.outlook.take(page)
        epochs = self._epochs(batch, power)
        self._last_epoch = epochs[-1] if epochs else self._last_epoch
        return TrackedStretch(epochs=epochs, pages=placed)

    def _alive(self) -> list[ChannelTrack]:
        return [track for track in self.tracks.values() if not track.channel.lost]

    def _search(self, batch: SampleBatch) -> None:
        """Start a channel for each satellite that is found in the first 100 ms of a stretch."""
        window = replace(batch, samples=batch.samples[: round(E1_WINDOW_S * batch.sample_rate_hz)])
        found: list[Acquisition] = []
        if self._stretch == 0:
            found += acquire(window, self.svids, max_stretches=_SEARCHED_PERIODS)
        elif self._stretch % max(round(self.search_every_s / TRACKED_STRETCH_S), 1) == 0:
            self._forget_lost()
            if self._last_epoch is not None and self.time_is_told:
                self.outlook.locate(self._last_epoch)
            unseen = [svid for svid in self.svids if svid not in self.tracks]
            # a clock error of one minute changes the computed direction of a satellite by less than 1°
            svid = self.outlook.next_search(unseen, batch.start + -self.time_tag_error_s)
            if svid is not None:
                found += acquire(window, (svid,), max_stretches=_SEARCHED_PERIODS)
        if self._stretch % _LOST_EVERY == 0:
            for track in self.tracks.values():
                if track.channel.lost:
                    center_hz = track.channel.doppler_hz
                    found += acquire(window, (track.svid,), doppler_center_hz=center_hz, doppler_span_hz=_LOST_SPAN_HZ)
        for acquisition in found:
            measured = measure_e1(window, acquisition)
            if measured is None or not measured.secondary_margin_db >= MIN_SECONDARY_MARGIN_DB:
                continue
            channel = Channel(measured, window, self.settings, bandwidth_hz=self.bandwidth_hz)
            self.tracks[measured.svid] = ChannelTrack(channel, batch.sample_rate_hz, batch.center_frequency_hz)
            self._waiting.pop(measured.svid, None)

    def _forget_lost(self) -> None:
        """Forget satellites that were lost long ago, so that they are searched like satellites never tracked."""
        lost = {svid for svid, track in self.tracks.items() if track.channel.lost}
        self._lost_at = {svid: self._lost_at.get(svid, self._stretch) for svid in sorted(lost)}
        for svid, stretch in tuple(self._lost_at.items()):
            if (self._stretch - stretch) * TRACKED_STRETCH_S >= _FORGOTTEN_S:
                del self.tracks[svid], self._lost_at[svid]
                self._waiting.pop(svid, None)

    def _place(self, pages: dict[int, list[ReceivedPage]], whole: SampleBatch) -> list[InavPage]:
        """Return the pages whose time of transmission is known, including earlier pages that waited for the time."""
        for svid, received in pages.items():
            track = self.tracks[svid]
            for page in received:
                if track.learn_time(page, whole.start) is not None:
                    self._learn_clock(whole)
            waiting = self._waiting.setdefault(svid, [])
            waiting.extend(received)
            del waiting[:-_MAX_WAITING]
        placed = []
        for svid, waiting in self._waiting.items():
            zero = self._zero(self.tracks[svid], whole)
            if zero is None or not self.time_is_told:
                continue
            for page in waiting:
                start = zero + page.period * E1_CODE_PERIOD_S
                second = GalileoTime.normalized(start.week, start.second, round(start.fraction))
                placed.append(InavPage(svid=svid, time=second, data=page.data))
            waiting.clear()
        return sorted(placed, key=lambda page: (page.time, page.svid))

    def _learn_clock(self, whole: SampleBatch) -> None:
        """Estimate the error of the time tag from the satellites whose message has given the time."""
        errors_s = []
        for track in self._alive():
            newest = track.newest()
            if track.zero is not None and newest is not None:
                received = whole.start + (newest[0] - whole.first_sample) / whole.sample_rate_hz
                errors_s.append(received - (track.zero + newest[1]) - MEDIAN_TRAVEL_TIME_S)
        if errors_s:
            self.time_tag_error_s, self.time_is_told = statistics.median(errors_s), True

    def _zero(self, track: ChannelTrack, whole: SampleBatch) -> GalileoTime | None:
        """Return the time of transmission of a channel's code period 0, from its message or from the clock.

        The result is None if the time is unknown and no period was tracked yet.
        """
        if track.zero is not None:
            return track.zero
        newest = track.newest()
        if newest is None:
            return None
        received = whole.start + ((newest[0] - whole.first_sample) / whole.sample_rate_hz - self.time_tag_error_s)
        near = received + (-MEDIAN_TRAVEL_TIME_S - newest[1])
        return GalileoTime.normalized(near.week, near.second, round(near.fraction / SECONDARY_PERIOD_S) / 10)

    def _epochs(self, whole: SampleBatch, power: float) -> list[ObservationEpoch]:
        """Return the new epochs that lie in the samples that all channels have tracked."""
        alive = self._alive()
        step = 1.0 / self.epochs_per_s
        reach = min((track.reach for track in alive), default=float(whole.first_sample + whole.samples.size))
        begin = whole.start
        if self._next_epoch is None or whole.first_sample == (self._origin or (None,))[0]:
            first = begin.gst_seconds * self.epochs_per_s + math.ceil(begin.fraction * self.epochs_per_s)
            self._next_epoch = max(first, self._next_epoch or first)  # time never decreases
        numbers: list[int] = []
        places: list[float] = []
        number = self._next_epoch
        while True:
            second, part = divmod(number, self.epochs_per_s)
            place = (GalileoTime.from_gst_seconds(second) + part * step - begin) * whole.sample_rate_hz
            if place + whole.first_sample > reach:
                break
            numbers.append(number)
            places.append(place + whole.first_sample)
            number += 1
        self._next_epoch = number
        if not numbers:
            return []
        at = np.array(places)
        rows = {track.svid: (self._zero(track, whole), track.observables(at)) for track in self.tracks.values()}
        epochs = [self._epoch(number, row, rows) for row, number in enumerate(numbers)]
        # standard deviation, per dimension, of a sum over 100 ms of samples that are only noise
        sigma = math.sqrt(max(power, 1e-30) / 2 * SECONDARY_PERIOD_S * whole.sample_rate_hz)
        chips = tuple(self._tap_chips(whole.sample_rate_hz))
        return [
            replace(
                epoch,
                taps={svid: self.tracks[svid].taps(place) / np.float32(sigma) for svid in epoch.observations},
                tap_chips=chips,
                power_db=10 * math.log10(power) if power > 0 else -math.inf,
            )
            for epoch, place in zip(epochs, places, strict=True)
        ]

    def _tap_chips(self, sample_rate_hz: float) -> list[float]:
        """Return the positions of the correlators in chips from the prompt."""
        return [lag * E1C.chip_rate_hz / sample_rate_hz for lag in correlator_lags(self.settings, sample_rate_hz)]

    def _epoch(
        self, number: int, row: int, rows: dict[int, tuple[GalileoTime | None, Observables]]
    ) -> ObservationEpoch:
        second, part = divmod(number, self.epochs_per_s)
        time = GalileoTime.from_gst_seconds(second) + part / self.epochs_per_s
        observations, slipped = {}, set()
        for svid, (zero, seen) in sorted(rows.items()):
            if zero is None or not np.isfinite(seen.transmit_s[row]):
                continue
            observations[svid] = E1Observation(
                svid=svid,
                pseudorange_m=((time - zero) - float(seen.transmit_s[row])) * SPEED_OF_LIGHT_MPS,
                carrier_phase_cycles=float(seen.carrier_phase_cycles[row]),
                doppler_hz=float(seen.doppler_hz[row]),
                doppler_rate_hz_per_s=float("nan"),
                cn0_dbhz=float(seen.cn0_dbhz[row]),
            )
            if svid not in self._seen:
                slipped.add(svid)
        self._seen = set(observations)
        return ObservationEpoch(time=time, observations=observations, slipped=frozenset(slipped))


def _usable(samples: Complex64[np.ndarray, " n"]) -> tuple[Complex64[np.ndarray, " n"], float]:
    """Return the samples and their mean power.

    If the power is not finite, samples that are not numbers or reach `_LARGEST_SAMPLE` become 0.
    """
    power = float(np.vdot(samples, samples).real) / max(samples.size, 1)
    if math.isfinite(power):
        return samples, power
    samples = np.where(np.abs(samples) < _LARGEST_SAMPLE, samples, np.complex64(0.0))
    return samples, float(np.vdot(samples, samples).real) / samples.size


def recut(batches: Iterable[SampleBatch], duration_s: float) -> Iterator[SampleBatch]:
    """Yield samples in pieces of equal length; the last piece before the end or a gap may be shorter.

    Parameters
    ----------
    batches
        Samples in their original order. There is a gap if a batch does not begin at the sample after the previous
        batch.
    duration_s
        Length of a piece in s.
    """
    held: list[SampleBatch] = []
    for batch in batches:
        if held and batch.first_sample != held[-1].first_sample + held[-1].samples.size:
            yield replace(held[0], samples=np.concatenate([one.samples for one in held]))
            held = []
        count = round(duration_s * batch.sample_rate_hz)
        if not held and batch.samples.size == count:
            yield batch
            continue
        held.append(batch)
        if sum(one.samples.size for one in held) < count:
            continue
        samples = np.concatenate([one.samples for one in held]) if len(held) > 1 else batch.samples
        whole = replace(held[0], samples=samples)
        for first in range(0, samples.size - count + 1, count):
            yield _part(whole, first, first + count)
        rest = samples.size % count
        held = [_part(whole, samples.size - rest, samples.size)] if rest else []
    if held:
        yield replace(held[0], samples=np.concatenate([one.samples for one in held]))


def _part(whole: SampleBatch, begin: int, end: int) -> SampleBatch:
    return replace(
        whole,
        samples=whole.samples[begin:end],
        first_sample=whole.first_sample + begin,
        start=whole.start + begin / whole.sample_rate_hz,
    )
