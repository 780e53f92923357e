"""Write outputs so that an output is either complete or unchanged, and never destroys an input.

A command whose output could be one of its inputs calls `check_output` before the computation. Most commands write
through `replacement` or `new_folder`. Both functions yield a path in a private folder beside the output, `.output.…`,
and rename the result at the end. The private folder is new, so no other user can have prepared it. After an error or
Ctrl-C the private folder is removed. A killed process leaves the private folder, which is hidden and harmless. `vestige
simulate` can resume an unfinished recording (`simulated.unfinished_recording`).
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

STORE_MARK = "zarr.json"  # name of a file that is in every folder of results
_NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
# number of characters of the output's name in the name of the private folder; a file name has at most 255 bytes
NAME_KEPT = 50


def check_output(output: Path | None, inputs: Iterable[Path | None], *, folder: bool = False) -> None:
    """Refuse an output that would destroy an input or lie among inputs.

    Parameters
    ----------
    output
        File or folder to be written; None for no output.
    inputs
        Files and folders that the command reads; None for an input that is not given.
    folder
        Whether the output is a folder. An output folder may lie in an input folder, because an output folder replaces
        no file.

    Raises
    ------
    InputFileError
        If the output is an input or lies in the store of a campaign. If an output file would lie in an input folder, or
        would replace a folder, a symbolic link, a device or a pipe.
    OSError
        If the folder of an output file does not exist.
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
            raise InputFileError(
                output, "output", f"a path in the input folder {one.name}", "a path outside of this folder"
            )


@contextmanager
def replacement(output: Path) -> Iterator[Path]:
    """Yield a path at which to write a file or a folder, which replaces `output` at the end.

    A file is written to the disk before the file gets its final name. The yielded path ends in the name of `output`
    with its suffix.

    Raises
    ------
    InputFileError
        If `output` is a symbolic link, a device or a pipe, or lies in the store of a campaign.
    OSError
        If the output cannot be written. The error has the name of `output`.
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
    """Yield a folder to write into, which becomes `output` at the end.

    If several writers have the same `output`, only the writer that finishes first succeeds.

    Raises
    ------
    InputFileError
        If `output` exists, at the beginning or at the end, or lies in the store of a campaign.
    OSError
        If the output cannot be written. The error has the name of `output`.
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
    """Refuse an output folder that already exists, or that would lie in the store of a campaign.

    Raises
    ------
    InputFileError
        If the folder exists, or would lie in the store of a campaign.
    """
    _check_place(output)
    if os.path.lexists(output):
        raise InputFileError(output, "output folder", "an existing file or folder", "a new name")


@contextmanager
def naming(output: Path, private: str | None = None) -> Iterator[None]:
    """Put the name of `output` into errors that name the folder `private`, or report a full disk and name no file."""
    try:
        yield
    except OSError as error:
        nameless = error.filename is None and error.errno in _NO_SPACE
        if nameless or (private is not None and private in str(error.filename)):
            raise OSError(error.errno, error.strerror, str(output)) from error
        raise


@contextmanager
def _beside(output: Path) -> Iterator[Path]:
    """Yield a path with the name of `output` in a private folder beside `output`.

    The private folder is removed at the end.
    """
    try:
        folder = TemporaryDirectory(prefix=f".{output.name[:NAME_KEPT]}.", dir=output.parent)
    except OSError as error:
        error.filename = str(output)  # the error names the path that the user has given
        raise
    with folder as private, naming(output, private):
        yield Path(private) / output.name  # not `private`, whose mode 0700 the output must not get


def _sync(path: Path) -> None:
    """Make the operating system write the contents of a file to the disk."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def _check_place(output: Path) -> None:
    for parent in output.resolve().parents:
        if (parent / STORE_MARK).is_file():
            raise InputFileError(
                output, "output", f"a path in the results {parent.name}", "a path outside of these results"
            )


def _check_file(output: Path) -> None:
    _check_replaceable(output)
    if output.is_dir():
        raise InputFileError(output, "output", "a folder", "the name of a file")


def _check_replaceable(output: Path) -> None:
    """Refuse an output that is a symbolic link, a device or a pipe, because a rename would replace it."""
    try:
        mode = output.lstat().st_mode
    except OSError:  # nothing is at the path, or writing will raise the error
        return
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        found = "a symbolic link" if stat.S_ISLNK(mode) else "a device or a pipe"
        raise InputFileError(output, "output", found, "a regular file, or a new name")
