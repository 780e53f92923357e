"""`vestige init`: copy the scenario files that come with vestige into a folder, for the user to run and to change."""

from __future__ import annotations

from pathlib import Path

import click

from vestige.cli.options import PATH
from vestige.cli.terminal import echo
from vestige.errors import InputFileError


@click.command()
@click.argument("folder", default=".", type=PATH)
def command(folder: Path) -> None:
    """Write FOLDER/scenarios with the scenario files that come with vestige, for you to run and to change.

    FOLDER is the current folder by default, and is created if it does not exist.
    """
    written = write_scenarios(folder)
    echo(f"wrote {written[0].parent}:")
    for path in written:
        echo(f"  {path.name:<22}{path.read_text(encoding='utf-8').splitlines()[0].removeprefix('# ')}")
    scenarios = written[0].parent
    echo("", "Next:")
    commands = (
        (f"vestige run {scenarios / 'quick.toml'} -o quick.zarr", "statistics of the paper's harsh conditions"),
        (f"vestige simulate {scenarios / 'first_light.toml'} -o first_light", "a recording of both bands"),
        ("vestige demo", "both, with an attack and the verdicts"),
    )
    width = max(len(line) for line, _ in commands)
    for line, what in commands:
        echo(f"  {line:<{width}}  # {what}")


def write_scenarios(folder: Path) -> list[Path]:
    """Write a new folder `scenarios` into `folder`, and return the files in the new folder.

    The function raises `InputFileError` if `folder` already contains a file or folder `scenarios`.
    """
    from vestige.scenario.shipped import shipped_scenarios

    target = folder / "scenarios"
    if target.exists():
        expected = "a new name; give another folder: vestige init FOLDER"
        raise InputFileError(target, "folder", "an existing file or folder", expected)
    target.mkdir(parents=True)
    written = []
    for path in shipped_scenarios():
        written.append(target / path.name)
        written[-1].write_bytes(path.read_bytes())
    return written
