"""Define the options that `vestige process` and `vestige live` share: inputs and settings of the processor."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from vestige.cli.loop_options import LOOP_NAMES, loop_options
from vestige.cli.options import (
    PATH,
    assistance_option,
    choice_option,
    cipher_mode_option,
    detector_option,
    group_delay_option,
    number_option,
    options_together,
    parts_option,
    recording_argument,
    start_option,
    threads_option,
    trust_options,
)
from vestige.cli.usual_levels import approximate_position, pseudorange_errors, usual_level_options

CN0_ESTIMATOR_NAMES = (
    "noise-floor",
    "narrow-to-wide",
    "moments",
    "signal-to-noise-variance",
    "beaulieu",
    "real-signal-complex-noise",
)
PROCESSOR_GROUPS = {
    "Assistance and trust": (
        "assistance_path",
        "public_key",
        "merkle_tree",
        "certificates",
        "cipher_mode",
        "bgd",
    ),
    "E1, time and position": (
        "track",
        "workers",
        "navigation",
        "near",
        "start",
        "time_uncertainty",
        "cn0_estimator",
    ),
    "Tracking loops": LOOP_NAMES,
    "Mitigation level": (
        "level",
        "alarms_per_day",
        "checks",
        "parts",
        "second_channel",
        "accelerations",
        "acceleration_bias_mps2",
        "search_ms",
        "search_window",
        "search_every",
    ),
    "Detection on E6": (
        "detector",
        "p_fa",
        "taps",
        "tap_spacing_m",
        "early_reach_m",
        "spacing",
        "min_pd",
    ),
    "Range check": (
        "kappa",
        "budget",
        "hardware_bias_m",
        "calibrate",
        "write_bias",
    ),
    "Usual levels and errors": (
        "usual_e1_power_db",
        "usual_e6_power_db",
        "usual_e1_cn0_dbhz",
        "usual_e6_cn0_dbhz",
        "e6_over_e1_db",
        "cn0_fall_db",
        "floor_sigma_m",
        "ionosphere_sigma_m",
        "multipath_sigma_m",
    ),
}
_READ = ("public_key", "merkle_tree", "second_channel", "navigation", "accelerations")


_level_options = options_together(
    choice_option("--level", ["1", "2", "3"], help="Mitigation level: decides which checks run."),
    click.option(
        "--check",
        "checks",
        multiple=True,
        metavar="module:Name",
        help="Run this check of your own as well. May be given several times.",
    ),
    parts_option,
    click.option(
        "--second-channel",
        type=PATH,
        help="Level 3: folder with OSNMA keys or pages from a second channel.",
    ),
    click.option("--accelerations", type=PATH, help="Level 3: CSV file of the accelerometer."),
    number_option(
        "--acceleration-bias-mps2",
        (0, 10),
        default=0.01,
        help="Level 3: standard deviation of the accelerometer's bias in m/s².",
    ),
    choice_option(
        "--search-ms",
        ["1", "2", "4", "8", "16"],
        default="4",
        help="Level 3: coherent integration time of the exhaustive search in ms.",
    ),
    number_option(
        "--search-window",
        (1e-6, 1e5),
        metavar="SECONDS",
        help="Level 3: search E6 within ± SECONDS of the expected arrival. [default: the clock's possible error]",
    ),
    number_option(
        "--search-every",
        (0, 1e9),
        default=3600.0,
        metavar="SECONDS",
        help="Level 3: time between two exhaustive searches while nothing is suspicious.",
    ),
)
_e6_options = options_together(
    detector_option,
    number_option("--p-fa", (1e-15, 0.1), default=1e-7, help="False-alarm probability of one E6 correlator."),
    click.option(
        "--taps",
        type=click.IntRange(3, 63),
        default=11,
        help="Number of E6 correlators around the prediction.",
    ),
    number_option("--tap-spacing-m", (0.1, 100), default=15.0, help="Distance between two E6 correlators in m."),
    number_option(
        "--early-reach-m",
        (0, 900),
        default=600.0,
        help="Extend the bank of E6 correlators by this distance in m to the early side. If E1 tracks a repeater, "
        "the true signal is there. The bank is not extended beyond a length of 820 m.",
    ),
    click.option(
        "--spacing",
        type=click.IntRange(1),
        default=1,
        help="Early-to-late spacing of the range estimate, in correlators.",
    ),
    number_option(
        "--min-pd",
        (0, 1),
        default=0.9,
        help="A missed E6 signal counts only if it would have been detected with at least this probability.",
    ),
    number_option(
        "--kappa", (0.1, 10), default=3.0, help="Limit of the range check, in standard deviations of the error budget."
    ),
    choice_option(
        "--budget",
        ["uncorrected", "corrected"],
        help="Error budget of the range check: without or with corrections of the ionosphere.",
    ),
    number_option(
        "--hardware-bias-m",
        (-1e7, 1e7),
        help="Hardware bias: delay of the E6 front end minus delay of the E1 front end, in m. "
        "[default: value of the assistance folder, or 0]",
    ),
)
# the argument RECORDING, and the options of the processor
processor_options = options_together(
    recording_argument,
    assistance_option,
    trust_options,
    click.option(
        "--certificate",
        "certificates",
        multiple=True,
        type=PATH,
        help="Public key of the assistance server. Files that the server did not sign are then refused.",
    ),
    cipher_mode_option,
    group_delay_option,
    click.option(
        "--track/--no-track",
        default=None,
        help="Track E1 through the whole recording, or measure it in 100 ms around each RECS only. "
        "[default: track if there are no observations]",
    ),
    threads_option("Number of threads that track E1."),
    loop_options,
    click.option(
        "--navigation",
        type=PATH,
        help="RINEX navigation file with the orbits for positions, used in place of the orbits in the tracked message.",
    ),
    start_option,
    number_option(
        "--time-uncertainty",
        (0, 1e6),
        metavar="SECONDS",
        help="Upper limit of the receiver clock's error. [default: the limit that the recording states]",
    ),
    click.option(
        "--cn0-estimator",
        type=click.Choice(CN0_ESTIMATOR_NAMES),
        help="Estimator of the C/N0 of E1 if E1 is measured in the samples around each RECS. [default: noise-floor]",
    ),
    click.option(
        "--fail-on",
        type=click.Choice(["spoofed", "alarm", "unauthenticated"]),
        help="Condition for exit status 3. spoofed: a verdict is SPOOFED. alarm: a verdict or a state was an alarm "
        "(SPOOFED, SUSPECT or NOT_DETECTED). unauthenticated: not every verdict is AUTHENTIC. A script "
        "that needs proof of the signals uses unauthenticated; a script that reacts to attacks uses alarm.",
    ),
    _level_options,
    _e6_options,
    usual_level_options,
)


def check_processor_usage(options: dict[str, Any]) -> None:
    """Raise a usage error for options of the processor that exclude each other or have invalid values."""
    if options["accelerations"] and options["level"] != "3":
        raise click.UsageError("--accelerations: only at --level 3")
    stated = click.get_current_context().get_parameter_source("kappa") is ParameterSource.COMMANDLINE
    if options["alarms_per_day"] is not None and stated:
        raise click.UsageError("--kappa: follows from --alarms-per-day; leave one of the two out")
    approximate_position(options)  # errors must be found before E1 is tracked, because tracking takes long
    pseudorange_errors(options)


def inputs(recording: Path, options: dict[str, Any]) -> tuple[Path | None, ...]:
    """Return the recording and the inputs that the options name, except the assistance folder; None without a name."""
    return (recording, *(options[name] for name in _READ), *options["certificates"])


def check_named_inputs(options: dict[str, Any], *folders: Path | None) -> None:
    """Read the named keys, tree and certificates, and list the folders, to find errors before E1 is tracked.

    The function raises `InputFileError`, `AuthenticationError` or `UnsupportedError` if a file cannot be used.
    """
    from vestige.crypto.file_bytes import list_folder
    from vestige.crypto.recs.file_signature import load_public_key
    from vestige.recording.assistance.assistance_files import FileTrust

    for folder in folders:
        if folder is not None:
            list_folder(folder)
    public_key, tree = options["public_key"], options["merkle_tree"]
    if public_key is not None or tree is not None:
        FileTrust.load([public_key] if public_key else [], tree)
    for path in options["certificates"]:
        load_public_key(path)


def cn0_estimator(options: dict[str, Any], *, measured: bool) -> str:
    """Return the name of the C/N0 estimator for E1.

    `measured` says whether E1 is measured in the samples around each RECS. The function raises a usage error if
    `--cn0-estimator` is given, but `measured` is false.
    """
    if options["cn0_estimator"] is not None and not measured:
        raise click.UsageError("--cn0-estimator is for E1 measured in samples; here observations give the C/N0")
    return options["cn0_estimator"] or "noise-floor"
