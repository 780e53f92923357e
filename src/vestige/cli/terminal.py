"""The one way to the terminal: what files and their names hold cannot move its cursor, nor change what a line says."""

from __future__ import annotations

import click

from vestige.errors import printable


def echo(*lines: object, err: bool = False, nl: bool = True) -> None:
    """Print each of `lines` as one line; characters that a terminal does not show as themselves are escaped."""
    click.echo("\n".join(printable(str(line)) for line in lines), err=err, nl=nl)
