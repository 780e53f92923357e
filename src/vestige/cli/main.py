"""Run a command of vestige, and turn errors into exit codes.

No large module is imported before the command runs. The help of `vestige` lists the exit statuses.
"""

from __future__ import annotations

import importlib
import logging
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO

import click

from vestige.cli.terminal import echo, usual_amount, warn, with_common_options
from vestige.errors import VestigeError, VestigeWarning
from vestige.own_parts import blamed_on_own_parts

# Name of each command, with the module of this package that has the function `command`, and with a line of help
VERBS = {
    "demo": ("start.demo", "Show in a minute what vestige does, with every command as you would type it."),
    "init": ("start.init", "Write the scenario files that come with vestige into a folder."),
    "process": ("recordings.process", "Authenticate a recording: one verdict for each satellite and RECS."),
    "live": ("live.live", "Authenticate a recording while it is being written, or samples from a pipe."),
    "track": ("recordings.track", "Track E1 of a recording: RINEX, navigation pages, correlators."),
    "inspect": (
        "recordings.inspect",
        "Say what a recording or folder holds, and what is missing for ACAS.",
    ),
    "osnma": ("services.osnma", "Verify OSNMA messages and extract validated keys."),
    "recs": ("services.recs", "Show, decrypt or make RECS files."),
    "run": ("campaigns.run", "Run a campaign of many epochs and keep the results."),
    "threats": ("campaigns.threats", "Measure the outcome of each attack of the threat table."),
    "plot": ("campaigns.plot", "Draw the figures of a campaign's results."),
    "report": ("campaigns.report", "Write one page about the results of a run or a threat table."),
    "rinex": ("services.rinex", "Write the E1 observations of a campaign with [constellation] as RINEX."),
    "search": ("recordings.searches.search", "Search for every signal on E1 and for the encrypted signal in E6."),
    "theory": ("services.theory", "Compute thresholds, probabilities of detection and required C/N0."),
    "simulate": (
        "recordings.simulate",
        "Write the E1 and E6 recording of a scenario: a test case for any receiver.",
    ),
    "check": ("campaigns.check", "Parse scenario files and print what they describe."),
}


class _LazyVerbs(click.Group):
    """Group of commands that imports the module of a command only when the command is used.

    The lines of help come from `VERBS`.
    """

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in VERBS:
            return None
        return with_common_options(importlib.import_module(f"vestige.cli.{VERBS[cmd_name][0]}").command)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Verbs"):
            formatter.write_dl([(verb, line) for verb, (_, line) in VERBS.items()])


def _version(ctx: click.Context, _parameter: click.Parameter, value: bool) -> None:
    if value and not ctx.resilient_parsing:
        from vestige import __version__

        echo(f"vestige {__version__}")
        ctx.exit()


@click.command(cls=_LazyVerbs, context_settings={"help_option_names": ["-h", "--help"], "show_default": True})
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_version, help="Print the version."
)
def vestige() -> None:
    """Simulate, attack and process signals of the Galileo authentication service ACAS (SAS).

    Every command has the options --quiet and -v. --quiet prints only results and errors,
    and one line in place of all warnings. -v also prints details that help to find the
    cause of a problem. Neither option changes results or exit status.

    \b
    Exit status:
      0    The command has finished. Without --fail-on, verdicts do not
           change this status.
      1    Bad input, a failed verification or lost samples. One line on
           standard error says what was expected, and where.
      2    Options that do not exist, exclude each other or are missing.
           The command gives no results.
      3    process and live: the verdicts match the value of --fail-on.
      130  Ctrl-C or SIGTERM. A line says which results are kept, if any.

    If several statuses apply, status 130 has priority over 1, and status 1 over 3.

    """  # noqa: D301 - click needs this character


def main(arguments: list[str] | None = None) -> None:
    """Run the command that the arguments name, and end the program with the exit status of the command."""
    warnings.showwarning = _one_line
    try:
        with _terminable(), blamed_on_own_parts(), usual_amount():
            status = vestige.main(args=arguments, prog_name="vestige", standalone_mode=False)
    except click.ClickException as error:
        text = StringIO()
        error.show(text)
        echo(*text.getvalue().rstrip("\n").split("\n"), err=True)
        sys.exit(error.exit_code)
    except click.Abort as abort:
        # The notes of the exception report an interrupted write, so asyncio need not log the interruption.
        logging.getLogger("asyncio").setLevel(logging.CRITICAL)
        echo(f"interrupted{_notes(abort.__cause__)}", err=True)
        sys.exit(130)
    except VestigeError as error:
        echo(f"vestige: {error}{_notes(error)}", err=True)
        sys.exit(1)
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        echo(f"vestige: {place}{error.strerror or error}{_notes(error)}", err=True)
        sys.exit(1)
    sys.exit(status or 0)  # the status is None if the command set no status, for example without `--fail-on`


@contextmanager
def _terminable() -> Iterator[None]:
    """Treat SIGTERM like Ctrl-C. Services and batch systems stop a program with SIGTERM."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(_number: int, _frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _one_line(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    """Print a warning of vestige as a line on stderr.

    Warnings of libraries are not printed, because a user cannot act on them.
    """
    if category is VestigeWarning:
        warn(message)


def _notes(error: BaseException | None) -> str:
    """Return the notes of an error as text; the notes say which work of an interrupted or failed run is kept."""
    return "".join(f"; {note}" for note in getattr(error, "__notes__", ()))


if __name__ == "__main__":
    main()
