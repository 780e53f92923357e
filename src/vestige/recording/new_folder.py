"""A folder that is either complete or not there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from vestige.errors import InputFileError


@contextmanager
def new_folder(output: Path) -> Iterator[Path]:
    """Yield a folder to write into, which becomes `output` at the end; after any error, Ctrl-C too, nothing is left.

    It stands beside `output` under a name that nobody else has. So of several writers of one output one succeeds, and
    what a killed one left, `.output.…`, is in nobody's way.

    Raises
    ------
    InputFileError
        If `output` exists, at the beginning or at the end.
    """
    _check_free(output)
    output.parent.mkdir(parents=True, exist_ok=True)
    try:
        folder = TemporaryDirectory(prefix=f".{output.name}.", dir=output.parent)
    except OSError as error:
        error.filename = str(output)  # the name that the user knows
        raise
    with folder as private:
        unfinished = Path(private) / output.name  # private itself is readable by its owner only
        unfinished.mkdir()
        yield unfinished
        try:
            unfinished.rename(output)
        except OSError:
            _check_free(output)
            raise


def _check_free(output: Path) -> None:
    if output.exists():
        raise InputFileError(output, "output folder", "something there already", "a name that is not taken")
