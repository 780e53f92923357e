"""Define the options `--positions` and `--mavlink` of `vestige process` and `vestige live`, and write their outputs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.options import PATH, options_together
from vestige.output import check_output, replacement

if TYPE_CHECKING:
    from vestige.acas_processor.position.authentic_position import AuthenticPosition
    from vestige.acas_processor.processor import Step
    from vestige.time import GalileoTime

STDOUT = Path("-")
ENDINGS = (".nmea", ".csv", ".geojson", ".kml")
_LOG = ".tlog"


def _with_an_ending(_context: click.Context, _parameter: click.Parameter, paths: tuple[Path, ...]) -> tuple[Path, ...]:
    for path in paths:
        if path != STDOUT and path.suffix not in ENDINGS:
            raise click.BadParameter(f"found {path}, expected a name that ends in {', '.join(ENDINGS)}, or -")
    return paths


output_options = options_together(
    click.option(
        "--positions",
        multiple=True,
        type=PATH,
        callback=_with_an_ending,
        metavar="FILE",
        help="Write authentic positions into this file. The ending of the file name is the format: .nmea, .csv, "
        ".geojson or .kml. - writes NMEA 0183 to standard output. May be given several times.",
    ),
    click.option(
        "--mavlink",
        metavar="TARGET",
        help="Send the MAVLink message GNSS_INTEGRITY to an address of pymavlink, such as udpout:127.0.0.1:14550, or "
        "write it into a file that ends in .tlog.",
    ),
)
OUTPUT_NAMES = ("positions", "mavlink")


def check_outputs(options: dict[str, Any], inputs: Iterable[Path | None]) -> None:
    """Refuse files of `--positions` and `--mavlink` that would destroy an input; see `check_output`.

    The function raises `click.UsageError` if positions and JSON are both to be written to standard output.
    """
    positions, target = options["positions"], options["mavlink"]
    read = tuple(inputs)
    if STDOUT in positions and options["as_json"]:
        raise click.UsageError("--positions -: standard output is for --json; name a file for the positions")
    files = [path for path in positions if path != STDOUT]
    if target is not None and target.endswith(_LOG):
        files.append(Path(target))
    for path in files:
        check_output(path, read)


@contextmanager
def outputs_for_others(options: dict[str, Any], *, replace: bool) -> Iterator[Callable[[Step], None]]:
    """Yield a function that writes the result of a snapshot to the outputs of `--positions` and `--mavlink`.

    The function gets a step of the processor with times on the clock of the signal, and writes these times.

    Parameters
    ----------
    options
        Values of the options of the command, by parameter name.
    replace
        Whether the new files replace older files at the end. If false, older files are continued.

    Raises
    ------
    InputFileError
        If an existing file cannot be continued.
    VestigeError
        If pymavlink is needed, and is missing or too old, or if the address of `--mavlink` cannot be used.
    """
    writers: list[Callable[[Step, GalileoTime], None]] = []
    with ExitStack() as stack:
        if options["mavlink"] is not None:
            from vestige.recording.outputs.gnss_integrity import MavlinkOutput, gnss_integrity

            target = options["mavlink"]
            if replace and target.endswith(_LOG):
                target = str(stack.enter_context(replacement(Path(target))))
            mavlink = stack.enter_context(MavlinkOutput(target))
            writers.append(lambda step, time: mavlink.write(time, gnss_integrity(step.block, _position(step))))
        for path in options["positions"]:
            put = _nmea_on_stdout(stack) if path == STDOUT else _file(path, stack, replace=replace)
            writers.append(lambda step, time, put=put: put(time, _position(step)))  # type: ignore[misc]

        def write(step: Step) -> None:
            time = step.block.measured.snapshots.time.at(-1)
            for one in writers:
                one(step, time)

        yield write


def _position(step: Step) -> AuthenticPosition | None:
    return next(iter(step.positions), None)


def _file(path: Path, stack: ExitStack, *, replace: bool) -> Callable[[GalileoTime, AuthenticPosition | None], None]:
    from vestige.recording.outputs.position_file import PositionFile

    place = stack.enter_context(replacement(path)) if replace else path
    return stack.enter_context(PositionFile(place)).write


def _nmea_on_stdout(stack: ExitStack) -> Callable[[GalileoTime, AuthenticPosition | None], None]:
    """Return a function that writes NMEA to standard output, and send all other output to standard error."""
    from vestige.recording.outputs.position_file import POSITION_FORMATS

    stream = sys.stdout
    stack.enter_context(redirect_stdout(sys.stderr))

    def put(time: GalileoTime, position: AuthenticPosition | None) -> None:
        stream.write(POSITION_FORMATS[".nmea"].text(time, position))
        stream.flush()

    return put
