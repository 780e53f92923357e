"""What `vestige live` reads: descriptions, growing files, pipes, and the tracking of E1."""

from __future__ import annotations

import math
import stat
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from vestige.recording.description import BandFile, RecordingDescription
    from vestige.recording.live.live_recording import LiveRecording
    from vestige.recording.live.live_tracking import LiveTracking
    from vestige.recording.samples.sample_stream import SampleStream
    from vestige.records import Band

STDIN = Path("-")


def opened_live(
    description: RecordingDescription,
    options: dict[str, Any],
    observations: Path | None,
    tracking: LiveTracking | None,
    warn: Callable[[object], None],
    *,
    replaceable: bool,
    told: bool,
    around_s: float,
) -> LiveRecording:
    """Return the recording with its pipes open; parameters as for `LiveRecording`, `around_s` is its uncertainty.

    Raises `VestigeError` if the buffer of a pipe is too small, or a pipe cannot be opened.
    """
    from vestige.recording.live.live_recording import LiveRecording

    return LiveRecording(
        description,
        observations=observations,
        replaceable=replaceable,
        streams=_streams(description, options, around_s),
        tracking=tracking,
        told=told,
        uncertainty_s=around_s,
        warn=warn,
    )


def live_tracking(
    description: RecordingDescription, options: dict[str, Any], warn: Callable[[object], None]
) -> LiveTracking | None:
    """Return the tracking of E1, None where it is not wished or not needed.

    Raises `VestigeError` if it is wished, and there is no E1.
    """
    from vestige.errors import InputFileError
    from vestige.recording.live.live_tracking import LiveTracking
    from vestige.recording.live.received_message import ReceivedMessage
    from vestige.records import Band

    wish, file = options["track"], description.bands.get(Band.E1)
    observed = options["observations"] is not None or description.observations is not None
    if wish is False or (wish is None and (observed or file is None)):
        return None
    if file is None:
        raise InputFileError(description.path, "E1", "no samples", "E1 samples, which are tracked (--no-track)")
    message = ReceivedMessage(description.path)
    return LiveTracking(file, message, workers=options["workers"], warn=warn)


def _streams(description: RecordingDescription, options: dict[str, Any], around_s: float) -> dict[Band, SampleStream]:
    """Return the pipes: E6 on standard input, or the named pipes that a description names."""
    from vestige.errors import VestigeError
    from vestige.recording.live.live_recording import buffer_s
    from vestige.recording.samples.sample_stream import SampleStream

    piped = {band: file for band, file in description.bands.items() if file.path == STDIN or _is_fifo(file.path)}
    capacity = round(options["buffer_mb"] * 1e6)
    for file in piped.values():
        needed_mb = buffer_s(around_s) * file.sample_rate_hz * file.form.sample_bytes / 1e6
        if needed_mb * 1e6 > capacity:
            raise VestigeError(
                f"--buffer-mb: found {options['buffer_mb']:g}, expected at least {math.ceil(needed_mb)} for a clock "
                f"that may be wrong by {around_s:g} s (--time-uncertainty)"
            )
    streams = {}
    for band, file in piped.items():
        source = sys.stdin.fileno() if file.path == STDIN else file.path
        streams[band] = SampleStream(source, file, capacity_bytes=capacity, can_wait=not options["real_time"])
    return streams


def _is_fifo(path: Path) -> bool:
    return path.exists() and stat.S_ISFIFO(path.stat().st_mode)


def live_description(recording: Path, options: dict[str, Any]) -> RecordingDescription:
    """Return the description of a recording on disk; its samples may all be still to come."""
    from dataclasses import replace

    from vestige.recording.description import redated
    from vestige.recording.live.live_recording import awaited_observations
    from vestige.recording.recording import describe_recording, unread_observations

    found = describe_recording(recording)
    if found.observations is None:
        awaited = awaited_observations(found)
        wrong = tuple(f"{one}; not used" for one in unread_observations(found) if one.path != awaited)
        found = replace(found, observations=awaited, notes=found.notes + wrong)
    return found if options["start"] is None else redated(found, options["start"])


def stdin_description(options: dict[str, Any]) -> RecordingDescription:
    """Return the description of E6 samples on standard input."""
    from dataclasses import replace

    from vestige.recording.description import RecordingDescription, redated
    from vestige.recording.recording_toml import read_recording_toml
    from vestige.records import Band

    if options["description"] is None:
        return RecordingDescription(path=STDIN, bands={Band.E6: _stdin_file(options)})
    found = read_recording_toml(options["description"])
    if Band.E6 in found.bands:
        e6 = replace(found.bands[Band.E6], path=STDIN)
        found = replace(found, bands={**found.bands, Band.E6: e6})
    return found if options["start"] is None else redated(found, options["start"])


def _stdin_file(options: dict[str, Any]) -> BandFile:
    from vestige.errors import VestigeError
    from vestige.recording.description import SAMPLE_RATE_RANGE_HZ, BandFile, band_of
    from vestige.recording.samples.sample_format import SampleFormat
    from vestige.records import Band

    needed = {"--format": "sample_format", "--layout": "layout", "--sample-rate-hz": "sample_rate_hz",
              "--center-frequency-hz": "center_frequency_hz", "--start": "start"}  # fmt: skip
    if missing := [name for name, key in needed.items() if options[key] is None]:
        raise click.UsageError(f"samples on standard input need {', '.join(missing)}, or --description")
    rate, center = options["sample_rate_hz"], options["center_frequency_hz"]
    if not SAMPLE_RATE_RANGE_HZ[0] <= rate <= SAMPLE_RATE_RANGE_HZ[1]:
        raise VestigeError(
            f"--sample-rate-hz: found {rate:g}, expected {SAMPLE_RATE_RANGE_HZ[0]:g} to {SAMPLE_RATE_RANGE_HZ[1]:g}"
        )
    if band_of(center, rate) is not Band.E6:
        raise VestigeError(
            f"--center-frequency-hz: found {center:g}, expected the E6 carrier within half a sample rate of it"
        )
    return BandFile(
        band=Band.E6,
        path=STDIN,
        described_in=STDIN,
        form=SampleFormat(component=options["sample_format"], layout=options["layout"]),
        sample_rate_hz=rate,
        center_frequency_hz=center,
        start=options["start"],
    )
