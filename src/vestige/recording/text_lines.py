"""Read the numbered lines of an untrusted text file one at a time, with a limit for the length of a line."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator
from pathlib import Path

from vestige.crypto.file_bytes import open_file
from vestige.errors import InputFileError

LONGEST_LINE = 1 << 16  # longest line in bytes; a RINEX line with every Galileo signal has fewer than 1000 bytes
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def numbered_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the number of each line, from 1, and the text of the line without the line end.

    Each byte becomes one character, so columns count bytes.

    The function raises `InputFileError` if the file cannot be read, if a line is longer than `LONGEST_LINE`, or if the
    last line has no line end. A file without a last line end may have been cut off, so the last number in the
    file may lack digits.
    """
    with open_file(path) as stream:
        try:
            number = 0
            while raw := stream.readline(LONGEST_LINE):
                number += 1
                if not raw.endswith(b"\n"):
                    found = "no line end" + (
                        f" in {LONGEST_LINE} bytes" if len(raw) == LONGEST_LINE else ", end of the file"
                    )
                    raise InputFileError(path, f"line {number}", found, "a whole line")
                if number == 1:
                    raw = raw.removeprefix(BYTE_ORDER_MARK)
                yield number, raw.decode("latin-1").rstrip("\r\n")
        except OSError as error:
            raise InputFileError(path, "file", error.strerror or "an error", "a readable file") from error


class GrowingLines:
    """Reader of the lines of a file that another process is still writing.

    A line is complete when its line end is written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0  # offset of the first byte that was not read yet
        self._number = 0
        self._lines: deque[bytes] = deque()

    def take(self) -> tuple[int, str] | None:
        """Return the number and the text of the next line, like `numbered_lines`; None if no new line is complete.

        The function raises `InputFileError` if the file cannot be read, if the file became shorter, or if a line is
        longer than `LONGEST_LINE`.
        """
        if not self._lines and self._path.exists():
            self._read()
        if not self._lines:
            return None
        self._number += 1
        raw = self._lines.popleft()
        text = raw.removeprefix(BYTE_ORDER_MARK) if self._number == 1 else raw
        return self._number, text.decode("latin-1").rstrip("\r")

    def _read(self) -> None:
        """Read the complete lines in the next `LONGEST_LINE` bytes, and close the file again."""
        with open_file(self._path) as stream:
            try:
                size = os.fstat(stream.fileno()).st_size
                stream.seek(self._offset)
                data = stream.read(LONGEST_LINE)
            except OSError as error:
                raise InputFileError(self._path, "file", error.strerror or "an error", "a readable file") from error
        if size < self._offset:
            raise InputFileError(self._path, "length", f"{size} bytes", f"{self._offset} bytes, as before, or more")
        *lines, rest = data.split(b"\n")
        if len(rest) == LONGEST_LINE:
            place = f"line {self._number + 1}"
            raise InputFileError(self._path, place, f"no line end in {LONGEST_LINE} bytes", "a whole line")
        self._lines.extend(lines)
        self._offset += len(data) - len(rest)
