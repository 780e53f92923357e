"""Define options that several commands share, and the types of the options' values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.own_parts import is_own, own_parts_from

if TYPE_CHECKING:
    from vestige.crypto.recs.group_delay import GroupDelayConvention
    from vestige.crypto.recs.recs_segment import CipherMode
    from vestige.time import GalileoTime


def options_together(*options: Callable[..., Any]) -> Callable[..., Any]:
    """Return a decorator that adds several options to a command, in the given order."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


class FiniteNumber(click.types.FloatParamType):
    """Type of an option whose value is a number that is neither infinite nor NaN."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return a value of the command line as a number; raise a usage error if the number is infinite or NaN."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number", param, ctx)
        return number


class FiniteRange(FiniteNumber, click.FloatRange):
    """Type of an option whose value is a finite number within limits."""

    name = "number"


PATH = click.Path(path_type=Path)


def number_option(name: str, limits: tuple[float, float | None], **attributes: Any) -> Callable[..., Any]:
    """Return an option whose value is a number within `limits`; an upper limit of None means no upper limit."""
    return click.option(name, type=FiniteRange(*limits), **attributes)


def choice_option(name: str, choices: Sequence[str], **attributes: Any) -> Callable[..., Any]:
    """Return an option with a fixed list of values; the first value is the default unless `default` is given."""
    return click.option(name, type=click.Choice(choices), **{"default": choices[0], **attributes})


class WidthType(click.ParamType[tuple[float, bool]]):
    """Type of an option whose value is the width of an interval: a number such as `0.01` or a percentage such as `20%`.

    The option has two values: the width, and whether the width is relative (`Width.relative` in `sweep.py`).
    """

    name = "width"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, bool]:
        """Return the width, and whether the width is relative (`Width.relative` in `sweep.py`)."""
        if isinstance(value, tuple):
            return value
        text = str(value).strip()
        try:
            number = float(text.removesuffix("%"))
        except ValueError:
            number = math.nan
        if not 0 < number < math.inf:
            self.fail(f"{value!r} is neither a width such as 0.01 nor a percentage such as 20%", param, ctx)
        return (number / 100, True) if text.endswith("%") else (number, False)


def _name_folders(_context: click.Context, _parameter: click.Parameter, folders: tuple[Path, ...]) -> None:
    for folder in folders:
        own_parts_from(folder)


# With this option, scenarios may name classes that the user wrote; see `own_parts`
parts_option = click.option(
    "--parts",
    multiple=True,
    type=PATH,
    metavar="FOLDER",
    expose_value=False,
    is_eager=True,
    callback=_name_folders,
    help="Folder of your own detectors, attacks, error models and checks, which are named `module:Name`.",
)
DETECTOR_NAMES = ("early", "maximum")


def detector_name(_context: click.Context, _parameter: click.Parameter, name: str) -> str:
    """Return `name` if it is a detector of vestige or has the form `module:Name`; otherwise raise a usage error."""
    if name not in DETECTOR_NAMES and not is_own(name):
        raise click.BadParameter(f"found {name!r}, expected {', '.join(DETECTOR_NAMES)} or module:Name")
    return name


def _begun_detectors(_context: click.Context, _parameter: click.Parameter, begun: str) -> list[str]:
    """Return vestige's detectors that begin with the typed text, for completion with Tab."""
    return [name for name in DETECTOR_NAMES if name.startswith(begun)]


detector_option = click.option(
    "--detector",
    default="early",
    metavar="NAME",
    shell_complete=_begun_detectors,
    callback=detector_name,
    help="Detector on E6: early, maximum, or `module:Name` of your own.",
)
set_option = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Replace a value of the scenario, as in `receiver.cn0_dbhz=37`; `none` removes the value.",
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
recording_argument = click.argument("recording_path", metavar="RECORDING", type=PATH)
assistance_option = click.option(
    "--assistance",
    "assistance_path",
    type=PATH,
    help="Folder with RECS, group delays and OSNMA keys. [default: RECORDING/assistance]",
)
workers_option = click.option(
    "-j", "--workers", type=click.IntRange(1, 1024), help="Number of workers on this machine. [default: 1]"
)
scheduler_option = click.option(
    "--scheduler", metavar="tcp://…", help="Run on the dask.distributed cluster with this scheduler."
)


