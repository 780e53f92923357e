"""Read untrusted files: return their bytes, or raise an error with a clear message."""

from __future__ import annotations

import logging
import os
import stat
from pathlib import Path
from typing import BinaryIO

from vestige.errors import InputFileError

_log = logging.getLogger(__name__)


def read_bytes(path: Path, *, at_most: int | None = None) -> bytes:
    """Return the content of the regular file `path`.

    A file of more than `at_most` bytes cannot be valid, and is not read.

    The function raises `InputFileError` if `path` does not exist, is not a regular file, cannot be read, or is longer
    than `at_most`.
    """
    with open_file(path) as file:
        try:
            size = os.fstat(file.fileno()).st_size
            if at_most is not None and size > at_most:
                raise InputFileError(path, "length", f"{size} bytes", f"at most {at_most} bytes")
            _log.info("read %s: %d bytes", path, size)
            return file.read()
        except OSError as error:
            raise InputFileError(path, "file", _reason(error), "a readable file") from error


def read_text(path: Path, *, at_most: int, expected: str = "a text file") -> str:
    """Return the content of the regular file `path` as UTF-8 text, with or without a byte order mark.

    `expected` names the expected content, for the error message.

    The function raises `InputFileError` in the cases of `read_bytes`, and if the content is not UTF-8.
    """
    try:
        return read_bytes(path, at_most=at_most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputFileError(path, f"byte {error.start}", "bytes that are not UTF-8", expected) from error


def open_file(path: Path) -> BinaryIO:
    """Return the regular file `path`, open for reading.

    A pipe or a device is refused, because its data may never end.

    The function raises `InputFileError` if `path` does not exist, is not a regular file, or cannot be read.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise InputFileError(path, "file", "something else", "a regular file")
        return path.open("rb")
    except (OSError, ValueError) as error:  # a ValueError means an invalid file name
        raise InputFileError(path, "file", _reason(error), "a readable file") from error


def list_folder(folder: Path) -> tuple[Path, ...]:
    """Return the content of `folder`, sorted by name.

    The function raises `InputFileError` if `folder` is not a folder or cannot be listed.
    """
    try:
        return tuple(sorted(folder.iterdir()))
    except (OSError, ValueError) as error:
        raise InputFileError(folder, "folder", _reason(error), "a readable folder") from error


def _reason(error: OSError | ValueError) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error)
