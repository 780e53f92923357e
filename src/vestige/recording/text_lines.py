"""Numbered lines of a text file from outside, one at a time and of bounded length."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from vestige.crypto.file_bytes import open_file
from vestige.errors import InputFileError

LONGEST = 1 << 16  # bytes; a RINEX line with every Galileo signal has under 1000
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def numbered_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield (number from 1, line without its end); a byte is a character, so columns count bytes.

    Raises
    ------
    InputFileError
        If the file cannot be read, a line is too long for text, or the last line has no end: then the file was cut
        off, and the last number in it may lack digits.
    """
    with open_file(path) as stream:
        try:
            number = 0
            while raw := stream.readline(LONGEST):
                number += 1
                if not raw.endswith(b"\n"):
                    found = "no line end" + (f" in {LONGEST} bytes" if len(raw) == LONGEST else ", end of the file")
                    raise InputFileError(path, f"line {number}", found, "a whole line")
                if number == 1:
                    raw = raw.removeprefix(BYTE_ORDER_MARK)
                yield number, raw.decode("latin-1").rstrip("\r\n")
        except OSError as error:
            raise InputFileError(path, "file", error.strerror or "an error", "a readable file") from error
