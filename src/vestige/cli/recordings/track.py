"""`vestige track`: track E1 of a recording, and write the files that a receiver would have written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.live.live_input import STDIN, STDIN_OPTIONS, stdin_description, stdin_options, stdin_stream
from vestige.cli.loop_options import loop_options, loop_settings
from vestige.cli.options import PATH, recording_argument, start_option, threads_option
from vestige.cli.recordings.time_tag import by_the_message
from vestige.cli.terminal import echo, warn
from vestige.errors import InputFileError
from vestige.output import check_new_folder

if TYPE_CHECKING:
    from vestige.recording.tracked.track_recording import TrackedRecording


@click.command()
@recording_argument
@click.option("-o", "--output", type=PATH, required=True, help="Folder to write; must not exist.")
@start_option
@loop_options
@click.option(
    "--observation-rate-hz",
    type=click.IntRange(1, 100),
    default=10,
    show_default=True,
    help="Observations of each satellite per second.",
)
@threads_option("Number of threads that track E1.")
@stdin_options
def command(recording_path: Path, **options: Any) -> None:
    """Track E1 of RECORDING, and write observations, navigation message and correlators of every tracked satellite.

    The command writes RINEX observations and navigation, I/NAV pages for `vestige osnma verify`, correlators, and the
    power of each satellite. With `-` as RECORDING, samples of E1 are read from standard input, or samples of both bands
    with `--band both`. Only E1 is tracked.
    """
    from vestige.recording.tracked.tracked_folder import write_tracked

    folder: Path = options["output"]
    check_new_folder(folder)
    tracked, n_samples, rate_hz = (
        _tracked_stdin(options) if recording_path == STDIN else _tracked(recording_path, options)
    )
    _check_duration(recording_path, tracked, n_samples / rate_hz)
    _print(tracked, options["observation_rate_hz"])
    folder.mkdir(parents=True)
    for path in write_tracked(folder, tracked, rate_hz):
        echo(f"wrote {path}")


def _check_duration(path: Path, tracked: TrackedRecording, duration_s: float) -> None:
    """Raise `InputFileError` if no satellite was tracked because there are too few samples of E1."""
    from vestige.recording.tracked.track_recording import MIN_TRACKED_S

    if duration_s < MIN_TRACKED_S and not any(epoch.observations for epoch in tracked.epochs):
        raise InputFileError(
            path,
            "samples of E1",
            f"{duration_s:.3g} s",
            f"at least {MIN_TRACKED_S:g} s, or vestige process, which measures 100 ms around each RECS",
        )


def _tracked(recording_path: Path, options: dict[str, Any]) -> tuple[TrackedRecording, int, float]:
    """Return the result of tracking a recording, the number of its samples of E1, and the sample rate in Hz."""
    from vestige.cli.progress import progress
    from vestige.recording.recording import open_recording
    from vestige.recording.tracked.track_recording import track_recording

    if unfit := [f"--{name.replace('_', '-')}" for name in STDIN_OPTIONS if options[name] is not None]:
        names = ", ".join(unfit).replace("sample-format", "format")
        raise click.UsageError(f"{names}: only for samples on standard input (vestige track -)")
    recording = open_recording(recording_path, start=options["start"])
    if recording.e1 is None:
        raise _without_e1(recording.description.path)
    for line in recording.notes:
        warn(line)
    with progress() as report:
        tracked = track_recording(
            recording,
            loop_settings(options),
            epochs_per_s=options["observation_rate_hz"],
            workers=options["workers"],
            progress=report,
        )
    return tracked, recording.e1.n_samples, recording.e1.file.sample_rate_hz


def _tracked_stdin(options: dict[str, Any]) -> tuple[TrackedRecording, int, float]:
    """Return the result of tracking samples on standard input, the number of E1 samples, and the sample rate in Hz."""
    from vestige.recording.tracked.track_recording import streamed_batches, track_batches
    from vestige.records import Band

    file = stdin_description(options, "e1").bands.get(Band.E1)
    if file is None:
        raise _without_e1(STDIN)
    if file.start is None:
        raise InputFileError(file.described_in, "start time", "nothing", "start in the description, or --start")
    stream = stdin_stream(file, capacity_bytes=round(options["buffer_mb"] * 1e6))
    tracked = track_batches(
        streamed_batches(stream),
        loop_settings(options),
        epochs_per_s=options["observation_rate_hz"],
        workers=options["workers"],
    )
    n_samples = stream.look().end_sample - file.first_sample
    if n_samples == 0:
        raise InputFileError(STDIN, "standard input", "no sample", "samples of E1")
    return tracked, n_samples, file.sample_rate_hz


def _without_e1(path: Path) -> InputFileError:
    return InputFileError(path, "bands", "no E1", "samples of E1, the band that is tracked")


def _print(tracked: TrackedRecording, rate_hz: int) -> None:
    """Print a line for each satellite, and the error of the time tag relative to the navigation message."""
    import math
    import statistics

    from vestige.recording.tracked.message_navigation import ephemerides_in
    from vestige.recording.tracked.tracked_folder import clock_set_s

    issues = {one.svid: one.iod_nav for one in ephemerides_in(tracked.pages)}
    seen: dict[int, list[float]] = {}
    slips: dict[int, int] = {}
    for epoch in tracked.epochs:
        for svid, one in epoch.observations.items():
            seen.setdefault(svid, []).append(one.cn0_dbhz)
            slips[svid] = slips.get(svid, 0) + (svid in epoch.slipped)
    if not seen:
        echo("no satellite was tracked; `vestige inspect` says what may be wrong with the recording")
        return
    echo("  sat   tracked    C/N0        starts and slips   pages   IODnav")
    for svid, strengths in sorted(seen.items()):
        pages = sum(page.svid == svid for page in tracked.pages)
        known = [value for value in strengths if not math.isnan(value)]
        cn0 = f"{statistics.median(known):5.1f} dBHz" if known else "     -     "
        issue = str(issues.get(svid, "-"))
        echo(f"  E{svid:02d} {len(strengths) / rate_hz:8.1f} s  {cn0}  {slips[svid]:12d}  {pages:12d}  {issue:>6}")
    if tracked.time_tag_error_s is None:
        echo("no navigation message gave the time; the ranges depend on the time tag of the samples")
    else:
        echo(by_the_message(tracked.time_tag_error_s))
        if offset_s := clock_set_s(tracked):
            side = "earlier" if offset_s > 0 else "later"
            echo(f"the clock of the files is set {abs(offset_s)} s {side} than the clock of the samples")
