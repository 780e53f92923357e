"""Read navigation pages from files of any supported format."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from vestige.crypto.file_bytes import open_file
from vestige.errors import InputFileError
from vestige.navigation.inav.page import InavPage
from vestige.recording.observations import sbf
from vestige.recording.samples import test_vector_csv
from vestige.time import GalileoTime

_HEAD_BYTES = 1 << 16  # length of the longest SBF block, so that the first bytes of an SBF file contain a sync word


def read_pages(
    path: Path, *, start: GalileoTime | None = None, counts: sbf.SbfCounts | None = None
) -> Iterator[InavPage]:
    """Yield the E1-B I/NAV pages of an SBF file or a test-vector CSV file.

    The content of the file tells the format. `start` is the start of the first page of a test vector. By default this
    start is read from the navigation words. An SBF file contains the times of its pages. `counts` receives the numbers
    of blocks of an SBF file.

    The function raises `InputFileError` if the file has another format, or is so damaged that nothing can be read.
    """
    with open_file(path) as file:
        head = file.read(_HEAD_BYTES)
    if head.startswith(test_vector_csv.HEADER.encode()):
        yield from test_vector_csv.read_test_vector(path, start)
    elif sbf.SYNC in head:
        yield from sbf.read_sbf(path, counts)
    else:
        raise InputFileError(path, "file", repr(head[:16]) if head else "nothing", "SBF or an OSNMA test-vector CSV")
