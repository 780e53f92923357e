"""`vestige report`: write a self-contained page about the results of a run or of a threat table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from vestige.cli.options import PATH, parts_option
from vestige.cli.terminal import echo
from vestige.errors import InputFileError, VestigeError

if TYPE_CHECKING:
    from vestige.report import Page

RESULT = "the store of `vestige run -o`, or the folder of `vestige threats -o`"
_SUFFIXES = (".html", ".htm")


@click.command()
@click.argument("result", type=PATH)
@click.option("-o", "--output", required=True, type=PATH, help="File (.html) to write.")
@click.option(
    "--question", default="", show_default=False, metavar="TEXT", help="Question that the page answers, in your words."
)
@parts_option
def command(result: Path, output: Path, question: str) -> None:
    """Write a page about RESULT, and print the name of the file.

    RESULT is the store of `vestige run`, or the folder of `vestige threats -o`. The page needs no network, because it
    contains its figures and its script. A run that has not ended is shown up to its last stored epoch. An existing file
    is overwritten only if it is an earlier report.
    """
    if output.suffix.lower() not in _SUFFIXES:
        raise click.BadParameter(f"{output}: the suffix of a page is {' or '.join(_SUFFIXES)}", param_hint="-o")

    from vestige.report import write_page

    write_page(_page(result, question), output)
    echo(str(output))


def _page(path: Path, question: str) -> Page:
    from vestige.campaign.store.results import open_results
    from vestige.campaign.sweep.sweep import SWEEP_TABLE as SWEEP
    from vestige.report import run_page, threat_page
    from vestige.threats.table import STORE
    from vestige.threats.table import TABLE as THREATS

    name = path.resolve().name.removesuffix(".zarr")
    if not (path / "zarr.json").is_file() and not any((path / one).is_file() for one in (THREATS, SWEEP)):
        raise InputFileError(path, "result", _what(path), RESULT)
    if path.name == STORE and (path.resolve().parent / THREATS).is_file():
        raise InputFileError(path, "result", "the store of a threat table", "the folder that contains this store")
    if (path / THREATS).is_file():
        return threat_page(path / THREATS, name, question=question)
    if (path / SWEEP).is_file():
        raise InputFileError(path, "folder", "a sweep", "one of the stores in this folder")
    results = open_results(path, partial=True)
    try:
        return run_page(results.dataset.load(), name, question=question)
    except InputFileError:
        raise
    except VestigeError as error:
        raise VestigeError(f"{path}: {error}") from error


def _what(path: Path) -> str:
    """Return words that say what was found at a path without results, for an error message."""
    return "a folder without results" if path.is_dir() else "another file" if path.exists() else "nothing"
