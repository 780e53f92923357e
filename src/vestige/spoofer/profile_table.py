"""Read a profile from a CSV file.

The first line is the header `time_s,value`, and each following line has a point of the profile. Empty lines and lines
that begin with # are skipped.
"""

from __future__ import annotations

from math import isfinite
from pathlib import Path

from vestige.crypto.file_bytes import read_text
from vestige.errors import InputFileError

_MAX_FILE_BYTES = 1 << 26  # largest size of a file in bytes, for about 2 million points
_HEADER = "time_s,value"


def read_profile_table(path: Path) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the times in s and the values of a profile from a CSV file.

    The function raises `InputFileError` if the file cannot be read, or has another format, fewer than two points, a
    number that is not finite, or times that do not ascend.
    """
    text = read_text(path, at_most=_MAX_FILE_BYTES, expected="a CSV file")
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1)]
    lines = [(number, line) for number, line in lines if line and not line.startswith("#")]
    if not lines or lines[0][1].replace(" ", "") != _HEADER:
        raise InputFileError(path, "first line", lines[0][1] if lines else "nothing", _HEADER)
    times_s: list[float] = []
    values: list[float] = []
    for number, line in lines[1:]:
        try:
            time_s, value = (float(part) for part in line.split(","))
        except ValueError as error:
            raise InputFileError(path, f"line {number}", line, "two numbers, time_s and value") from error
        if not (isfinite(time_s) and isfinite(value)):
            raise InputFileError(path, f"line {number}", line, "finite numbers")
        if times_s and time_s <= times_s[-1]:
            raise InputFileError(path, f"line {number}", line, f"a time after {times_s[-1]:g} s")
        times_s.append(time_s)
        values.append(value)
    if len(times_s) < 2:
        raise InputFileError(path, "end of file", f"{len(times_s)} points", "two points or more")
    return tuple(times_s), tuple(values)
