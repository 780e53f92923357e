"""The one way to the terminal: what files and their names hold cannot move its cursor, nor change what a line says."""

from __future__ import annotations

from collections.abc import Sequence

import click

from vestige.errors import printable


def echo(*lines: object, err: bool = False, nl: bool = True) -> None:
    """Print each of `lines` as one line; characters that a terminal does not show as themselves are escaped."""
    click.echo("\n".join(printable(str(line)) for line in lines), err=err, nl=nl)


def raise_last(errors: Sequence[Exception]) -> None:
    """Raise the last of some errors, and print those before it; nothing happens without any."""
    for earlier in errors[:-1]:
        echo(f"vestige: {earlier}", err=True)
    if errors:
        raise errors[-1]
