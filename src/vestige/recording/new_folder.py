"""A folder that is either complete or not there."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vestige.errors import InputFileError


@contextmanager
def new_folder(output: Path) -> Iterator[Path]:
    """Yield a folder to write into, which becomes `output` at the end; after any error, Ctrl-C too, nothing is left.

    A run that was killed leaves `output.part`, which the next one replaces.

    Raises
    ------
    InputFileError
        If `output` exists.
    """
    if output.exists():
        raise InputFileError(output, "output folder", "something there already", "a name that is not taken")
    unfinished = output.with_name(output.name + ".part")
    shutil.rmtree(unfinished, ignore_errors=True)
    unfinished.mkdir(parents=True)
    try:
        yield unfinished
    except BaseException:
        shutil.rmtree(unfinished, ignore_errors=True)
        raise
    unfinished.rename(output)
