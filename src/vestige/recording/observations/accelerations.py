"""Read accelerations of the receiver from a CSV file of inertial sensors, complete or still being written.

The first line names the columns. Times are on the receiver's clock, like the times of the observations::

    gst_week,gst_second,east_mps2,north_mps2,up_mps2
    1421,561616.00,0.013,-0.002,0.008

The columns give the acceleration of the antenna relative to the Earth along local axes, without gravity. A strap-down
system with known attitude measures this acceleration. The file has at least one row per second.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float

from vestige.constants import SECONDS_PER_WEEK
from vestige.errors import InputFileError, VestigeError
from vestige.recording.numeric_csv import MOST_ROWS, check_header, numeric_row
from vestige.recording.text_lines import GrowingLines, numbered_lines
from vestige.records.inertial import Accelerations
from vestige.time import GalileoTime

# column -> smallest and largest value
ACCELERATION_COLUMNS: Mapping[str, tuple[float, float]] = {
    "gst_week": (0, 99_999),
    "gst_second": (0, math.nextafter(SECONDS_PER_WEEK, 0)),
    "east_mps2": (-1e4, 1e4),
    "north_mps2": (-1e4, 1e4),
    "up_mps2": (-1e4, 1e4),
}
GRAVITY_MPS2 = 9.8  # gravity is 9.78 m/s² at the equator and 9.83 m/s² at the poles
_GRAVITY_TOLERANCE_MPS2 = 0.2
# shortest duration in s of a test for gravity; no car, ship or airliner accelerates at 1 g in one direction for half of
# this time
_GRAVITY_S = 20.0
_TOLD = 4  # number of values of a row that are kept: elapsed time and three accelerations


def read_accelerations(path: Path) -> Accelerations:
    """Return the accelerations of a file.

    The function raises `InputFileError` if the columns differ, a value is not a number within its limits, time does not
    advance, there are fewer than two or more than `MOST_ROWS` rows, or gravity was not removed.
    """
    table = _Table(path)
    for number, line in numbered_lines(path):
        table.take(number, line)
    if not table.begun:
        check_header(path, "", ACCELERATION_COLUMNS)  # this call raises the error of an empty file
    if table.n_rows < 2:
        raise InputFileError(path, "file", f"{table.n_rows} rows", "two or more")
    return table.accelerations()


class GrowingAccelerations:
    """Growing file of accelerations, which need not exist yet.

    `warn` gets the fault of each damaged row, which is left out.
    """

    def __init__(self, path: Path, *, warn: Callable[[VestigeError], None]) -> None:
        self._table, self._lines, self._warn = _Table(path), GrowingLines(path), warn

    def look(self) -> bool:
        """Read new lines, and return whether the file had new lines.

        The function raises `InputFileError` if the columns differ, or the file became shorter.
        """
        changed = False
        while (line := self._lines.take()) is not None:
            changed, begun = True, self._table.begun
            try:
                self._table.take(*line)
            except VestigeError as error:
                if not begun:
                    raise
                self._warn(error)
        return changed

    def reaches(self, time: GalileoTime) -> bool:
        """Return whether a row at or after a time was read."""
        return self._table.n_rows > 0 and self._table.end >= time

    @property
    def found(self) -> Accelerations:
        """Accelerations that are known so far.

        The function raises `InputFileError` if the accelerations include gravity.
        """
        return self._table.accelerations()

    def release(self, time: GalileoTime) -> None:
        """Drop the accelerations before `time`, except the last acceleration that is not later than `time`."""
        self._table.release(time)


class _Table:
    """Rows of a file that were read so far."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._start = GalileoTime(0, 0)
        self._last = (0.0, -math.inf)
        self._rows = array("d")
        self.begun = False

    @property
    def n_rows(self) -> int:
        """Number of rows that are kept."""
        return len(self._rows) // _TOLD

    @property
    def end(self) -> GalileoTime:
        """Time of the last row."""
        return self._start + self._rows[-_TOLD]

    def take(self, number: int, line: str) -> None:
        """Add the row of the next line."""
        if not self.begun:
            check_header(self._path, line, ACCELERATION_COLUMNS)
            self.begun = True
        elif line.strip():
            week, second, *acceleration = numeric_row(self._path, number, line, ACCELERATION_COLUMNS)
            if week != int(week):
                raise InputFileError(self._path, f"line {number}: gst_week", week, "a whole number")
            if not (week, second) > self._last:
                found, last = (f"{int(w)}:{s:.10g}" for w, s in ((week, second), self._last))
                raise InputFileError(self._path, f"line {number}: gst_week, gst_second", found, f"more than {last}")
            if self.n_rows == MOST_ROWS:
                raise InputFileError(self._path, f"line {number}", "another row", f"at most {MOST_ROWS} rows")
            if math.isinf(self._last[1]):
                self._start = GalileoTime(int(week), int(second))
            self._last = (week, second)
            elapsed_s = (week - self._start.week) * SECONDS_PER_WEEK + (second - self._start.second)
            self._rows.extend((elapsed_s, *acceleration))

    def accelerations(self) -> Accelerations:
        """Return the rows as accelerations."""
        rows = np.array(self._rows).reshape(-1, _TOLD)
        _check_gravity(self._path, rows)
        return Accelerations(start=self._start, elapsed_s=rows[:, 0].copy(), acceleration_mps2=rows[:, 1:].copy())

    def release(self, time: GalileoTime) -> None:
        """Drop the rows before the last row that is not later than a time."""
        elapsed_s = np.array(self._rows[::_TOLD])
        first = int(np.searchsorted(elapsed_s, time - self._start, side="right")) - 1
        del self._rows[: _TOLD * max(first, 0)]


def _check_gravity(path: Path, rows: Float[np.ndarray, "n 4"]) -> None:
    """Raise InputFileError if the median acceleration of at least 20 s of rows has the magnitude of gravity."""
    if len(rows) and rows[-1, 0] - rows[0, 0] >= _GRAVITY_S:
        usual = float(np.linalg.norm(np.median(rows[:, 1:], axis=0)))
        if abs(usual - GRAVITY_MPS2) <= _GRAVITY_TOLERANCE_MPS2:
            expected = "kinematic accelerations along east, north, up: gravity taken off"
            raise InputFileError(path, "file", f"{usual:.2f} m/s² in the middle of all rows", expected)
