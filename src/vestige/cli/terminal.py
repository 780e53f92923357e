"""Print all text of vestige, so that text from files and file names cannot move the cursor or change a printed line.

Every command has the options `--quiet` and `-v`. These options change only the text on standard error: results on
standard output, files and exit status stay the same.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from enum import Enum, auto

import click

from vestige.errors import printable


class Amount(Enum):
    """Amount of text on standard error in addition to errors."""

    QUIET = auto()  # at most one line about warnings
    USUAL = auto()  # warnings, notes and progress
    DETAILED = auto()  # the usual text, and details: each file read, thresholds, the time of each stage


class _Terminal(logging.Handler):
    """Handler that prints log messages as details, and that stores the amount of text for the terminal."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self.amount, self.began_s = Amount.USUAL, 0.0
        # number of warnings that `--quiet` suppressed, and the first of these warnings
        self.n_unsaid, self.first_unsaid = 0, ""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a log message of a module of vestige."""
        detail(record.getMessage())


_terminal = _Terminal()
_log = logging.getLogger("vestige")


def echo(*lines: object, err: bool = False, nl: bool = True) -> None:
    """Print each of `lines` as a single line, and escape characters that a terminal does not show literally."""
    click.echo("\n".join(printable(str(line)) for line in lines), err=err, nl=nl)


def warn(line: object) -> None:
    """Print a warning on standard error; with `--quiet`, one line at the end replaces all warnings."""
    if is_quiet():
        _terminal.n_unsaid += 1
        _terminal.first_unsaid = _terminal.first_unsaid or str(line)
    else:
        echo(f"warning: {line}", err=True)


def note(*lines: object) -> None:
    """Print lines about the progress of the work on standard error, unless `--quiet` is given."""
    if not is_quiet():
        echo(*lines, err=True)


def detail(line: object) -> None:
    """Print a line of details with the time since the command began on standard error, if `-v` is given."""
    if is_detailed():
        echo(f"{time.monotonic() - _terminal.began_s:8.2f} s  {line}", err=True)


def is_quiet() -> bool:
    """Return whether `--quiet` is given."""
    return _terminal.amount is Amount.QUIET


def is_detailed() -> bool:
    """Return whether `-v` is given."""
    return _terminal.amount is Amount.DETAILED


@contextmanager
def usual_amount() -> Iterator[None]:
    """Set the usual amount of text before and after a command.

    The options of the command may change the amount. If `--quiet` suppressed warnings, one line about the warnings is
    printed after the command.
    """
    _choose(Amount.USUAL)
    _terminal.began_s = time.monotonic()
    try:
        yield
    finally:
        n, first = _terminal.n_unsaid, _terminal.first_unsaid
        if n:
            echo(f"warning: {first}" if n == 1 else f"{n} warnings; without --quiet they are printed", err=True)
        _choose(Amount.USUAL)


def _choose(amount: Amount) -> None:
    _terminal.amount, _terminal.n_unsaid, _terminal.first_unsaid = amount, 0, ""
    if is_detailed():
        _log.setLevel(logging.INFO)
        _log.addHandler(_terminal)
    else:
        _log.setLevel(logging.NOTSET)
        _log.removeHandler(_terminal)


def _option(amount: Amount, *names: str, help_text: str) -> click.Option:
    def choose(_context: click.Context, _parameter: click.Parameter, given: bool) -> None:
        if given and {amount, _terminal.amount} == {Amount.QUIET, Amount.DETAILED}:
            raise click.UsageError("--quiet and -v ask for less and for more text; leave one of the two out")
        if given:
            _choose(amount)

    return click.Option(names, is_flag=True, is_eager=True, expose_value=False, callback=choose, help=help_text)


_OPTIONS = (
    _option(Amount.QUIET, "--quiet", help_text="Print only results and errors, and one line in place of all warnings."),
    _option(
        Amount.DETAILED,
        "-v",
        "--verbose",
        help_text="Also print details on standard error: files read, thresholds, engines, the time of each stage.",
    ),
)


def with_common_options(command: click.Command) -> click.Command:
    """Add `--quiet` and `-v` to a command, or to each command of a group, and return `command`."""
    if isinstance(command, click.Group):
        for below in command.commands.values():
            with_common_options(below)
    elif _OPTIONS[0] not in command.params:
        command.params += _OPTIONS
    return command


def raise_last(errors: Sequence[Exception]) -> None:
    """Print all errors of `errors` except the last error, and raise the last error; without errors, do nothing."""
    for earlier in errors[:-1]:
        echo(f"vestige: {earlier}", err=True)
    if errors:
        raise errors[-1]
