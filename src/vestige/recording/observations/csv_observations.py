"""Read and write E1 observations as CSV: a line for each satellite and epoch, with the units in the column names.

The first line names the columns, in any order::

    gst_week,gst_second,svid,pseudorange_m,carrier_phase_cycles,doppler_hz,doppler_rate_hz_per_s,cn0_dbhz,cycle_slip
    1161,348018.5,3,24563187.25,129081234.0625,-993.0,-0.41,45.1,0

The time, the satellite and the pseudorange are required. The other columns, or single values in the other columns, may
be missing. Numbers are written with all digits. Lines of the same epoch follow each other, and epochs are in time
order. The value 1 of `cycle_slip` means that the carrier phase is not continuous with the previous epoch.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path

from vestige.errors import InputFileError
from vestige.recording.exact_time import exact_second
from vestige.recording.observations.observation_epoch import (
    LIMITS,
    NUMBER,
    check_order,
    checked,
    checked_svid,
)
from vestige.records import E1Observation
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

REQUIRED = ("gst_week", "gst_second", "svid", "pseudorange_m")
OBSERVATION_COLUMNS = ("gst_week", "gst_second", "svid", *LIMITS, "cycle_slip")

_WHOLE = re.compile(r"\d{1,6}", re.ASCII)
_SECOND = re.compile(r"\d{1,6}(\.\d+)?", re.ASCII)


def is_csv_observations(first_line: str) -> bool:
    """Return whether the first line of a file is the header of a CSV table of observations."""
    return {"gst_week", "svid", "pseudorange_m"} <= {name.strip() for name in first_line.split(",")}


class CsvParser:
    """`EpochParser` of CSV observations.

    An epoch is complete when a line of the next epoch comes.

    `take` raises `InputFileError` if the header is wrong, a line does not agree with the header, a value is impossible,
    a satellite appears twice in an epoch, or time does not advance.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._columns: list[str] = []
        self._time: GalileoTime | None = None
        self._observations: dict[int, E1Observation] = {}
        self._slipped: set[int] = set()

    @property
    def begun(self) -> bool:
        """Whether the header was read without error."""
        return bool(self._columns)

    def take(self, number: int, line: str) -> ObservationEpoch | None:
        """Return the previous epoch if a line is the first line of another epoch."""
        path = self._path
        if not self._columns:
            self._columns = _columns(path, line)
            return None
        if not line.strip():
            return None
        values = [value.strip() for value in line.split(",")]
        if len(values) != len(self._columns):
            raise InputFileError(path, f"line {number}", f"{len(values)} values", f"{len(self._columns)} values")
        row = dict(zip(self._columns, values, strict=True))
        time = _time(path, number, row)
        if time != self._time:
            check_order(path, number, self._time, time)
        svid = checked_svid(path, number, row["svid"])
        if time == self._time and svid in self._observations:
            raise InputFileError(path, f"line {number}: svid", svid, "each satellite once an epoch")
        observation = E1Observation(svid=svid, **{name: _value(path, number, name, row) for name in LIMITS})
        slipped = _slip(path, number, row.get("cycle_slip", ""))
        whole = None
        if time != self._time:
            whole, self._time, self._observations, self._slipped = self._epoch(), time, {}, set()
        self._observations[svid] = observation
        if slipped:
            self._slipped.add(svid)
        return whole

    def finish(self) -> ObservationEpoch | None:
        """Return the last epoch, or None if there is no epoch.

        The function raises `InputFileError` if the file is empty.
        """
        if not self._columns:
            _columns(self._path, "")  # this call raises the error of an empty file
        return self._epoch()

    def _epoch(self) -> ObservationEpoch | None:
        if self._time is None:
            return None
        return ObservationEpoch(time=self._time, observations=self._observations, slipped=frozenset(self._slipped))


def write_csv_observations(path: Path, epochs: Iterable[ObservationEpoch]) -> None:
    """Write epochs, which must be in time order, with all digits, so that a reader gets exactly the same numbers."""
    with path.open("w", encoding="ascii", newline="\n") as stream:
        stream.write(",".join(OBSERVATION_COLUMNS) + "\n")
        for epoch in epochs:
            for svid in sorted(epoch.observations):
                fields = [getattr(epoch.observations[svid], name) for name in LIMITS]
                values = ["" if math.isnan(value) else repr(float(value)) for value in fields]
                slip = str(int(svid in epoch.slipped))
                stream.write(
                    ",".join([str(epoch.time.week), exact_second(epoch.time), str(svid), *values, slip]) + "\n"
                )


def _columns(path: Path, line: str) -> list[str]:
    columns = [name.strip() for name in line.split(",")]
    for name in REQUIRED:
        if name not in columns:
            raise InputFileError(path, "line 1", line, f"column names with {name}")
    for name in columns:
        if name not in OBSERVATION_COLUMNS:
            raise InputFileError(path, "line 1: column", name, f"one of {', '.join(OBSERVATION_COLUMNS)}")
        if columns.count(name) > 1:
            raise InputFileError(path, "line 1: column", f"{name} twice", "each column once")
    return columns


def _time(path: Path, number: int, row: dict[str, str]) -> GalileoTime:
    week, second = row["gst_week"], row["gst_second"]
    if not _WHOLE.fullmatch(week) or not _SECOND.fullmatch(second):
        raise InputFileError(path, f"line {number}: gst_week, gst_second", f"{week}, {second}", "a week and a second")
    try:
        return GalileoTime.parse(f"{week}:{second}")
    except ValueError as error:
        expected = "a second of the week, 0 to 604800"
        raise InputFileError(path, f"line {number}: gst_second", f"{week}:{second}", expected) from error


def _value(path: Path, number: int, name: str, row: dict[str, str]) -> float:
    text = row.get(name, "")
    if not text and name not in REQUIRED:
        return math.nan
    if not NUMBER.fullmatch(text):
        raise InputFileError(path, f"line {number}: {name}", text or "nothing", "a number")
    return checked(path, number, name, float(text))


def _slip(path: Path, number: int, text: str) -> bool:
    if text not in ("", "0", "1"):
        raise InputFileError(path, f"line {number}: cycle_slip", text, "0 or 1")
    return text == "1"
