"""Read and write the CSV files with I/NAV pages of the official OSNMA test vectors.

The first line is `SVID,NumNavBits,NavBitsHEX`. Each further line has all pages of one satellite. A page has 60
hexadecimal digits and lasts 2 s. The first pages of all satellites have the same time. The file does not state this
time, but words 0 and 5 of the pages contain the time.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from os import SEEK_CUR
from pathlib import Path

from vestige.constants import MAX_SVID, SECONDS_PER_WEEK
from vestige.crypto.file_bytes import read_bytes
from vestige.errors import InputFileError
from vestige.navigation.inav.page import PAGE_BITS, PAGE_BYTES, PAGE_S, InavPage
from vestige.navigation.inav.words import time_in_word
from vestige.time import GalileoTime

HEADER = "SVID,NumNavBits,NavBitsHEX"
_MAX_FILE_BYTES = 500_000_000  # largest file in bytes, a week of 27 satellites; the whole file is read into memory

_UNPLACED = GalileoTime(0, 1)


def read_test_vector(path: Path, start: GalileoTime | None = None) -> Iterator[InavPage]:
    """Yield the pages of a test-vector file in the order of time.

    Pages with equal times come in the order of the satellites in the file. `start` is the time at which the first page
    begins. If `start` is None, words 0 and 5 of the pages give this time.

    The function raises `InputFileError` if the file is not a test-vector CSV, or if `start` is None and the words give
    no clear time.
    """
    satellites = _read_lines(path)
    if start is None:
        start = _start(path, satellites)
    n_pages = max(len(data) for data in satellites.values()) // PAGE_BYTES
    for index in range(n_pages):
        time = start + PAGE_S * index
        for svid, data in satellites.items():
            page = data[PAGE_BYTES * index : PAGE_BYTES * (index + 1)]
            if page:
                yield InavPage(svid=svid, time=time, data=page)


def write_test_vector(path: Path, pages: Mapping[int, Sequence[InavPage]]) -> None:
    """Write the pages of several satellites to a test-vector file.

    The first pages of all satellites must have the same time, and no page of a satellite may be missing.

    Parameters
    ----------
    path
        Path of the file, which is overwritten.
    pages
        Pages of each satellite in the order of time, by SVID.

    Raises
    ------
    ValueError
        If a page is missing, or if the first pages of the satellites have different times.
    """
    write_test_vector_in_parts(path, {svid: len(of_one) for svid, of_one in pages.items()}, [pages])


def write_test_vector_in_parts(
    path: Path, n_pages: Mapping[int, int], parts: Iterable[Mapping[int, Sequence[InavPage]]]
) -> None:
    """Write the pages of several satellites to a test-vector file part by part, so that little memory is needed.

    Parameters
    ----------
    path
        Path of the file, which is overwritten.
    n_pages
        Number of pages of each satellite in all parts together, by SVID.
    parts
        Successive pages of each satellite in the order of time, by SVID. The first pages of all satellites must have
        the same time.

    Raises
    ------
    ValueError
        If a page is missing, if the first pages have different times, or if the number of pages is not `n_pages`.
    """
    places, done, start = dict[int, int](), dict.fromkeys(n_pages, 0), None
    with path.open("wb") as stream:
        stream.write(f"{HEADER}\n".encode("ascii"))
        for svid, n in sorted(n_pages.items()):
            stream.write(f"{svid:02d},{PAGE_BITS * n},".encode("ascii"))
            places[svid] = stream.tell()
            stream.seek(2 * PAGE_BYTES * n, SEEK_CUR)
            stream.write(b"\n")
        for pages in parts:
            start = start or min(of_one[0].time for of_one in pages.values())
            for svid, of_one in pages.items():
                if any(page.time != start + PAGE_S * (done[svid] + number) for number, page in enumerate(of_one)):
                    raise ValueError(f"E{svid:02d}: its pages do not follow each other from {start} on")
                stream.seek(places[svid] + 2 * PAGE_BYTES * done[svid])
                stream.write(b"".join(page.data for page in of_one).hex().upper().encode("ascii"))
                done[svid] += len(of_one)
        if done != dict(n_pages):
            raise ValueError(f"found {done} pages by SVID, expected {dict(n_pages)}")


def _read_lines(path: Path) -> dict[int, bytes]:
    """Return the bytes of all pages of each satellite, by SVID."""
    try:
        lines = read_bytes(path, at_most=_MAX_FILE_BYTES).decode("ascii").splitlines()
    except UnicodeDecodeError as error:
        raise InputFileError(path, f"byte {error.start}", "not ASCII", "a test-vector CSV") from None
    if not lines or lines[0].strip() != HEADER:
        raise InputFileError(path, "line 1", lines[0] if lines else "nothing", HEADER)
    satellites: dict[int, bytes] = {}
    for number, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        svid, data = _read_line(path, number, line)
        if svid in satellites:
            raise InputFileError(path, f"line {number}", f"SVID {svid} again", "one line for each satellite")
        satellites[svid] = data
    if not satellites:
        raise InputFileError(path, "line 2", "nothing", "one line for each satellite")
    return satellites


def _read_line(path: Path, number: int, line: str) -> tuple[int, bytes]:
    place = f"line {number}"
    fields = line.strip().split(",")
    if len(fields) != 3:
        raise InputFileError(path, place, f"{len(fields)} fields", HEADER)
    svid, n_bits, digits = fields
    if not re.fullmatch(r"[0-9]{1,2}", svid) or not 1 <= int(svid) <= MAX_SVID:
        raise InputFileError(path, f"{place}, SVID", svid, f"1 to {MAX_SVID}")
    if not re.fullmatch(r"[0-9A-Fa-f]*", digits):
        wrong = re.search(r"[^0-9A-Fa-f]", digits)
        assert wrong is not None  # noqa: S101  (`fullmatch` found a wrong digit)
        raise InputFileError(path, f"{place}, digit {wrong.start() + 1}", wrong[0], "a hexadecimal digit")
    if not re.fullmatch(r"[0-9]{1,12}", n_bits) or int(n_bits) != 4 * len(digits):
        raise InputFileError(
            path, f"{place}, NumNavBits", n_bits, f"{4 * len(digits)}, four for each digit in the line"
        )
    if not digits or int(n_bits) % PAGE_BITS:
        raise InputFileError(path, f"{place}, NumNavBits", n_bits, f"a multiple of {PAGE_BITS}, the bits of a page")
    return int(svid), bytes.fromhex(digits)


def _start(path: Path, satellites: Mapping[int, bytes]) -> GalileoTime:
    """Return the time at which the first page begins, according to most of the words with a time."""
    votes: Counter[int] = Counter()
    for svid, data in satellites.items():
        for index in range(len(data) // PAGE_BYTES):
            page = InavPage(svid=svid, time=_UNPLACED, data=data[PAGE_BYTES * index : PAGE_BYTES * (index + 1)])
            stamp = time_in_word(page.word)
            if stamp is None or stamp[0] is None or stamp[1] >= SECONDS_PER_WEEK or not page.crc_ok or page.is_alert:
                continue
            votes[stamp[0] * SECONDS_PER_WEEK + stamp[1] - PAGE_S * index] += 1
    if not votes:
        raise InputFileError(path, "words 0 and 5", "no time", "a page that tells the time, or the start time given")
    (start, count), *_ = votes.most_common(1)
    if start < 0 or 2 * count <= votes.total():
        raise InputFileError(
            path, "words 0 and 5", f"{len(votes)} different start times", "one start time on which most words agree"
        )
    return GalileoTime.from_gst_seconds(start)
