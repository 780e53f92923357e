"""Run `vestige live`: print verdicts while the recording is being written."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.live.live_input import (
    STDIN,
    STDIN_OPTIONS,
    live_description,
    live_tracking,
    opened_live,
    stdin_description,
)
from vestige.cli.options import assistance_folder
from vestige.cli.outputs.other_programs import OUTPUT_NAMES, check_outputs, outputs_for_others
from vestige.cli.recordings.process_options import check_named_inputs, check_processor_usage, cn0_estimator, inputs
from vestige.cli.recordings.time_tag import on_signal_clock, time_tag_warning
from vestige.cli.terminal import echo, note, warn
from vestige.errors import VestigeError
from vestige.output import check_output
from vestige.own_parts import digest, is_own

if TYPE_CHECKING:
    from vestige.acas_processor.processor import AcasProcessor, Step
    from vestige.cli.outputs.verdict_lines import EndLine
    from vestige.cli.recordings.verdicts import Tally
    from vestige.recording.live.follow_journal import FollowJournal
    from vestige.recording.live.following import FollowedEpoch, Following
    from vestige.recording.live.live_recording import LiveRecording
    from vestige.recording.live.live_tracking import LiveTracking

STDIN_ONLY = (*STDIN_OPTIONS, "real_time")
# names of the options that do not affect verdicts
_HOW = {
    "workers",
    *OUTPUT_NAMES,
    "as_json",
    "output",
    "poll_s",
    "idle_s",
    "wait_s",
    "buffer_mb",
    "fail_on",
    "observations",
    "start",
    *STDIN_ONLY,
}
_MOST_WARNINGS = 1000


def check_usage(recording: Path, options: dict[str, Any]) -> None:
    """Raise a usage error for options that exclude each other, or that do not apply to this recording."""
    check_processor_usage(options)
    given = ", ".join(f"--{name.replace('_', '-')}" for name in STDIN_ONLY if options[name])
    if recording != STDIN and given:
        raise click.UsageError(
            f"{given.replace('sample-format', 'format')}: only for samples on standard input (vestige live -)"
        )


def follow_recording(recording: Path, options: dict[str, Any], processor: AcasProcessor) -> None:
    """Print verdicts and changes of state as they become available, until the recording ends."""
    from vestige.recording.live.follow_journal import FollowJournal

    warn = _Warnings()
    following = _following(recording, options, warn)
    settings = _settings(recording, options, following.live)
    output, described = options["output"], following.live.description.files
    read = (
        *inputs(recording, options),
        options["description"],
        *described,
        following.folder.path,
        options["observations"],
    )
    files = tuple(one for one in read if one != STDIN)
    check_output(output, files, folder=True)
    check_outputs(options, files)
    with (
        outputs_for_others(options, replace=False) as write,
        nullcontext() if output is None else FollowJournal(output, settings) as journal,
    ):
        _run(following, processor, options, journal, write, warn)


def _run(
    following: Following,
    processor: AcasProcessor,
    options: dict[str, Any],
    journal: FollowJournal | None,
    write: Callable[[Step], None],
    warn: Callable[[object], None],
) -> None:
    from vestige.cli.recordings.verdicts import Tally, lines, print_changes, print_snapshot
    from vestige.recording.assistance.made_recs import open_code_warning
    from vestige.recording.live.follow_journal import FollowProgress

    tracking, corrected = following.live.tracking, _SignalClock(warn)
    state, tally = None, Tally(tracked=frozenset() if tracking is None else tracking.seen)
    early = _EarlyRecs(tracking, tally, warn)
    if journal is not None and journal.progress is not None:
        following.index, following.after = journal.progress.index + 1, journal.progress.sent
        state = journal.progress.state
        following.live.resume(journal.progress.sent, journal.progress.time_tag_error_s)
        note(f"continuing after snapshot {journal.progress.index}, {journal.progress.sent}")
    try:
        for epoch in following:
            if not tally.snapshots:
                _say_what_is_missing(following, warn)
                if options["navigation"] and (why := processor.monitoring.fix.why_no_fix(epoch.sent)):
                    warn(f"{options['navigation']}: {why}")
            early.take(epoch)
            known = epoch.assistance
            now = (one for one in known.segments if one.transmit_time == epoch.sent)
            if open_code := open_code_warning(
                following.folder.path, now, known.keys, cipher_mode=processor.cipher_mode
            ):
                warn(open_code)
            processor = _with_orbits(processor, following, options)
            since = None if state is None else state.last
            block = epoch.channels.block(epoch.snapshot, epoch.assistance, since)
            late_s = epoch.time_tag_error_s
            step = corrected(processor.step(state, block, epoch.assistance), late_s)
            state = step.state
            text = lines(step)
            if journal is not None:  # the lines are stored before they are printed, so that no line is printed twice
                progress = FollowProgress(
                    index=epoch.snapshot.index, sent=epoch.sent, state=state, time_tag_error_s=late_s
                )
                journal.record(text, progress)
            if options["as_json"]:
                for line in text:
                    echo(line)
            else:
                print_snapshot(step)
                print_changes(step)
            write(step)
            tally.add(step)
    except KeyboardInterrupt as stop:
        _print_end(tally, following.live.n_dropped, as_json=options["as_json"])
        stop.add_note(f"{tally.snapshots} snapshots: {tally}{_dropped(following.live.n_dropped)}")
        if journal is not None:
            stop.add_note(f"the same command continues from {options['output']}")
        raise
    early.end(following.live.why_no_ranges)
    if state is None:
        _say_what_is_missing(following, warn, still_to_come=())
    _end(tally, following, options, waited=bool(tally.snapshots or state is None))


def _end(tally: Tally, following: Following, options: dict[str, Any], *, waited: bool) -> None:
    """Print the summary, and end the command with exit status 3 if the verdicts match the value of `--fail-on`.

    The function raises `VestigeError` if E6 samples were dropped.
    """
    from vestige.cli.recordings.advice import in_one_line
    from vestige.cli.recordings.verdicts import exit_status

    n_dropped = following.live.n_dropped
    _print_end(tally, n_dropped, as_json=options["as_json"])
    if tally.nothing and waited and not tally.too_early:  # RECS before E1 was tracked have their own warning
        warn(f"{tally.nothing}: {following.live.extent}")
    elif tally.counts and tally.advice:
        warn(in_one_line(tally.advice))
    note(f"{tally.snapshots} snapshots: {tally}{_dropped(n_dropped)}")
    _check_nothing_dropped(n_dropped, tally)
    exit_status(tally, options["fail_on"])


def _with_orbits(processor: AcasProcessor, following: Following, options: dict[str, Any]) -> AcasProcessor:
    """Return the processor with the orbits that the tracked message has given so far.

    The processor also gets the satellites whose orbits OSNMA tags have verified. If E1 is not tracked, or a navigation
    file is given, the processor is returned unchanged.
    """
    tracking, monitoring = following.live.tracking, processor.monitoring
    if tracking is None or options["navigation"] is not None:
        return processor
    orbits, authenticated = tracking.message.ephemerides()
    if (orbits, authenticated) == (monitoring.fix.ephemerides, monitoring.fix.authenticated):
        return processor
    fix = replace(monitoring.fix, ephemerides=orbits, authenticated=authenticated)
    return replace(processor, monitoring=replace(monitoring, fix=fix))


def _check_nothing_dropped(n_dropped: int, tally: Tally) -> None:

    if n_dropped:
        raise VestigeError(
            f"standard input: the E6 samples of {n_dropped} of {tally.snapshots} snapshots were dropped, so these "
            "snapshots are NOT_AVAILABLE; give a larger --buffer-mb"
        )


def _dropped(n_dropped: int) -> str:
    return f"; the E6 samples of {n_dropped} were dropped" if n_dropped else ""


def _print_end(tally: Tally, n_dropped: int, *, as_json: bool) -> None:
    """Print the satellites that have RECS and were never found on E1; with `as_json`, also print the last JSON line."""
    import json

    from vestige.cli.recordings.verdicts import print_not_seen

    if as_json:
        end: EndLine = {
            "kind": "end",
            "snapshots": tally.snapshots,
            "dropped": n_dropped,
            "not_seen_on_e1": tally.not_seen_on_e1,
        }
        echo(json.dumps(end))
    print_not_seen(tally, note)


class _Warnings:
    """Printer that prints each warning once, and at most `_MOST_WARNINGS` warnings in total."""

    def __init__(self) -> None:
        self._told: set[str] = set()

    def __call__(self, what: object) -> None:
        line = str(what)
        if line not in self._told and len(self._told) < _MOST_WARNINGS:
            self._told.add(line)
            warn(line)
            if len(self._told) == _MOST_WARNINGS:
                warn("further warnings are not printed")


class _SignalClock:
    """Function that corrects the times in the output, and warns of the error of the time tag.

    A warning is printed if the error differs by more than `TIME_TAG_TOLERANCE_S` from the error in the last warning, or
    from 0 before the first warning.
    """

    def __init__(self, warn: Callable[[object], None]) -> None:
        self._warn, self._said_s = warn, 0.0

    def __call__(self, step: Step, late_s: float) -> Step:
        """Return a processor step with times on the clock of the signal; `late_s` is the error of the time tag in s."""
        if line := time_tag_warning(late_s, self._said_s):
            self._warn(line)
            self._said_s = late_s
        return on_signal_clock(step, late_s)


class _EarlyRecs:
    """Printer of a single warning about RECS that were sent before E1 was tracked.

    The warning is printed at the first RECS that is sent while E1 is tracked, or at the end of the recording.
    """

    def __init__(self, tracking: LiveTracking | None, tally: Tally, warn: Callable[[object], None]) -> None:
        self._tracking, self._tally, self._warn = tracking, tally, warn
        self._count, self._late_s = 0, 0.0

    def take(self, epoch: FollowedEpoch) -> None:
        """Count the RECS of an epoch if they were sent before E1 was tracked; otherwise print the warning.

        Only the RECS of satellites that tracking has found are counted. Until tracking has given an observation, this
        method does nothing.
        """
        from vestige.recording.tracked.track_recording import tracked_since

        if self._tracking is None or self._tracking.first_observed is None:
            return
        if epoch.sent >= tracked_since(self._tracking.first_observed, epoch.time_tag_error_s):
            self.say()
            return
        now = (one for one in epoch.assistance.segments if one.transmit_time == epoch.sent)
        self._count += sum(one.svid in self._tracking.seen for one in now)
        self._late_s = epoch.time_tag_error_s

    def say(self) -> None:
        """Print the warning about the RECS that `take` has counted; print nothing if the count is 0."""
        from vestige.recording.tracked.track_recording import early_recs_warning

        if self._count and self._tracking is not None and self._tracking.first_observed is not None:
            self._tally.too_early = early_recs_warning(self._count, self._tracking.first_observed + -self._late_s)
            self._warn(self._tally.too_early)
        self._count = 0

    def end(self, why_no_ranges: str) -> None:
        """Print the warning at the end of the recording; `why_no_ranges` says why E1 has no ranges, or is empty."""
        self.say()
        if self._tally.missed:
            self._tally.too_early = self._tally.too_early or why_no_ranges


def _say_what_is_missing(
    following: Following, warn: Callable[[object], None], still_to_come: tuple[str, ...] = ("OSNMA keys", "RECS")
) -> None:
    """Print the notes of the recording, the missing data, and the warnings about the assistance.

    Missing data whose warning begins with one of `still_to_come` may still arrive, and are left out.
    """
    found = following.folder.found
    missing = (line for line in found.missing if not line.startswith(still_to_come))
    for line in (*following.live.description.notes, *missing, *found.warnings):
        warn(line)


def _following(recording: Path, options: dict[str, Any], warn: Callable[[object], None]) -> Following:
    from vestige.constants import SPEED_OF_LIGHT_MPS
    from vestige.recording.assistance.growing_assistance import GrowingAssistance
    from vestige.recording.live.following import Following, WaitLimits
    from vestige.recording.observations.accelerations import GrowingAccelerations
    from vestige.recording.observations.e1_observation import TIME_TAG_TOLERANCE_S
    from vestige.recording.recording import named_observations, unread_observations

    description = stdin_description(options) if recording == STDIN else live_description(recording, options)
    stated_s = options["time_uncertainty"]
    around_s = description.time_uncertainty_s if stated_s is None else stated_s
    searchable = options["level"] != "1"
    if searchable and math.isinf(around_s):
        raise VestigeError(
            f"{description.path}: time uncertainty: found none, expected an upper limit of the clock's error "
            "(--time-uncertainty)"
        )
    tracking = live_tracking(description, options, warn)
    observations = None if tracking else options["observations"] or description.observations
    told = around_s <= TIME_TAG_TOLERANCE_S  # whether the clock is good enough to get the time from 100 ms of E1
    if observations is None and tracking is None and not told:
        for wrong in unread_observations(description):
            raise wrong
        raise VestigeError(
            f"{description.path}: observations: found none, expected E1 samples to track, a file of E1 observations "
            f"(--observations), or a clock that is right to {TIME_TAG_TOLERANCE_S:g} s: 100 ms of E1 tell time only "
            "modulo "
            "100 ms"
        )
    named = options["observations"] is not None or named_observations(description)
    bias_m = options["hardware_bias_m"]
    if recording == STDIN and options["assistance_path"] is None:
        raise click.UsageError("samples on standard input need --assistance")
    folder = assistance_folder(recording, options["assistance_path"])
    trust = {"public_key": options["public_key"], "merkle_tree": options["merkle_tree"]}
    message = None if tracking is None else tracking.message
    second, sensed = options["second_channel"], options["accelerations"]
    check_named_inputs(options, folder, second)
    live = opened_live(
        description,
        options,
        observations,
        tracking,
        warn,
        replaceable=told and not named,
        told=told,
        around_s=around_s if searchable else 0.0,
    )
    return Following(
        live=live,
        folder=GrowingAssistance(folder, **trust, certificates=options["certificates"], message=message, warn=warn),
        second=None if second is None else GrowingAssistance(second, **trust, warn=warn),
        accelerations=None if sensed is None else GrowingAccelerations(sensed, warn=warn),
        time_uncertainty_s=around_s,
        searchable=searchable,
        cn0_estimator=cn0_estimator(options, measured=observations is None and tracking is None),
        hardware_bias_s=None if bias_m is None else bias_m / SPEED_OF_LIGHT_MPS,
        patience=WaitLimits(poll_s=options["poll_s"], wait_s=options["wait_s"], idle_s=options["idle_s"]),
    )


def _settings(recording: Path, options: dict[str, Any], live: LiveRecording) -> dict[str, str]:
    """Return the settings on which the verdicts depend, as texts by name."""
    from vestige import __version__
    from vestige.recording.exact_time import exact_gst

    bands = live.description.bands.values()
    kept = {f"--{name.replace('_', '-')}": value for name, value in options.items() if name not in _HOW}
    settings = {name: str(value) for name, value in kept.items() if value not in (None, (), False)}
    samples = ", ".join(f"{file.band.name} {file.form} at {file.sample_rate_hz!r} Hz" for file in bands)
    if recording != STDIN:  # on standard input, each run has another start time
        samples += f", from {exact_gst(live.start)}"
    if own := [kind for kind in (options["detector"], *options["checks"]) if is_own(kind)]:
        settings["own parts"] = " ".join(f"{kind}@{digest(kind)}" for kind in own)
    return settings | {"vestige": __version__, "recording": samples}
