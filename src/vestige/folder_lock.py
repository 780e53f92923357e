"""Lock a folder for a single writer. If the file system has locks, a second writer gets an error and writes nothing."""

from __future__ import annotations

import errno
import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vestige.errors import InputFileError

_NO_LOCKS_HERE = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS)  # errors of network file systems without locks


@contextmanager
def only_writer(folder: Path) -> Iterator[int]:
    """Hold the lock of a folder, and yield the file descriptor of the folder. The function creates a missing folder.

    The kernel releases the lock at the latest when the process and its forked workers have ended, even after a crash.
    The lock writes nothing into the folder. If the file system has no locks, the folder is used without a lock.

    Raises
    ------
    InputFileError
        If another writer holds the lock, or `folder` is a file.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise InputFileError(folder, "folder", "a file", "a folder") from error
    lock = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputFileError(
                folder, "folder", "another process that writes into it", "one process at a time"
            ) from error
        except OSError as error:
            if error.errno not in _NO_LOCKS_HERE:
                raise
        yield lock
    finally:
        os.close(lock)
