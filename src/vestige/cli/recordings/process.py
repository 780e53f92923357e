"""`vestige process`: authenticate a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.loop_options import check_no_loop_options, loop_settings
from vestige.cli.option_groups import GroupedCommand
from vestige.cli.options import PATH, assistance_folder
from vestige.cli.outputs.other_programs import (
    OUTPUT_NAMES,
    check_outputs,
    output_options,
    outputs_for_others,
)
from vestige.cli.recordings.process_options import (
    PROCESSOR_GROUPS,
    check_named_inputs,
    check_processor_usage,
    cn0_estimator,
    inputs,
    processor_options,
)
from vestige.cli.recordings.processor_from_options import processor_from_options
from vestige.cli.recordings.time_tag import label_error_s, label_uncertainty_s, on_signal_clock, time_tag_warning
from vestige.cli.terminal import detail, warn, with_common_options
from vestige.errors import VestigeError
from vestige.output import check_output

if TYPE_CHECKING:
    from vestige.acas_processor.processor import AcasProcessor, Step
    from vestige.recording.assistance.folder import Message
    from vestige.recording.recorded_block import OtherChannels
    from vestige.recording.recording import Recording
    from vestige.recording.snapshots import RecordingSource
    from vestige.recording.tracked.track_recording import TrackedRecording
    from vestige.records import Assistance
    from vestige.time import GalileoTime

# Share of the estimated correction that each step of the calibration applies. Behind a narrow filter the correlation
# peak is round, so linear interpolation estimates up to twice the true offset. Steps with the whole estimate would
# oscillate, but steps with half the estimate converge after the first step.
_CALIBRATION_STEPS = (1.0, 0.5, 0.5, 0.5, 0.5, 0.5)


class _Process(GroupedCommand):
    """Command `vestige process`, which passes standard input and the former option `--follow` on to `vestige live`."""

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        reading = click.Context(self, parent, info_name, resilient_parsing=True, ignore_unknown_options=True)
        found, _, _ = self.make_parser(reading).parse_args(list(args))  # `-` may also be the value of an option
        if "--follow" not in args and found.get("recording_path") != "-":
            return super().make_context(info_name, args, parent, **extra)
        from vestige.cli.live.live import command

        live = with_common_options(command)
        return live.make_context("live", [one for one in args if one != "--follow"], parent, **extra)

    def invoke(self, ctx: click.Context) -> Any:
        return super().invoke(ctx) if ctx.command is self else ctx.command.invoke(ctx)


@click.command(
    cls=_Process, groups={"Output": ("output", "as_json", *OUTPUT_NAMES, "fail_on", "strict")} | PROCESSOR_GROUPS
)
@processor_options
@click.option(
    "--calibrate", is_flag=True, help="Take the median E6 range offset of this recording as the hardware bias."
)
@click.option(
    "--write-bias",
    type=PATH,
    help="Write the hardware bias into this folder, as receiver.toml. vestige reads this file only in the assistance "
    "folder.",
)
@click.option("-o", "--output", type=PATH, help="Write the verdicts into this CSV file.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@output_options
@click.option("--strict", is_flag=True, help="Stop at a damaged assistance file, instead of printing a warning.")
def command(recording_path: Path, **options: Any) -> None:
    """Authenticate RECORDING, and give one verdict for each satellite and RECS.

    RECORDING is a folder with a `recording.toml`, SigMF files or ION metadata, or a single file of these kinds. For
    each RECS the command tests whether the encrypted signal in E6 arrives at the time that E1 predicts. The command
    also tests whether this signal was received before anybody could know the key. E1 is tracked if there are no
    observations, and the E1 samples last at least 2 s (see --track). For a recording that is still being written, use
    `vestige live`.
    """
    from contextlib import ExitStack
    from dataclasses import replace

    from vestige.cli.progress import progress
    from vestige.cli.recordings.verdicts import Tally, csv_writer, exit_status, print_json, print_table
    from vestige.recording.assistance.receiver_corrections import RECEIVER_NAME, write_hardware_bias
    from vestige.recording.recording import open_recording

    check_processor_usage(options)
    options["recording_path"] = recording_path
    recording = open_recording(recording_path, start=options["start"])
    folder = assistance_folder(recording_path, options["assistance_path"])
    read = (*inputs(recording_path, options), *recording.description.files, folder)
    check_output(options["output"], read)
    check_outputs(options, read)
    if options["write_bias"]:
        check_output(options["write_bias"] / RECEIVER_NAME, recording.description.files)
    channels = _channels(options)
    with ExitStack() as stack:  # outputs are opened before E1 is tracked, because tracking takes long
        writers = [stack.enter_context(csv_writer(options["output"]))] if options["output"] else []
        writers.append(stack.enter_context(outputs_for_others(options, replace=True)))
        tracked = _tracked(recording, options, folder)
        processor, source, warnings = prepared(recording, options, tracked, channels)
        tally = Tally(
            tracked=_satellites(tracked),
            too_early=_sent_before_tracking(source, tracked),
            no_recs=_why_no_recs(warnings),
            has_orbits=bool(processor.monitoring.fix.ephemerides),
        )
        if tally.too_early:
            warn(tally.too_early)
            warnings.append(tally.too_early)
        report = stack.enter_context(progress())
        steps, bias_s = _steps(processor, replace(source, progress=report), calibrate=options["calibrate"])
        if options["write_bias"]:
            write_hardware_bias(options["write_bias"], bias_s)
        steps = (on_signal_clock(step, source.time_tag_error_s) for step in steps if _is_shown(step))
        for write in writers:
            steps = _written(steps, write)
        if options["as_json"]:
            remarks = {"calibrated_on_itself": options["calibrate"], "warnings": warnings}
            print_json(steps, tally, hardware_bias_s=bias_s, remarks=remarks)
        else:
            print_table(steps, tally, hardware_bias_s=bias_s)
    if options["positions"] and tally.no_position:
        warn(tally.no_position)
    exit_status(tally, options["fail_on"])


def prepared(
    recording: Recording, options: dict[str, Any], tracked: TrackedRecording | None, channels: OtherChannels
) -> tuple[AcasProcessor, RecordingSource, list[str]]:
    """Return the processor and the source of snapshots that the options describe, and the warnings that were printed.

    Parameters
    ----------
    recording
        The opened recording.
    options
        Values of the options of `vestige process`, by parameter name.
    tracked
        Result of tracking E1; None if E1 was not tracked.
    channels
        Data of the second OSNMA channel and of the accelerometer.
    """
    from vestige.recording.assistance.folder import read_assistance
    from vestige.recording.assistance.made_recs import open_code_warning
    from vestige.recording.assistance.receiver_corrections import RECEIVER_NAME
    from vestige.recording.snapshots import RecordingSource, time_span

    folder = assistance_folder(options["recording_path"], options["assistance_path"])
    told_s = None if tracked is None else tracked.time_tag_error_s
    around_s = label_uncertainty_s(recording, options["time_uncertainty"]) if told_s is None else 0.0
    found = read_assistance(
        folder,
        public_key=options["public_key"],
        merkle_tree=options["merkle_tree"],
        certificates=options["certificates"],
        window=time_span(recording, told_s or 0.0, uncertainty_s=around_s),
        strict=options["strict"],
        message=_message(recording, tracked),
    )
    if options["near"] and tracked is None and options["navigation"] is None:
        raise click.UsageError("--near needs orbits: add --navigation, or --track for the orbits of the message")
    processor = processor_from_options(options, tracked, found.navigation)
    detail(processor.limits)
    known = found.assistance
    missing = found.missing_for(_span(recording, told_s or 0.0))
    if options["hardware_bias_m"] is not None or options["calibrate"]:  # these options give the hardware bias
        missing = tuple(line for line in missing if not line.startswith(RECEIVER_NAME))
    warnings: list[str] = []

    def say(*lines: object) -> None:
        for line in lines:
            warn(line)
            warnings.append(str(line))

    say(*recording.notes, *found.problems, *missing, *found.warnings)
    if open_code := open_code_warning(folder, known.segments, known.keys, cipher_mode=processor.cipher_mode):
        say(open_code)
    if options["calibrate"]:
        say(
            "--calibrate takes the hardware bias from this recording itself: "
            "a delay of E6 that is common to all satellites cannot be seen"
        )
    error_s = told_s or 0.0
    if around_s and known.segments:
        error_s = label_error_s(recording, known, around_s, processor, say)
    source = RecordingSource(
        recording=recording,
        assistance=_with_bias(known, options["hardware_bias_m"]),
        tracked=None if tracked is None else tracked.epochs,
        time_uncertainty_s=options["time_uncertainty"],
        time_tag_error_s=error_s,
        searchable=options["level"] != "1",
        cn0_estimator=cn0_estimator(options, measured=recording.observations is None and tracked is None),
        channels=channels,
    )
    if (sent := min(source.epochs(), default=None)) and (why := processor.monitoring.fix.why_no_fix(sent)):
        say(f"{options['navigation']}: {why}")
    say(*_missing_bands(recording), *filter(None, [time_tag_warning(told_s or 0.0)]))
    return processor, source, warnings


def _span(recording: Recording, late_s: float) -> tuple[GalileoTime, GalileoTime] | None:
    """Return the times at which the E6 samples begin and end, on the clock of the signal; None without E6."""
    e6 = recording.e6
    return None if e6 is None else (e6.start + -late_s, e6.start + (e6.duration_s - late_s))


def _why_no_recs(warnings: Iterable[str]) -> str:
    """Return why the assistance has no RECS for the recording; "" if the assistance has RECS."""
    from vestige.recording.assistance.missing_data import NO_RECS
    from vestige.recording.assistance.other_times import OTHER_TIMES

    if NO_RECS in warnings:
        return "the assistance folder has no usable RECS; get the RECS for the time of the recording"
    return next((line for line in warnings if line.startswith(OTHER_TIMES)), "")


def _missing_bands(recording: Recording) -> list[str]:
    """Return a warning for each missing band that a verdict needs."""
    lacks = []
    if recording.e6 is None:
        lacks.append("no E6 samples, so no RECS can be looked for and there is no verdict")
    if recording.e1 is None and recording.observations is None:
        lacks.append("no E1 samples and no observations, so no RECS can be looked for and there is no verdict")
    return lacks


def _satellites(tracked: TrackedRecording | None) -> frozenset[int]:
    """Return the satellites that were tracked on E1 at any time; none if E1 was not tracked."""
    return frozenset(svid for epoch in (() if tracked is None else tracked.epochs) for svid in epoch.observations)


def _sent_before_tracking(source: RecordingSource, tracked: TrackedRecording | None) -> str:
    """Return a warning if RECS of tracked satellites came before the tracking of E1 began; "" otherwise."""
    from vestige.recording.tracked.track_recording import early_recs_warning, tracked_since

    epochs = () if tracked is None else tracked.epochs
    first = next((epoch for epoch in epochs if epoch.observations), None)
    if first is None:
        return ""
    seen, late_s = _satellites(tracked), source.time_tag_error_s
    begin = tracked_since(first.time, late_s)
    n = sum(one.svid in seen for time, segments in source.epochs().items() if time < begin for one in segments)
    return early_recs_warning(n, first.time + -late_s) if n else ""


def _is_shown(step: Step) -> bool:
    """Return whether a step has verdicts of RECS, or an alarm between two RECS."""
    return bool(step.block.measured.snapshots.recs.any()) or any(change.alarm for change in step.changes)


def _written(steps: Iterator[Step], write: Callable[[Step], None]) -> Iterator[Step]:
    for step in steps:
        write(step)
        yield step


def _with_bias(assistance: Assistance, bias_m: float | None) -> Assistance:
    from dataclasses import replace

    from vestige.constants import SPEED_OF_LIGHT_MPS

    return assistance if bias_m is None else replace(assistance, hardware_bias_e1_e6_s=bias_m / SPEED_OF_LIGHT_MPS)


def _tracked(recording: Recording, options: dict[str, Any], folder: Path) -> TrackedRecording | None:
    """Return the result of tracking E1; None if E1 is not tracked.

    E1 is not tracked without E1 samples, or with `--no-track`. Without the option `--track`, E1 is not tracked either
    if observations are given, or if E1 is shorter than `MIN_TRACKED_S`.

    The assistance folder `folder` and the other inputs are opened before tracking, because tracking takes long.
    """
    from vestige.cli.progress import progress
    from vestige.recording.assistance.folder import read_assistance
    from vestige.recording.tracked.track_recording import MIN_TRACKED_S, track_recording

    e1, wish = recording.e1, options["track"]
    if (
        e1 is None
        or wish is False
        or (wish is None and (recording.observations is not None or e1.duration_s < MIN_TRACKED_S))
    ):
        check_no_loop_options()
        return None
    cn0_estimator(options, measured=False)
    processor_from_options(options)
    check_named_inputs(options, folder)
    if options["strict"]:
        trust = {name: options[name] for name in ("public_key", "merkle_tree", "certificates")}
        read_assistance(folder, **trust, strict=True)
    with progress() as report:
        return track_recording(recording, loop_settings(options), workers=options["workers"], progress=report)


def _message(recording: Recording, tracked: TrackedRecording | None) -> Message | None:
    """Return the navigation message that tracking decoded; None if tracking decoded no pages."""
    from functools import partial

    from vestige.recording.assistance.assistance_files import contents_of_pages

    if tracked is None or not tracked.pages:
        return None
    path = recording.description.path
    return path, partial(contents_of_pages, path, tracked.pages)


def _channels(options: dict[str, Any]) -> OtherChannels:
    """Return the data of the second OSNMA channel and of the accelerometer, read at once for all epochs."""
    from vestige.recording.observations.accelerations import read_accelerations
    from vestige.recording.recorded_block import OtherChannels

    path = options["accelerations"]
    return OtherChannels(
        second_channel=_second_channel(options),
        accelerations=None if path is None else read_accelerations(path),
    )


def _second_channel(options: dict[str, Any]) -> Assistance | None:
    """Return the OSNMA data of the second channel, and warn of faults in the data; None without `--second-channel`."""
    from vestige.recording.assistance.folder import read_assistance

    folder = options["second_channel"]
    if folder is None:
        return None
    found = read_assistance(folder, public_key=options["public_key"], merkle_tree=options["merkle_tree"])
    for problem in found.problems:
        warn(problem)
    if not found.assistance.keys:
        raise VestigeError(
            f"{folder}: second channel: found no validated OSNMA key, expected keys or pages of the second channel "
            "and their public key or Merkle tree; put them into this folder, or give --public-key or --merkle-tree"
        )
    return found.assistance


def _steps(processor: AcasProcessor, source: RecordingSource, *, calibrate: bool) -> tuple[Iterator[Step], float]:
    """Return an iterator over the processor's results for the snapshots, and the hardware bias in use in s.

    With `calibrate`, the hardware bias is estimated from all snapshots first.
    """
    from dataclasses import replace

    from vestige.acas_processor.monitoring.calibration import MIN_SATELLITES, hardware_bias_correction_s

    assistance = source.assistance
    if not calibrate:
        return processor.steps(source, assistance=assistance), assistance.hardware_bias_e1_e6_s
    blocks = list(source)
    for step in _CALIBRATION_STEPS:
        measured = [processor.measure(block, assistance) for block in blocks]
        correction_s = hardware_bias_correction_s(measured)
        if correction_s is None:
            raise VestigeError(
                f"--calibrate: fewer than {MIN_SATELLITES} satellites were detected, so no bias is known"
            )
        assistance = replace(assistance, hardware_bias_e1_e6_s=assistance.hardware_bias_e1_e6_s + step * correction_s)
    return processor.steps(blocks, assistance=assistance), assistance.hardware_bias_e1_e6_s
