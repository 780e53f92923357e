"""Open the input of `vestige live`: description, files, pipes or standard input, and the tracking of E1."""

from __future__ import annotations

import math
import stat
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.loop_options import check_no_loop_options, loop_settings
from vestige.cli.options import PATH, number_option, options_together
from vestige.errors import InputFileError, VestigeError

if TYPE_CHECKING:
    from vestige.recording.description import BandFile, RecordingDescription
    from vestige.recording.live.live_recording import LiveRecording
    from vestige.recording.live.live_tracking import LiveTracking
    from vestige.recording.samples.sample_stream import SampleStream
    from vestige.records import Band

STDIN = Path("-")
STDIN_OPTIONS = ("description", "band", "sample_format", "layout", "sample_rate_hz", "center_frequency_hz")
SAMPLE_FORMATS = ("int8", "uint8", "int16", "uint16", "float32")
LAYOUTS = ("real", "iq", "qi")


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
    """Return a recording that is still being written; threads begin to read its pipes.

    `options` has the values of the command's options by parameter name. `around_s` is the parameter `uncertainty_s` of
    `LiveRecording`. The other parameters are parameters of `LiveRecording` with the same names.

    The function raises `VestigeError` if the buffer of a pipe is too small, or if the recording has no E6 samples or no
    time tag.
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
    """Return the tracking of E1, or None if E1 is not tracked.

    E1 is not tracked with `--no-track`. Without `--track`, E1 is not tracked either if there are observations, or if
    the recording has no E1 samples. The function raises `InputFileError` if `--track` is given, and the recording has
    no E1 samples.
    """
    from vestige.recording.live.live_tracking import LiveTracking
    from vestige.recording.live.received_message import ReceivedMessage
    from vestige.records import Band

    wish, file = options["track"], description.bands.get(Band.E1)
    observed = options["observations"] is not None or description.observations is not None
    if wish is False or (wish is None and (observed or file is None)):
        check_no_loop_options()
        return None
    if file is None:
        raise InputFileError(description.path, "E1", "no samples", "E1 samples to track; without them, give --no-track")
    message = ReceivedMessage(description.path)
    return LiveTracking(file, message, settings=loop_settings(options), workers=options["workers"], warn=warn)


def _streams(description: RecordingDescription, options: dict[str, Any], around_s: float) -> dict[Band, SampleStream]:
    """Return the stream of each band that comes from standard input or from a named pipe.

    The function raises `VestigeError` if `--buffer-mb` is too small for a clock that may be wrong by `around_s`.
    """
    from vestige.recording.live.live_recording import buffer_s

    piped = {band: file for band, file in description.bands.items() if file.path == STDIN or _is_fifo(file.path)}
    capacity = round(options["buffer_mb"] * 1e6)
    for file in piped.values():
        needed_mb = buffer_s(around_s) * file.sample_rate_hz * file.form.sample_bytes / 1e6
        if needed_mb * 1e6 > capacity:
            raise VestigeError(
                f"--buffer-mb: found {options['buffer_mb']:g}, expected at least {math.ceil(needed_mb)} for a clock "
                f"that may be wrong by {around_s:g} s (--time-uncertainty)"
            )
    return _split_by_pipe(piped, capacity_bytes=capacity, can_wait=not options["real_time"])


def _split_by_pipe(files: dict[Band, BandFile], *, capacity_bytes: int, can_wait: bool) -> dict[Band, SampleStream]:
    """Return the stream of samples of each band.

    If several bands share a pipe, each frame of the pipe has samples of all these bands.
    """
    by_path: dict[Path, dict[Band, BandFile]] = {}
    for band, file in files.items():
        by_path.setdefault(file.path, {})[band] = file
    streams: dict[Band, SampleStream] = {}
    for together in by_path.values():
        streams |= _split(together, capacity_bytes=capacity_bytes, can_wait=can_wait)
    return streams


def _is_fifo(path: Path) -> bool:
    return path.exists() and stat.S_ISFIFO(path.stat().st_mode)


def live_description(recording: Path, options: dict[str, Any]) -> RecordingDescription:
    """Return the description of a recording on disk; the recording may have no samples yet."""
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


# The options that describe samples on standard input
stdin_options = options_together(
    click.option("--description", type=PATH, help="Standard input: a recording.toml that describes the samples."),
    click.option(
        "--band",
        type=click.Choice(["e6", "e1", "both"]),
        help="Standard input: band of the samples. With both, samples of E1 and E6 alternate.",
    ),
    click.option(
        "--format", "sample_format", type=click.Choice(SAMPLE_FORMATS), help="Standard input: type of the numbers."
    ),
    click.option("--layout", type=click.Choice(LAYOUTS), help="Standard input: real samples, or the order of I and Q."),
    number_option("--sample-rate-hz", (0, None), help="Standard input: sample rate in Hz."),
    number_option(
        "--center-frequency-hz",
        (0, None),
        help="Standard input: radio frequency at 0 Hz in the samples. [default of both bands: the carriers]",
    ),
    number_option(
        "--buffer-mb", (1, 1e6), default=512.0, help="Standard input: size of the buffer of each band in MB."
    ),
)


def stdin_description(options: dict[str, Any], default_band: str = "e6") -> RecordingDescription:
    """Return the description of samples on standard input.

    Parameters
    ----------
    options
        Values of the options `stdin_options` and of `start`, by parameter name.
    default_band
        Band of the samples if `--band` is not given: `e1` or `e6`.
    """
    from dataclasses import replace

    from vestige.recording.description import RecordingDescription, redated
    from vestige.recording.recording_toml import read_recording_toml
    from vestige.records import Band

    if options["description"] is None:
        return RecordingDescription(path=STDIN, bands=_stdin_files(options, options["band"] or default_band))
    if options["band"] is not None:
        raise click.UsageError("--band: the description also states the band; leave one of the two out")
    found = read_recording_toml(options["description"])
    only = Band[default_band.upper()]
    bands = {
        band: replace(file, path=STDIN) if band is only or file.form.channels > 1 else file
        for band, file in found.bands.items()
    }
    if len([one for one in bands.values() if one.path == STDIN and one.form.channels == 1]) > 1:
        expected = 'one of them, or frame = ["e1", "e6"] if samples alternate'
        raise InputFileError(options["description"], "e1.file, e6.file", "both bands on standard input", expected)
    found = replace(found, bands=bands)
    return found if options["start"] is None else redated(found, options["start"])


def _stdin_files(options: dict[str, Any], band_name: str) -> dict[Band, BandFile]:
    from vestige.recording.description import SAMPLE_RATE_RANGE_HZ, BandFile, band_of
    from vestige.recording.samples.sample_format import SampleFormat
    from vestige.records import Band
    from vestige.signals.definitions import CARRIER_HZ

    names = (Band.E1, Band.E6) if band_name == "both" else (Band[band_name.upper()],)
    needed = {"--format": "sample_format", "--layout": "layout", "--sample-rate-hz": "sample_rate_hz"}
    if len(names) == 1:
        needed["--center-frequency-hz"] = "center_frequency_hz"
    elif options["center_frequency_hz"] is not None:
        raise click.UsageError(
            "--center-frequency-hz: with --band both, 0 Hz is the carrier of each band; state other frequencies in "
            "--description"
        )
    needed["--start"] = "start"
    if missing := [name for name, key in needed.items() if options[key] is None]:
        raise click.UsageError(f"samples on standard input need {', '.join(missing)}, or --description")
    rate = options["sample_rate_hz"]
    if not SAMPLE_RATE_RANGE_HZ[0] <= rate <= SAMPLE_RATE_RANGE_HZ[1]:
        raise VestigeError(
            f"--sample-rate-hz: found {rate:g}, expected {SAMPLE_RATE_RANGE_HZ[0]:g} to {SAMPLE_RATE_RANGE_HZ[1]:g}"
        )
    files = {}
    for channel, band in enumerate(names):
        center = CARRIER_HZ[band] if len(names) > 1 else options["center_frequency_hz"]
        if band_of(center, rate) is not band:
            raise VestigeError(
                f"--center-frequency-hz: found {center:g}, expected a frequency within half a sample rate of the "
                f"{band.name} carrier"
            )
        component, layout = options["sample_format"], options["layout"]
        files[band] = BandFile(
            band=band,
            path=STDIN,
            described_in=STDIN,
            form=SampleFormat(component=component, layout=layout, channels=len(names), channel=channel),
            sample_rate_hz=rate,
            center_frequency_hz=center,
            start=options["start"],
        )
    return files


def stdin_stream(file: BandFile, *, capacity_bytes: int) -> SampleStream:
    """Return the stream of samples of one band on standard input; samples of other channels are dropped."""
    return _split({file.band: file}, capacity_bytes=capacity_bytes, can_wait=True)[file.band]


def _split(files: dict[Band, BandFile], *, capacity_bytes: int, can_wait: bool) -> dict[Band, SampleStream]:
    """Return the stream of each band in `files`; all these bands come from the same pipe or from standard input."""
    from dataclasses import replace

    from vestige.recording.live.frame_splitter import FrameSplitter
    from vestige.recording.samples.sample_stream import SampleStream, reading

    one = next(iter(files.values()))
    source = sys.stdin.fileno() if one.path == STDIN else one.path
    if one.form.channels == 1:
        return {one.band: SampleStream(source, one, capacity_bytes=capacity_bytes, can_wait=can_wait)}
    opened: Callable[[int], bytes] | None = None

    def read(at_most: int) -> bytes:
        nonlocal opened
        opened = opened or reading(source)  # the reading thread opens a named pipe, because opening waits for a writer
        return opened(at_most)

    splitter = FrameSplitter(
        read,
        sample_bytes=one.form.sample_bytes,
        n_channels=one.form.channels,
        wanted=[file.form.channel for file in files.values()],
        header_bytes=one.header_bytes,
    )
    return {
        band: SampleStream(
            partial(splitter.read, file.form.channel),
            replace(file, form=file.form.alone, header_bytes=0),
            capacity_bytes=capacity_bytes,
            can_wait=can_wait,
        )
        for band, file in files.items()
    }
