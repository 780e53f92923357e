"""Outputs: an output is either complete or as it was before, and it never destroys an input.

A command whose output could be an input asks `check_output` before it computes, and every command writes through
`replacement` or `new_folder`. Both write into a private folder beside the output, `.output.…`, which nobody else can
have prepared, and rename at the end. After an error or Ctrl-C nothing of it is left; a killed process leaves the hidden
folder, which is in nobody's way. `vestige simulate` resumes: `simulated.unfinished_recording`.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from vestige.errors import InputFileError

STORE_MARK = "zarr.json"  # is in every folder of results
_NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
NAME_KEPT = 50  # characters: a file name has 255 bytes


def check_output(output: Path | None, inputs: Iterable[Path | None], *, folder: bool = False) -> None:
    """Refuse an output that would destroy an input or lie among inputs.

    Parameters
    ----------
    output
        File or folder to be written; None: there is none.
    inputs
        Files and folders that the command reads; None: not given.
    folder
        Whether the output is a folder. It may lie in a folder that is an input: writing it replaces nothing there.

    Raises
    ------
    InputFileError
        If the output is an input or lies in the store of a campaign; or if it is to be a file, and lies in a folder
        that is an input, or something else than a file has that name.
    OSError
        If the folder in which a file is to be written is not there.
    """
    if output is None:
        return
    _check_place(output)
    if not folder:
        _check_file(output)
        if not output.parent.is_dir():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(output))
    real = output.resolve()
    for one in (given for given in inputs if given is not None):
        if one.resolve() == real or (one.exists() and output.exists() and one.samefile(output)):
            raise InputFileError(output, "output", "an input of this command", "another name")
        if not folder and one.is_dir() and one.resolve() in real.parents:
            raise InputFileError(output, "output", f"a place in the input folder {one.name}", "a place outside of it")


@contextmanager
def replacement(output: Path) -> Iterator[Path]:
    """Yield a path at which to write a file or a folder, which takes the place of `output` at the end.

    A file is on the disk before it takes its name. The path ends in the name of `output`, its suffix included.

    Raises
    ------
    InputFileError
        If `output` is a symbolic link or a device, or lies in the store of a campaign.
    OSError
        If it cannot be written; the error has the name of `output`.
    """
    _check_place(output)
    _check_replaceable(output)
    with _beside(output) as unfinished:
        yield unfinished
        if unfinished.is_dir():
            if output.exists():
                output.rename(unfinished.parent / "before")
        else:
            _sync(unfinished)
        unfinished.replace(output)


@contextmanager
def new_folder(output: Path) -> Iterator[Path]:
    """Yield a folder to write into, which becomes `output` at the end; if several programs write one, one succeeds.

    Raises
    ------
    InputFileError
        If `output` exists, at the beginning or at the end, or lies in the store of a campaign.
    OSError
        If it cannot be written; the error has the name of `output`.
    """
    check_new_folder(output)
    output.parent.mkdir(parents=True, exist_ok=True)
    with _beside(output) as unfinished:
        unfinished.mkdir()
        yield unfinished
        try:
            unfinished.rename(output)
        except OSError:
            check_new_folder(output)
            raise


def check_new_folder(output: Path) -> None:
    """Refuse a folder to be written that is there already, or would lie in the store of a campaign.

    Raises
    ------
    InputFileError
        In these two cases.
    """
    _check_place(output)
    if os.path.lexists(output):
        raise InputFileError(output, "output folder", "something there already", "a name that is not taken")


@contextmanager
def naming(output: Path, private: str | None = None) -> Iterator[None]:
    """Give the errors of a full disk the name of the output, which a write does not know, and those of `private`."""
    try:
        yield
    except OSError as error:
        nameless = error.filename is None and error.errno in _NO_SPACE
        if nameless or (private is not None and private in str(error.filename)):
            raise OSError(error.errno, error.strerror, str(output)) from error
        raise


@contextmanager
def _beside(output: Path) -> Iterator[Path]:
    """Yield a path of the name of `output` in a private folder beside it, which is removed at the end."""
    try:
        folder = TemporaryDirectory(prefix=f".{output.name[:NAME_KEPT]}.", dir=output.parent)
    except OSError as error:
        error.filename = str(output)  # the name that the user knows
        raise
    with folder as private, naming(output, private):
        yield Path(private) / output.name  # private itself is readable by its owner only


def _sync(path: Path) -> None:
    """Have a file on the disk."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def _check_place(output: Path) -> None:
    for parent in output.resolve().parents:
        if (parent / STORE_MARK).is_file():
            raise InputFileError(output, "output", f"a place in the results {parent.name}", "a place outside of them")


def _check_file(output: Path) -> None:
    _check_replaceable(output)
    if output.is_dir():
        raise InputFileError(output, "output", "a folder", "the name of a file")


def _check_replaceable(output: Path) -> None:
    """Refuse what a rename would destroy without anybody meaning it."""
    try:
        mode = output.lstat().st_mode
    except OSError:  # nothing there, or nobody can say; then writing says why
        return
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        found = "a symbolic link" if stat.S_ISLNK(mode) else "a device or a pipe"
        raise InputFileError(output, "output", found, "a file, or a name that is not taken")
