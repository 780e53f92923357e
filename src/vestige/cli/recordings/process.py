"""`vestige process`: authenticate a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.options import (
    FiniteRange,
    assistance_folder,
    cipher_mode,
    cipher_mode_option,
    detector_option,
    group_delay_convention,
    group_delay_option,
    parts_option,
    recording_argument,
    start_option,
    threads_option,
    trust_options,
)
from vestige.cli.recordings.follow import check_usage, cn0_estimator, follow_recording, inputs
from vestige.cli.recordings.follow_input import STDIN, stdin_options
from vestige.cli.recordings.time_tag import label_error_s, label_uncertainty_s
from vestige.cli.terminal import echo
from vestige.cli.usual_levels import expected_e6_over_e1_db, pseudorange_errors, reference_levels, usual_level_options
from vestige.output import check_output

if TYPE_CHECKING:
    from vestige.acas_processor.detectors import Detector
    from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings
    from vestige.acas_processor.processor import AcasProcessor, Step
    from vestige.recording.assistance.folder import Message
    from vestige.recording.recorded_block import OtherChannels
    from vestige.recording.recording import Recording
    from vestige.recording.snapshots import RecordingSource
    from vestige.recording.tracked.track_recording import TrackedRecording
    from vestige.records import Assistance

_path = click.Path(path_type=Path)
CN0_ESTIMATOR_NAMES = (
    "noise-floor",
    "narrow-to-wide",
    "moments",
    "signal-to-noise-variance",
    "beaulieu",
    "real-signal-complex-noise",
)
# Behind a narrow filter the peak is round, and the linear interpolation answers with up to twice the offset: half steps
# after the first converge where whole ones would swing.
_CALIBRATION_STEPS = (1.0, 0.5, 0.5, 0.5, 0.5, 0.5)


@click.command()
@recording_argument
@click.option("--assistance", "assistance_path", type=_path, help="Assistance folder [RECORDING/assistance].")
@trust_options
@click.option(
    "--certificate", "certificates", multiple=True, type=_path, help="Assistance server's key; refuse unsigned."
)
@click.option("--level", type=click.Choice(["1", "2", "3"]), default="1", show_default=True, help="Mitigation level.")
@click.option(
    "--navigation", type=_path, help="RINEX navigation file, in place of the orbits in the message: positions."
)
@click.option(
    "--track/--no-track",
    default=None,
    help="Track E1 in the samples, or measure it in 100 ms around each RECS. [track where there are no observations]",
)
@threads_option("Threads that track E1.")
@click.option("--second-channel", type=_path, help="Folder with OSNMA keys or pages of another channel, level 3.")
@click.option("--accelerations", type=_path, help="CSV of inertial sensors, for level 3.")
@click.option(
    "--acceleration-bias-mps2", type=FiniteRange(0, 10), default=0.01, show_default=True, help="Their bias, 1 sigma."
)
@click.option(
    "--search-ms", type=click.Choice(["1", "2", "4", "8", "16"]), default="4", show_default=True, help="Level 3."
)
@click.option("--search-window", type=FiniteRange(1e-6, 1e5), help="Level 3: search E6 ± so many s, not everywhere.")
@click.option("--search-every", type=FiniteRange(0, 1e9), default=3600.0, show_default=True, help="Level 3: seconds.")
@usual_level_options
@detector_option
@click.option("--check", "checks", multiple=True, metavar="module:Name", help="A check of your own; several times.")
@parts_option
@click.option("--spacing", type=click.IntRange(1), default=1, show_default=True, help="Early-late spacing in taps.")
@click.option("--p-fa", type=FiniteRange(1e-15, 0.1), default=1e-7, show_default=True, help="Per correlator.")
@click.option("--taps", type=click.IntRange(3, 63), default=11, show_default=True, help="Number of correlators.")
@click.option("--tap-spacing-m", type=FiniteRange(0.1, 100), default=15.0, show_default=True)
@click.option(
    "--early-reach-m",
    type=FiniteRange(0, 900),
    default=600.0,
    show_default=True,
    help="Further correlators as far before the prediction, against a repeater with a short delay.",
)
@click.option("--budget", type=click.Choice(["uncorrected", "corrected"]), default="uncorrected", show_default=True)
@click.option("--kappa", type=FiniteRange(0.1, 10), default=3.0, show_default=True, help="Range limit in σ.")
@click.option("--min-pd", type=FiniteRange(0, 1), default=0.9, show_default=True)
@cipher_mode_option
@group_delay_option
@click.option("--hardware-bias-m", type=FiniteRange(-1e7, 1e7), help="Delay of E6 minus E1 in the receiver, in m.")
@click.option("--cn0-estimator", type=click.Choice(CN0_ESTIMATOR_NAMES), help="E1 out of samples [noise-floor].")
@click.option("--calibrate", is_flag=True, help="Take the median range offset of this recording as hardware bias.")
@click.option("--write-bias", type=_path, help="Folder in which to keep the bias, as receiver.toml.")
@click.option("--time-uncertainty", type=FiniteRange(0, 1e6), help="Bound on the receiver clock's error in s.")
@start_option
@click.option("-o", "--output", type=_path, help="CSV file for the verdicts; with --follow a folder to go on from.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object; with --follow one a line.")
@click.option("--strict", is_flag=True, help="A damaged assistance file is an error, not a warning.")
@click.option("--follow", is_flag=True, help="RECORDING is still being written: print verdicts as they become known.")
@click.option("--observations", type=_path, help="Follow: file of E1 observations, if RECORDING does not name it.")
@click.option("--poll-s", type=FiniteRange(0.001, 60), default=1.0, show_default=True, help="Follow: look so often.")
@click.option("--idle-s", type=FiniteRange(0, 1e7), help="Follow: end when nothing new came for so long.")
@click.option("--wait-s", type=FiniteRange(0, 1e7), default=180.0, show_default=True, help="Follow: for a key.")
@click.option("--real-time", is_flag=True, help="Standard input cannot wait: drop samples when the buffer is full.")
@click.option("--nmea", type=_path, help="Follow: positions as NMEA 0183, into a file, or - for standard output.")
@stdin_options
def command(recording_path: Path, **options: Any) -> None:
    """Authenticate RECORDING: one verdict for each satellite and RECS.

    RECORDING is a folder with a `recording.toml`, SigMF files or ION metadata, or such a file. For each RECS: is the
    encrypted signal in E6 where E1 says it must be, and was it received before anybody could know the key? Where there
    are no observations E1 is tracked in its samples. With --follow it may still grow. `-` stands for samples of E6 or
    of both bands on standard input, which are followed.
    """
    options["follow"] = options["follow"] or recording_path == STDIN
    check_usage(recording_path, options)
    if options["follow"]:
        follow_recording(recording_path, options, _processor(options))
    else:
        _finished(recording_path, options | {"recording_path": recording_path})


def _finished(recording_path: Path, options: dict[str, Any]) -> None:
    """Authenticate a recording that is finished."""
    from contextlib import ExitStack
    from dataclasses import replace

    from vestige.cli.progress import progress
    from vestige.cli.recordings.verdicts import csv_writer, print_json, print_table
    from vestige.recording.assistance.receiver_corrections import RECEIVER_NAME, write_hardware_bias
    from vestige.recording.recording import open_recording

    recording = open_recording(recording_path, start=options["start"])
    folder = assistance_folder(recording_path, options["assistance_path"])
    check_output(options["output"], (*inputs(recording_path, options), *recording.description.files, folder))
    if options["write_bias"]:
        check_output(options["write_bias"] / RECEIVER_NAME, recording.description.files)
    processor, source, warnings = prepared(recording, options, _tracked(recording, options))
    with progress() as report, ExitStack() as stack:
        steps, bias_s = _steps(processor, replace(source, progress=report), calibrate=options["calibrate"])
        if options["write_bias"]:
            write_hardware_bias(options["write_bias"], bias_s)
        steps = (step for step in steps if _is_shown(step))
        if options["output"]:
            steps = _written(steps, stack.enter_context(csv_writer(options["output"])))
        if options["as_json"]:
            remarks = {"calibrated_on_itself": options["calibrate"], "warnings": warnings}
            print_json(steps, hardware_bias_s=bias_s, remarks=remarks)
        else:
            print_table(steps, hardware_bias_s=bias_s)


def prepared(
    recording: Recording, options: dict[str, Any], tracked: TrackedRecording | None
) -> tuple[AcasProcessor, RecordingSource, list[str]]:
    """Return the processor and the source of snapshots that the options ask for, and the warnings of the assistance.

    Parameters
    ----------
    recording
        The opened recording.
    options
        Options of `vestige process`, by the names of its parameters.
    tracked
        What tracking made of E1; None if E1 was not tracked.
    """
    from vestige.recording.assistance.folder import read_assistance
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
    for line in (*recording.notes, *found.problems, *found.missing, *found.warnings):
        echo(f"warning: {line}", err=True)
    if options["calibrate"]:
        echo(
            "warning: --calibrate takes the hardware bias from this recording itself: "
            "a delay of E6 that is common to all satellites cannot be seen",
            err=True,
        )
    processor = _processor(options, tracked)
    error_s = told_s or 0.0
    if around_s:
        error_s = label_error_s(recording, found.assistance, around_s, processor)
    source = RecordingSource(
        recording=recording,
        assistance=_with_bias(found.assistance, options["hardware_bias_m"]),
        tracked=None if tracked is None else tracked.epochs,
        time_uncertainty_s=options["time_uncertainty"],
        time_tag_error_s=error_s,
        searchable=options["level"] != "1",
        cn0_estimator=cn0_estimator(options, measured=recording.observations is None and tracked is None),
        channels=_channels(options),
    )
    if (sent := min(source.epochs(), default=None)) and (why := processor.monitoring.fix.why_no_fix(sent)):
        echo(f"warning: {options['navigation']}: {why}", err=True)
    return processor, source, list(found.warnings)


def _is_shown(step: Step) -> bool:
    """Return whether a step has verdicts of RECS, or something that changed between two of them."""
    return bool(step.block.measured.snapshots.recs.any()) or any(change.alarm for change in step.changes)


def _written(steps: Iterator[Step], write: Callable[[Step], None]) -> Iterator[Step]:
    for step in steps:
        write(step)
        yield step


def _with_bias(assistance: Assistance, bias_m: float | None) -> Assistance:
    from dataclasses import replace

    from vestige.constants import SPEED_OF_LIGHT_MPS

    return assistance if bias_m is None else replace(assistance, hardware_bias_e1_e6_s=bias_m / SPEED_OF_LIGHT_MPS)


def _tracked(recording: Recording, options: dict[str, Any]) -> TrackedRecording | None:
    """Return what tracking makes of E1, None if observations are given, or there is too little to track."""
    from vestige.cli.progress import progress
    from vestige.recording.tracked.track_recording import MIN_TRACKED_S, track_recording

    e1, wish = recording.e1, options["track"]
    if wish is False or e1 is None:
        return None
    if wish is None and (recording.observations is not None or e1.duration_s < MIN_TRACKED_S):
        return None
    with progress() as report:
        return track_recording(recording, workers=options["workers"], progress=report)


def _message(recording: Recording, tracked: TrackedRecording | None) -> Message | None:
    """Return the message that tracking decoded; None if there is none."""
    from functools import partial

    from vestige.recording.assistance.assistance_files import contents_of_pages

    if tracked is None or not tracked.pages:
        return None
    path = recording.description.path
    return path, partial(contents_of_pages, path, tracked.pages)


def _processor(options: dict[str, Any], tracked: TrackedRecording | None = None) -> AcasProcessor:
    from vestige.acas_processor.own_check import OwnCheck
    from vestige.acas_processor.position.error_budget import ErrorBudget
    from vestige.acas_processor.processor import AcasProcessor

    budget = {"uncorrected": ErrorBudget.uncorrected, "corrected": ErrorBudget.corrected}[options["budget"]]
    checks = tuple(OwnCheck.named(kind) for kind in options["checks"])
    if len({one.name for one in checks}) < len(checks):
        raise click.UsageError("--check: two checks have one name, expected one of its own for each")
    monitoring = _monitoring(options, tracked)
    try:
        return AcasProcessor(
            level=int(options["level"]),
            detector=_detector(options["detector"], options["spacing"]),
            p_fa=options["p_fa"],
            n_taps=options["taps"],
            tap_spacing_m=options["tap_spacing_m"],
            early_reach_m=options["early_reach_m"],
            budget=budget(),
            kappa=options["kappa"],
            min_pd=options["min_pd"],
            e6_over_e1_db=expected_e6_over_e1_db(options),
            monitoring=monitoring,
            cipher_mode=cipher_mode(options),
            group_delay_convention=group_delay_convention(options),
            own_checks=checks,
        )
    except ValueError as error:
        raise click.UsageError(f"--taps, --tap-spacing-m, --early-reach-m, --spacing: {error}") from error


def _detector(name: str, spacing: int) -> Detector:
    from vestige.acas_processor.detectors import DETECTORS, OwnDetector
    from vestige.own_parts import is_own, part

    return (
        OwnDetector.of(name, part(name, object), spacing=spacing) if is_own(name) else DETECTORS[name](spacing=spacing)
    )


def _monitoring(options: dict[str, Any], tracked: TrackedRecording | None) -> MonitoringSettings:
    """Return the settings of levels 2 and 3, with the orbits of a file, or those of the message."""
    from dataclasses import replace

    from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings
    from vestige.acas_processor.position.fix_measurement import FixSettings
    from vestige.acas_processor.searches.sampled_searches import E6ExhaustiveSearch
    from vestige.recording.navigation.rinex_navigation import read_rinex_navigation
    from vestige.recording.tracked.message_navigation import ephemerides_in
    from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch
    from vestige.signals.pulse import BOC11

    navigation, settings = options["navigation"], MonitoringSettings()
    ephemerides = () if tracked is None else ephemerides_in(tracked.pages)
    half = settings.power_distortion.hypotheses.half_spacing_chips
    if tracked is not None and tracked.tap_chips:  # the correlators of the loops that are nearest to the usual ones
        half = min((chips for chips in tracked.tap_chips if chips > 0), key=lambda chips: abs(chips - half))
    hypotheses = replace(settings.power_distortion.hypotheses, half_spacing_chips=half, pulse=BOC11)
    orbits = ephemerides if navigation is None else read_rinex_navigation(navigation)
    how = ExhaustiveSearch(integration_s=int(options["search_ms"]) / 1e3)
    return replace(
        settings,
        alarms_per_day=options["alarms_per_day"],
        levels=reference_levels(options),
        fix=FixSettings(ephemerides=orbits, errors=pseudorange_errors(options)),
        exhaustive_search=E6ExhaustiveSearch(how=how, around_s=options["search_window"]),
        exhaustive_period_s=options["search_every"],
        power_distortion=replace(settings.power_distortion, hypotheses=hypotheses),
        inertial=replace(settings.inertial, sigma_bias_mps2=options["acceleration_bias_mps2"]),
    )


def _channels(options: dict[str, Any]) -> OtherChannels:
    """Return what comes beside samples and assistance; of a recording that grows, it comes with each epoch."""
    from vestige.recording.observations.accelerations import read_accelerations
    from vestige.recording.recorded_block import OtherChannels

    path = options["accelerations"]
    return OtherChannels(
        second_channel=_second_channel(options),
        accelerations=None if path is None else read_accelerations(path),
    )


def _second_channel(options: dict[str, Any]) -> Assistance | None:
    """Return the OSNMA of the second channel, None without one; says what is wrong with them."""
    from vestige.errors import VestigeError
    from vestige.recording.assistance.folder import read_assistance

    folder = options["second_channel"]
    if folder is None:
        return None
    found = read_assistance(folder, public_key=options["public_key"], merkle_tree=options["merkle_tree"])
    for problem in found.problems:
        echo(f"warning: {problem}", err=True)
    if not found.assistance.keys:
        raise VestigeError(
            f"{folder}: second channel: found no validated OSNMA key, expected keys, and the public key or Merkle tree "
            "that they lead to, there or as an option"
        )
    return found.assistance


def _steps(processor: AcasProcessor, source: RecordingSource, *, calibrate: bool) -> tuple[Iterator[Step], float]:
    """Return what follows from each snapshot, as it is asked for, and the hardware bias that it is found with."""
    from dataclasses import replace

    from vestige.acas_processor.monitoring.calibration import MIN_SATELLITES, hardware_bias_correction_s
    from vestige.errors import VestigeError

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
