"""`vestige process --follow`: verdicts while the recording is being written."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.options import assistance_folder
from vestige.cli.terminal import echo
from vestige.output import check_output
from vestige.own_parts import digest, is_own

if TYPE_CHECKING:
    from vestige.acas_processor.processor import AcasProcessor
    from vestige.cli.recordings.verdicts import Tally
    from vestige.recording.description import BandFile, RecordingDescription
    from vestige.recording.live.follow_journal import FollowJournal
    from vestige.recording.live.following import Following
    from vestige.recording.live.live_recording import LiveRecording

STDIN = Path("-")
FINISHED_ONLY = ("calibrate", "write_bias", "strict")
STDIN_ONLY = ("description", "sample_format", "layout", "sample_rate_hz", "center_frequency_hz", "real_time")
FOLLOW_ONLY = ("observations", *STDIN_ONLY)
# Options on which no verdict depends
_HOW = {"follow", "as_json", "output", "poll_s", "idle_s", "wait_s", "buffer_mb", "observations", "start", *STDIN_ONLY}
_READ = ("public_key", "merkle_tree", "second_channel", "navigation", "accelerations", "description")
_MOST_WARNINGS = 1000


def check_usage(recording: Path, options: dict[str, Any]) -> None:
    """Raise a usage error for options that do not go together."""

    def given(names: tuple[str, ...]) -> str:
        return ", ".join(f"--{name.replace('_', '-')}" for name in names if options[name])

    if options["accelerations"] and options["level"] != "3":
        raise click.UsageError("--accelerations: for level 3")
    if options["follow"]:
        if unfit := given(FINISHED_ONLY):
            raise click.UsageError(f"{unfit}: for a recording that is finished, not with --follow")
        if recording != STDIN and (unfit := given(STDIN_ONLY).replace("sample-format", "format")):
            raise click.UsageError(f"{unfit}: for samples on standard input, vestige process - --follow")
    elif recording == STDIN:
        raise click.UsageError("samples on standard input are read with --follow only")
    elif unfit := given(FOLLOW_ONLY).replace("sample-format", "format"):
        raise click.UsageError(f"{unfit}: only with --follow")


def inputs(recording: Path, options: dict[str, Any]) -> tuple[Path | None, ...]:
    """Return the files and folders that the command line names to be read."""
    return (recording, *(options[name] for name in _READ), *options["certificates"])


def follow_recording(recording: Path, options: dict[str, Any], processor: AcasProcessor) -> None:
    """Print verdicts and changes of state as they become available, until there is nothing more to come."""
    from vestige.recording.live.follow_journal import FollowJournal

    warn = _Warnings()
    following = _following(recording, options, warn)
    settings = _settings(recording, options, following.live)
    output, described = options["output"], following.live.description.files
    read = (*inputs(recording, options), *described, following.folder.path, options["observations"])
    check_output(output, (one for one in read if one != STDIN), folder=True)
    with nullcontext() if output is None else FollowJournal(output, settings) as journal:
        _run(following, processor, options, journal, warn)


def _run(
    following: Following,
    processor: AcasProcessor,
    options: dict[str, Any],
    journal: FollowJournal | None,
    warn: Callable[[object], None],
) -> None:
    from vestige.cli.recordings.verdicts import Tally, lines, print_changes, print_snapshot
    from vestige.recording.live.follow_journal import FollowProgress

    state, tally = None, Tally()
    if journal is not None and journal.progress is not None:
        following.index, following.after = journal.progress.index + 1, journal.progress.sent
        state = journal.progress.state
        echo(f"going on after snapshot {journal.progress.index}, {journal.progress.sent}", err=True)
    try:
        for epoch in following:
            if not tally.snapshots:
                _say_what_is_missing(following, warn)
                if why := processor.monitoring.fix.why_no_fix(epoch.sent):
                    warn(f"{options['navigation']}: {why}")
            since = None if state is None else state.last
            block = epoch.channels.block(epoch.snapshot, epoch.assistance, since)
            step = processor.step(state, block, epoch.assistance)
            state = step.state
            text = lines(step)
            if journal is not None:  # kept first: what was printed is never printed again
                journal.record(text, FollowProgress(index=epoch.snapshot.index, sent=epoch.sent, state=state))
            if options["as_json"]:
                for line in text:
                    echo(line)
            else:
                print_snapshot(step)
                print_changes(step)
            tally.add(step)
    except KeyboardInterrupt as stop:
        _print_end(tally, following.live.n_dropped, as_json=options["as_json"])
        stop.add_note(f"{tally.snapshots} snapshots: {tally}{_dropped(following.live.n_dropped)}")
        if journal is not None:
            stop.add_note(f"the same command goes on from {options['output']}")
        raise
    _print_end(tally, following.live.n_dropped, as_json=options["as_json"])
    if state is None:
        _say_what_is_missing(following, warn, still_to_come=())
    if tally.nothing and (tally.snapshots or state is None):
        echo(f"{tally.nothing}: {following.live.extent}", err=True)
    echo(f"{tally.snapshots} snapshots: {tally}{_dropped(following.live.n_dropped)}", err=True)
    _check_nothing_dropped(following.live.n_dropped, tally)


def _check_nothing_dropped(n_dropped: int, tally: Tally) -> None:
    from vestige.errors import VestigeError

    if n_dropped:
        raise VestigeError(
            f"standard input: the E6 samples of {n_dropped} of {tally.snapshots} snapshots were dropped, so they are "
            "NOT_AVAILABLE; a larger --buffer-mb drops fewer"
        )


def _dropped(n_dropped: int) -> str:
    return f"; the E6 samples of {n_dropped} were dropped" if n_dropped else ""


def _print_end(tally: Tally, n_dropped: int, *, as_json: bool) -> None:
    """Print what is known at the end only: the satellites with RECS that E1 never showed."""
    import json

    from vestige.cli.recordings.verdicts import print_not_seen

    if as_json:
        counts = {"snapshots": tally.snapshots, "dropped": n_dropped, "not_seen_on_e1": tally.not_seen_on_e1}
        echo(json.dumps({"kind": "end"} | counts))
    print_not_seen(tally, err=True)


class _Warnings:
    """Warns of everything once, and of so many things at most."""

    def __init__(self) -> None:
        self._told: set[str] = set()

    def __call__(self, what: object) -> None:
        line = str(what)
        if line not in self._told and len(self._told) < _MOST_WARNINGS:
            self._told.add(line)
            echo(f"warning: {line}", err=True)
            if len(self._told) == _MOST_WARNINGS:
                echo("warning: further warnings are not printed", err=True)


def _say_what_is_missing(
    following: Following, warn: Callable[[object], None], still_to_come: tuple[str, ...] = ("OSNMA keys", "RECS")
) -> None:
    """Warn of what was not there for the first epoch, but of what is still to come for later ones."""
    found = following.folder.found
    missing = (line for line in found.missing if not line.startswith(still_to_come))
    for line in (*following.live.description.notes, *missing, *found.warnings):
        warn(line)


def _following(recording: Path, options: dict[str, Any], warn: Callable[[object], None]) -> Following:
    from vestige.constants import SPEED_OF_LIGHT_MPS
    from vestige.errors import VestigeError
    from vestige.recording.assistance.growing_assistance import GrowingAssistance
    from vestige.recording.live.following import Following, WaitLimits
    from vestige.recording.observations.accelerations import GrowingAccelerations
    from vestige.recording.observations.e1_observation import TIME_TAG_TOLERANCE_S
    from vestige.recording.recording import named_observations, unread_observations

    description = _stdin_description(options) if recording == STDIN else _description(recording, options)
    stated_s = options["time_uncertainty"]
    around_s = description.time_uncertainty_s if stated_s is None else stated_s
    searchable = options["level"] != "1"
    if searchable and math.isinf(around_s):
        raise VestigeError(
            f"{description.path}: time uncertainty: found none, expected a bound on the clock's error to search in "
            "(--time-uncertainty)"
        )
    observations = options["observations"] or description.observations
    told = around_s <= TIME_TAG_TOLERANCE_S  # by E1 samples alone
    if observations is None and not told:
        for wrong in unread_observations(description):
            raise wrong
        raise VestigeError(
            f"{description.path}: observations: found none, expected a file of E1 observations (--observations), or a "
            f"clock that is right to {TIME_TAG_TOLERANCE_S:g} s: E1 samples alone tell time modulo 100 ms"
        )
    named = options["observations"] is not None or named_observations(description)
    live = _live(
        description,
        options,
        observations,
        warn,
        replaceable=told and not named,
        around_s=around_s if searchable else 0.0,
    )
    bias_m = options["hardware_bias_m"]
    if recording == STDIN and options["assistance_path"] is None:
        raise click.UsageError("samples on standard input need --assistance")
    folder = assistance_folder(recording, options["assistance_path"])
    trust = {"public_key": options["public_key"], "merkle_tree": options["merkle_tree"]}
    second, sensed = options["second_channel"], options["accelerations"]
    return Following(
        live=live,
        folder=GrowingAssistance(folder, **trust, certificates=options["certificates"], warn=warn),
        second=None if second is None else GrowingAssistance(second, **trust, warn=warn),
        accelerations=None if sensed is None else GrowingAccelerations(sensed, warn=warn),
        time_uncertainty_s=around_s,
        searchable=searchable,
        cn0_estimator=cn0_estimator(options, measured=observations is None),
        hardware_bias_s=None if bias_m is None else bias_m / SPEED_OF_LIGHT_MPS,
        patience=WaitLimits(poll_s=options["poll_s"], wait_s=options["wait_s"], idle_s=options["idle_s"]),
    )


def cn0_estimator(options: dict[str, Any], *, measured: bool) -> str:
    """Return the estimator of the C/N0 of E1; one that is asked for needs E1 to be measured in the samples."""
    if options["cn0_estimator"] is not None and not measured:
        raise click.UsageError("--cn0-estimator is for E1 out of samples; here a file of observations tells the C/N0")
    return options["cn0_estimator"] or "noise-floor"


def _live(
    description: RecordingDescription,
    options: dict[str, Any],
    observations: Path | None,
    warn: Callable[[object], None],
    *,
    replaceable: bool,
    around_s: float,
) -> LiveRecording:
    from vestige.errors import VestigeError
    from vestige.recording.live.live_recording import LiveRecording, buffer_s
    from vestige.recording.samples.sample_stream import SampleStream
    from vestige.records import Band

    stream, e6 = None, description.bands.get(Band.E6)
    if e6 is not None and e6.path == STDIN:
        capacity = round(options["buffer_mb"] * 1e6)
        second_bytes = e6.sample_rate_hz * e6.form.sample_bytes
        needed_mb = buffer_s(around_s) * second_bytes / 1e6
        if needed_mb * 1e6 > capacity:
            raise VestigeError(
                f"--buffer-mb: found {options['buffer_mb']:g}, expected at least {math.ceil(needed_mb)} for a clock "
                f"that may be wrong by {around_s:g} s (--time-uncertainty)"
            )
        stream = SampleStream(sys.stdin.fileno(), e6, capacity_bytes=capacity, can_wait=not options["real_time"])
    return LiveRecording(
        description,
        observations=observations,
        replaceable=replaceable,
        stream=stream,
        uncertainty_s=around_s,
        warn=warn,
    )


def _description(recording: Path, options: dict[str, Any]) -> RecordingDescription:
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


def _stdin_description(options: dict[str, Any]) -> RecordingDescription:
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


def _settings(recording: Path, options: dict[str, Any], live: LiveRecording) -> dict[str, str]:
    """Return what the verdicts depend on, in words."""
    from importlib.metadata import version

    from vestige.recording.exact_time import exact_gst

    bands = live.description.bands.values()
    kept = {f"--{name.replace('_', '-')}": value for name, value in options.items() if name not in _HOW}
    settings = {name: str(value) for name, value in kept.items() if value not in (None, (), False)}
    samples = ", ".join(f"{file.band.name} {file.form} at {file.sample_rate_hz!r} Hz" for file in bands)
    if recording != STDIN:  # a pipe begins anew each time
        samples += f", from {exact_gst(live.start)}"
    if own := [kind for kind in (options["detector"], *options["checks"]) if is_own(kind)]:
        settings["own parts"] = " ".join(f"{kind}@{digest(kind)}" for kind in own)
    return settings | {"vestige": version("vestige"), "recording": samples}
