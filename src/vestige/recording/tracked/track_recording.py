"""Track E1 in a recording from the first sample to the last sample.

The results are observations and navigation pages, as from a receiver that runs beside the recorder. The times of the
pages are in Galileo System Time. Before the first page with a time, the time tag of the samples resolves the ambiguity
of 100 ms in the pseudoranges. After the whole recording is tracked, the time from the message corrects these
pseudoranges. Once the message of a satellite has given the time, the messages of other satellites do not correct the
ranges of this satellite until its signal is lost. So a replay with a delay of seconds is visible in these ranges.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

from vestige.constants import MEDIAN_TRAVEL_TIME_S, SECONDARY_PERIOD_S, SPEED_OF_LIGHT_MPS
from vestige.navigation.inav.page import InavPage
from vestige.recording.recording import Recording
from vestige.recording.samples.sample_file import SampleReader
from vestige.recording.samples.sample_stream import SampleStream
from vestige.records import E1Observation, SampleBatch
from vestige.records.observation_epoch import ObservationEpoch
from vestige.sample_processor.tracking.settings import TrackingSettings
from vestige.sample_processor.tracking.tracking_receiver import EPOCHS_PER_S, TRACKED_STRETCH_S, TrackingReceiver
from vestige.time import GalileoTime

_LOOK_S = 0.02  # time in s between two checks whether a pipe has new samples
MIN_TRACKED_S = 2.0  # shortest recording in s that is tracked, because the tracking loops need time to settle


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackedRecording:
    """Products of tracking a whole recording: observations, pages, and the error of the time tag.

    Attributes
    ----------
    epochs
        Observations in the order of time, on the clock of the recording.
    pages
        I/NAV pages with good checksums, and with times from the message.
    time_tag_error_s
        Error of the samples' time tag in s, from the message; positive if the time tag is ahead of Galileo System Time.
        The value is uncertain by 10 ms, because the travel time of the signal is not known. The value is None if no
        message contained the time.
    """

    epochs: tuple[ObservationEpoch, ...]
    pages: tuple[InavPage, ...]
    time_tag_error_s: float | None

    @property
    def tap_chips(self) -> tuple[float, ...]:
        """Offsets of the correlators from the prompt in chips; () if nothing was tracked."""
        return self.epochs[-1].tap_chips if self.epochs else ()


def track_recording(
    recording: Recording,
    settings: TrackingSettings | None = None,
    *,
    epochs_per_s: int = EPOCHS_PER_S,
    workers: int = 1,
    progress: Callable[[str, int, int], None] | None = None,
) -> TrackedRecording:
    """Track E1 in a recording, and return the observations, the navigation pages and the error of the time tag.

    Parameters
    ----------
    recording
        Recording with E1 samples.
    settings
        Settings of the tracking loops, which are equal for all channels; None for the default settings.
    epochs_per_s
        Number of observation epochs per second.
    workers
        Number of threads that track the channels.
    progress
        Function that is called with the name of the step, the finished amount and the whole amount.

    Raises
    ------
    ValueError
        If the recording has no E1 samples.
    VestigeError
        If the sampling rate is too low for tracking, or the samples cannot be read.
    """
    if recording.e1 is None:
        raise ValueError("a recording without E1 cannot be tracked")
    reader = recording.e1
    n_pieces = -(-reader.n_samples // round(TRACKED_STRETCH_S * reader.file.sample_rate_hz))

    def report(done: int) -> None:
        if progress is not None:
            progress("tracking E1", done, n_pieces)

    batches = tracked_batches(reader)
    return track_batches(batches, settings, epochs_per_s=epochs_per_s, workers=workers, progress=report)


def track_batches(
    batches: Iterable[SampleBatch],
    settings: TrackingSettings | None = None,
    *,
    epochs_per_s: int = EPOCHS_PER_S,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> TrackedRecording:
    """Track E1 samples that come in pieces, for example from a pipe, and return observations and navigation pages.

    Parameters
    ----------
    batches
        Consecutive pieces of E1 samples.
    settings, epochs_per_s, workers
        Arguments with the same meaning as in `track_recording`.
    progress
        Function that is called with the number of pieces of `TRACKED_STRETCH_S` that were tracked so far.

    Raises
    ------
    VestigeError
        If the sampling rate is too low for tracking, or the samples cannot be read.
    """
    receiver = TrackingReceiver(settings=settings or TrackingSettings(), epochs_per_s=epochs_per_s, workers=workers)
    epochs: list[ObservationEpoch] = []
    pages: list[InavPage] = []
    untold = 0  # number of epochs before a message told the time; the receiver has corrected later epochs
    for done, stretch in enumerate(receiver.run(batches), start=1):
        epochs += stretch.epochs
        pages += stretch.pages
        untold = untold if receiver.time_is_told else len(epochs)
        if progress is not None:
            progress(done)
    told = receiver.time_tag_error_s if receiver.time_is_told else None
    if told is not None:
        epochs[:untold] = [with_code_periods(epoch, told) for epoch in epochs[:untold]]
    return TrackedRecording(
        epochs=tuple(epochs),
        pages=tuple(pages),
        time_tag_error_s=told,
    )


def tracked_batches(reader: SampleReader) -> Iterator[SampleBatch]:
    """Yield all samples of a recording in pieces of `TRACKED_STRETCH_S`, as the tracking receiver uses them."""
    return reader.blocks(round(TRACKED_STRETCH_S * reader.file.sample_rate_hz))


def streamed_batches(stream: SampleStream) -> Iterator[SampleBatch]:
    """Yield samples from a pipe in pieces of `TRACKED_STRETCH_S`, and drop yielded samples from the buffer.

    The function raises `InputFileError` if reading fails.

    Parameters
    ----------
    stream
        Stream whose writer can wait, and whose buffer has room for two pieces of `TRACKED_STRETCH_S`.
    """
    first, count = stream.file.first_sample, round(TRACKED_STRETCH_S * stream.file.sample_rate_hz)
    while True:
        state = stream.look()
        while state.end_sample - first >= count or (state.ended and state.end_sample > first):
            found = stream.cut(first, min(first + count, state.end_sample))
            if found is None:
                raise ValueError("samples of a pipe whose writer can wait were dropped")
            yield found.read(first, found.n_samples)
            first += found.n_samples
            stream.keep((), first)
        if state.ended:
            return
        stream.wait(_LOOK_S)


def early_recs_warning(count: int, first: GalileoTime) -> str:
    """Return the warning that RECS of tracked satellites came before tracking began.

    Parameters
    ----------
    count
        Number of RECS that came before tracking began, at least 1.
    first
        Galileo System Time of the first epoch with an observation.

    Examples
    --------
    >>> early_recs_warning(1, GalileoTime(1422, 0)).split(";")[0]
    '1 RECS came before E1 was tracked, from 2026-11-22T00:00:00.000 GST on, and has no verdict'
    """
    return (
        f"{count} RECS came before E1 was tracked, from {first} on, and {'has' if count == 1 else 'have'} no verdict; "
        "begin the recording 5 s before a RECS, or measure E1 around each RECS with --no-track"
    )


def tracked_since(first: GalileoTime, time_tag_error_s: float) -> GalileoTime:
    """Return the earliest time of transmission for which a RECS has E1 observations.

    Parameters
    ----------
    first
        Time of the first epoch with an observation, by the receiver's clock.
    time_tag_error_s
        Error of the receiver's clock in s, positive if the clock is ahead of Galileo System Time.
    """
    return first + -(time_tag_error_s + MEDIAN_TRAVEL_TIME_S)


def with_code_periods(epoch: ObservationEpoch, time_tag_error_s: float) -> ObservationEpoch:
    """Return an epoch whose pseudoranges are corrected by whole periods of the secondary code.

    The correction brings each pseudorange as near as possible to the range that follows from the median travel time and
    the clock error.

    Parameters
    ----------
    epoch
        Observations whose pseudoranges are right except for a multiple of the period of 100 ms.
    time_tag_error_s
        Error of the receiver's clock in s, positive if the clock is ahead of Galileo System Time.
    """
    expected_s = MEDIAN_TRAVEL_TIME_S + time_tag_error_s

    def move(one: E1Observation) -> E1Observation:
        periods = round((expected_s - one.pseudorange_m / SPEED_OF_LIGHT_MPS) / SECONDARY_PERIOD_S)
        if periods == 0:
            return one
        return replace(one, pseudorange_m=one.pseudorange_m + periods * SECONDARY_PERIOD_S * SPEED_OF_LIGHT_MPS)

    return replace(epoch, observations={svid: move(one) for svid, one in epoch.observations.items()})