# Options of commands that read an assistance folder. The folder may contain the public key and the Merkle tree.
trust_options = options_together(
    *(
        click.option(
            f"--{name.lower().replace(' ', '-')}",
            type=PATH,
            help=f"File of the OSNMA {name}. Without this option, a {name} in the assistance folder is used.",
        )
        for name in ("public key", "Merkle tree")
    )
)


def check_trust(public_key: Path | None, merkle_tree: Path | None) -> None:
    """Raise a usage error unless a public key or a Merkle tree is given, because OSNMA keys need a trust anchor."""
    if public_key is None and merkle_tree is None:
        raise click.UsageError(
            "a key proves nothing without the public key of the operator: give --public-key, --merkle-tree or both"
        )


def time_option(_context: click.Context, _parameter: click.Parameter, text: str | None) -> GalileoTime | None:
    """Return the time that the text of an option states; None without the option.

    The function raises a usage error if the text is no time.
    """
    from vestige.time import GalileoTime

    try:
        return None if text is None else GalileoTime.parse(text)
    except (ValueError, OverflowError) as error:
        raise click.BadParameter(str(error)) from error


start_option = click.option(
    "--start", callback=time_option, help="Time of the first sample, used in place of the recording's own time tag."
)


def assistance_folder(recording: Path, given: Path | None) -> Path:
    """Return the assistance folder `given`, or the default assistance folder of a recording."""
    return given or (recording if recording.is_dir() else recording.parent) / "assistance"


def cipher_mode(options: Mapping[str, Any]) -> CipherMode:
    """Return the AES mode of RECS that the option `--cipher-mode` states."""
    from vestige.crypto.recs.recs_segment import CipherMode

    return CipherMode(options["cipher_mode"])


def group_delay_convention(options: Mapping[str, Any]) -> GroupDelayConvention:
    """Return the meaning of a BGD value that the option `--bgd` states."""
    from vestige.crypto.recs.group_delay import GroupDelayConvention, GroupDelayScale

    text = options["bgd"]
    scale = GroupDelayScale(text.removeprefix("minus-"))
    return GroupDelayConvention(scale=scale, sign=-1 if text.startswith("minus-") else 1)


def threads_option(what: str) -> Callable[..., Any]:
    """Return the option `-j` of a command that works on the samples of a recording; `what` is the help text."""
    return click.option("-j", "--workers", type=click.IntRange(1, 1024), default=2, help=what)


# The service has not published the AES mode and the meaning of a BGD value, so two options choose mode and meaning.
cipher_mode_option = click.option(
    "--cipher-mode",
    type=click.Choice(["cbc", "ctr"]),
    default="cbc",
    help="AES mode with which the RECS are encrypted.",
)
group_delay_option = click.option(
    "--bgd",
    type=click.Choice(["os-icd", "file-value", "minus-os-icd", "minus-file-value"]),
    default="os-icd",
    help="Meaning of a BGD value: E6 is later than E1 by (γ − 1)·BGD (os-icd) or by BGD (file-value). With minus-, "
    "E6 is earlier by the same delay.",
)


def parse_svids(text: str) -> tuple[int, ...]:
    """Return the numbers of the satellites that a text such as `2,3,7-9` lists; () for an empty text.

    The function raises `click.BadParameter` if the text is not a list such as `2,3,7-9`, if a satellite is not one of 1
    to 36, or if a range is reversed, such as `9-7`.
    """
    from vestige.constants import MAX_SVID

    svids: list[int] = []
    for part in filter(None, (piece.strip() for piece in text.split(","))):
        ends = part.split("-")
        if len(ends) > 2 or not all(end.isdecimal() for end in ends):
            raise click.BadParameter(f"not a satellite or a range of them: {part!r}")
        first, last = int(ends[0]), int(ends[-1])
        if not 1 <= first <= last <= MAX_SVID:
            raise click.BadParameter(f"satellites are numbered 1 to {MAX_SVID}, found {part!r}")
        svids.extend(range(first, last + 1))
    return tuple(dict.fromkeys(svids))
