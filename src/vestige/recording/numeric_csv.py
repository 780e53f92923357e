"""Read tables of numbers as CSV: a header with the column names, then rows sorted by time, the first column."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float

from vestige.errors import InputFileError
from vestige.recording.text_lines import numbered_lines

_TIME = (-1e9, 1e9)
MOST_ROWS = 10_000_000

# column -> smallest and largest value
WAYPOINTS: Mapping[str, tuple[float, float]] = {
    "time_s": _TIME,
    "latitude_deg": (-90.0, 90.0),
    "longitude_deg": (-360.0, 360.0),
    "height_m": (-1e4, 1e6),
}


def read_numeric_csv(path: Path, columns: Mapping[str, tuple[float, float]]) -> Float[np.ndarray, "n k"]:
    """Return the rows of a table that has exactly the columns of `columns`, and at least two rows.

    `columns` gives the smallest and the largest value of each column, in the order of the file.

    The function raises `InputFileError` if the header differs, a row has another length, a value is not a number within
    its limits, the first column does not rise, or the number of rows is below 2 or above `MOST_ROWS`.
    """
    lines = numbered_lines(path)
    check_header(path, next(lines, (1, ""))[1], columns)
    rows: list[list[float]] = []
    for number, line in lines:
        if not line.strip():
            continue
        if len(rows) == MOST_ROWS:
            raise InputFileError(path, f"line {number}", "another row", f"at most {MOST_ROWS} rows")
        rows.append(numeric_row(path, number, line, columns))
        if len(rows) > 1 and not rows[-1][0] > rows[-2][0]:
            raise InputFileError(path, f"line {number}: {next(iter(columns))}", rows[-1][0], f"more than {rows[-2][0]}")
    if len(rows) < 2:
        raise InputFileError(path, "file", f"{len(rows)} rows", "two or more")
    return np.array(rows)


def check_header(path: Path, line: str, columns: Mapping[str, tuple[float, float]]) -> None:
    """Raise InputFileError unless the first line of a file names exactly the columns of `columns`."""
    if line.strip() != (header := ",".join(columns)):
        raise InputFileError(path, "line 1", line.strip() or "nothing", header)


def numeric_row(path: Path, number: int, line: str, columns: Mapping[str, tuple[float, float]]) -> list[float]:
    """Return the values of a line.

    The function raises `InputFileError` if the line has another number of values, or a value is not a number within its
    limits.
    """
    texts = line.split(",")
    if len(texts) != len(columns):
        raise InputFileError(path, f"line {number}", f"{len(texts)} fields", f"{len(columns)}: {','.join(columns)}")
    values = []
    for text, (name, (low, high)) in zip(texts, columns.items(), strict=True):
        try:
            value = float(text) if text.isascii() and "_" not in text else math.nan
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise InputFileError(path, f"line {number}: {name}", text, f"a number from {low:g} to {high:g}")
        values.append(value)
    return values
