"""`vestige simulate`: write the recording of a scenario, and all other files that a receiver needs."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.options import PATH, number_option, parts_option, set_option, threads_option
from vestige.cli.terminal import echo, note, warn
from vestige.errors import InputFileError, VestigeError
from vestige.output import check_new_folder

if TYPE_CHECKING:
    from vestige.scenario.campaign import CampaignScenario
    from vestige.simulated.simulated_recording import SimulatedRecording


@click.command()
@click.argument("scenario", type=PATH)
@click.option(
    "-o", "--output", required=True, type=PATH, help="Folder to write; must not exist. With -, samples go to a pipe."
)
@click.option(
    "--band",
    type=click.Choice(["e1", "e6", "both"]),
    help="Band whose samples go to the pipe, with -o -. With both, samples of E1 and E6 alternate.",
)
@click.option("--epochs", metavar="A:B", help="Epochs A to B - 1 of a campaign. [default: all]")
@set_option
@click.option(
    "--format",
    "component",
    type=click.Choice(["int8", "int16", "float32"]),
    default="int8",
    help="Type of the numbers of a sample.",
)
@click.option(
    "--export",
    "exports",
    multiple=True,
    type=click.Choice(["gnss-sdr", "pocketsdr", "saslib"]),
    help="Also write the files that this receiver reads. May be given several times.",
)
@threads_option("Number of threads that make samples.")
@number_option("--max-gb", (0, 1e6), default=10.0, help="Largest size of the recording in GB.")
@parts_option
def command(scenario: Path, **options: Any) -> None:
    """Write E1 and E6 samples of SCENARIO as a SigMF collection, with all files that belong to the samples.

    If SCENARIO is a campaign, the command writes a test case: encrypted E6-C, E1 observations, RECS, group delays,
    OSNMA keys and truth. `vestige process` authenticates this test case. If SCENARIO is a recording, the command
    writes samples with open E6-C and an OSNMA key chain. `vestige recs make` makes RECS for samples with open E6-C.

    With `-o -` the I/Q samples go to standard output, and no file is written. With `--band both`, samples of E1 and E6
    alternate.
    """
    from vestige.cli.progress import progress
    from vestige.scenario.load import load_scenario
    from vestige.scenario.recording import RecordingScenario
    from vestige.scenario.toml.toml_file import overridden, read_toml
    from vestige.scenario.toml.toml_text import toml_text
    from vestige.scenario.warnings import left_out
    from vestige.simulated.exported_case import AcasTestCase, with_default_range
    from vestige.simulated.exported_case_folder import simulated
    from vestige.simulated.open_code_recording import open_code_recording

    to_pipe = options["output"] == Path("-")
    _check_pipe(to_pipe, options)
    raw = overridden(read_toml(scenario), options["settings"])
    loaded = load_scenario(scenario, options["settings"])
    if isinstance(loaded, RecordingScenario):
        if options["epochs"]:
            raise click.UsageError(
                "--epochs chooses epochs of a campaign; this scenario is a recording, which is written whole"
            )
        source = open_code_recording(loaded)
    else:
        loaded = with_default_range(loaded)
        raw.setdefault("line_of_sight", {})["s0_m"] = loaded.line_of_sight.s0_m
        _check_band(scenario, loaded)
        first, end = _chosen(options["epochs"], loaded)
        if not to_pipe:
            _check_recs(scenario, loaded, first, end)
        for line in left_out(loaded):
            warn(line)
        source = simulated(AcasTestCase(scenario=loaded, first=first, end=end))
    if to_pipe:
        _to_pipe(source, options)
        return
    check_new_folder(options["output"])
    source.check_exports(options["component"], options["exports"])
    gigabytes = source.n_bytes(options["component"], options["exports"]) / 1e9
    size = f"{source.duration_s:g} s of E1 and E6: {gigabytes:.3g} GB"
    if gigabytes > options["max_gb"]:
        raise VestigeError(f"{size}, which is more than --max-gb {options['max_gb']:g}")
    note(f"{size}, about {max(source.seconds_to_write(), 1.0):.0f} s of computing on this machine")
    with progress() as report:
        files = source.write(
            options["output"],
            scenario_text=toml_text(raw),
            component=options["component"],
            exports=options["exports"],
            workers=options["workers"],
            progress=report,
            say=note,
            warn=warn,
        )
    for path in files:
        echo(str(path))


def _check_band(path: Path, scenario: CampaignScenario) -> None:
    """Raise `InputFileError` if the sampling rate is too low, or the filter too narrow, for a constellation."""
    from vestige.scenario.limits import check_recorded_band
    from vestige.scenario.toml.toml_file import InconsistentSettingsError

    if scenario.constellation is None:
        return
    try:
        check_recorded_band(scenario.receiver.front_end.front_end(scenario.receiver.sample_rate_hz))
    except InconsistentSettingsError as error:
        raise InputFileError(path, error.place, error.found, error.expected) from error


def _check_pipe(to_pipe: bool, options: dict[str, Any]) -> None:
    """Raise a usage error if the options do not fit the kind of output, a folder of files or a pipe."""
    if to_pipe and options["band"] is None:
        raise click.UsageError("-o - writes samples to a pipe; say of which band: --band e1, --band e6 or --band both")
    if to_pipe and options["exports"]:
        raise click.UsageError("--export writes files, but -o - writes only samples; give a folder")
    if not to_pipe and options["band"] is not None:
        raise click.UsageError("--band is for -o -; a folder gets both bands")
    if to_pipe and sys.stdout.isatty():
        raise click.UsageError("-o - writes binary samples; send them to a program or a file, not to the terminal")


def _to_pipe(source: SimulatedRecording, options: dict[str, Any]) -> None:
    """Write samples to standard output; the command ends without a message when the reader closes the pipe."""
    from vestige.cli.progress import progress
    from vestige.records import Band

    bands = (Band.E1, Band.E6) if options["band"] == "both" else (Band[options["band"].upper()],)
    component, output, rate_hz = options["component"], sys.stdout.buffer, source.sample_rate_hz
    begin = [source.begin(band) for band in bands]
    names = " and ".join(band.value for band in bands) + (", sample by sample in turn" if len(bands) > 1 else "")
    around = " and ".join(f"{center_hz:.10g} Hz" for _, center_hz in begin)
    what = f"{source.duration_s:g} s of {names}: {component} I,Q at {rate_hz:.10g} Hz around {around}"
    note(f"{what}, from {begin[0][0]}")
    try:
        with progress() as report:
            source.send(
                bands,
                output.write,
                component=component,
                workers=options["workers"],
                progress=report,
                warn=warn,
            )
        output.flush()
    except BrokenPipeError:
        # the next line discards the buffered bytes; otherwise Python would try to write these bytes at its exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), output.fileno())


def _chosen(epochs: str | None, scenario: CampaignScenario) -> tuple[int, int]:
    """Return the first epoch of `A:B`, and the epoch after the last epoch; without `A:B`, all epochs are chosen."""
    match = re.fullmatch(r"(\d{1,9}):(\d{1,9})", epochs or f"0:{scenario.epochs}", re.ASCII)
    if match is None:
        raise click.UsageError(f"--epochs: found {epochs}, expected A:B within 0:{scenario.epochs}")
    return int(match[1]), int(match[2])


def _check_recs(path: Path, scenario: CampaignScenario, first: int, end: int) -> None:
    """Raise `VestigeError` if no RECS is sent in the epochs of a test case."""
    every = scenario.recs.every
    following = -(-first // every) * every
    if not first < end <= min(scenario.epochs, following):
        return  # the epochs have a RECS, or are not epochs of the scenario
    if following < scenario.epochs:
        which, advice = f"the next one is at epoch {following}", f"{first}:{following + 1}"
    else:
        which, advice = f"the last one is at epoch {following - every}", f"{following - every}:{end}"
    raise VestigeError(
        f"{path}: --epochs {first}:{end}: found no RECS, expected at least one; RECS come every "
        f"{every * scenario.interval_s:g} s, and {which}; take --epochs {advice}"
    )
