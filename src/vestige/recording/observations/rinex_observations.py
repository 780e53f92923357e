"""Read Galileo E1 observations in RINEX 3 and 4 observation files [RINEX], an epoch at a time.

Epochs in RINEX are calendar times on the receiver's clock in the time system of the header. GPS, Galileo, QZSS and
NavIC time count the same seconds. The differences between these times, some nanoseconds, are part of the receiver's
clock error. BeiDou time is 14 s behind GPS time. The Galileo week follows from the calendar. GLONASS time has the leap
seconds of UTC and is not supported.

A receiver may track E1-C, E1-B or both together, and a file may contain several of these signals. For each satellite
and epoch the reader takes the first signal of `SIGNALS` that has a pseudorange. Carrier phase, Doppler and C/N0 are
taken from the same signal.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path

from vestige.errors import InputFileError, UnsupportedError
from vestige.recording.observations.observation_epoch import (
    check_order,
    checked,
    checked_svid,
)
from vestige.records import E1Observation
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

# RINEX signals of E1 in order of preference: C/N0 of E1-C minus C/N0 of the signal in dB. E1-B and E1-C have equal
# power [OS-ICD]. The combined channel "X" has the power of both components.
SIGNALS = {"1C": 0.0, "1X": -10 * math.log10(2), "1B": 0.0}

# seconds to add to a calendar time of a time system to get Galileo System Time [RINEX]
TIME_SYSTEMS = {"GAL": 0, "GPS": 0, "QZS": 0, "IRN": 0, "BDT": 14}
# default time system of a file with one satellite system
ONE_SYSTEM_TIME = {"E": "GAL", "G": "GPS", "J": "QZS", "I": "IRN", "C": "BDT"}

FIELDS = {"C": "pseudorange_m", "L": "carrier_phase_cycles", "D": "doppler_hz", "S": "cn0_dbhz"}

_VALUE = re.compile(r" *-?\d*\.\d{3}", re.ASCII)  # format F14.3
_COUNT = re.compile(r" *\d+", re.ASCII)
_EPOCH = re.compile(r"> (\d{4}) ([ \d]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d) *(\d{1,2})\.(\d{1,7}) *", re.ASCII)


@dataclass(slots=True)
class _Header:
    """Header records that were read so far."""

    path: Path
    system: str = " "
    time_system: str | None = None
    types: dict[str, list[str]] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    last_system: str = ""

    def take(self, number: int, line: str) -> None:
        """Read a header record, or skip a record that is not needed."""
        label = line[60:80].strip()
        if label == "SYS / # / OBS TYPES":
            self._take_types(number, line)
        elif label == "TIME OF FIRST OBS":
            self.time_system = line[48:51].strip()
        elif label == "SYS / SCALE FACTOR" and line[0] == "E" and line[2:6].strip() not in ("", "1"):
            raise UnsupportedError(f"{self.path}: line {number}: scaled Galileo observations are not read")

    def _take_types(self, number: int, line: str) -> None:
        if line[0] != " ":
            self.last_system = line[0]
            if not _COUNT.fullmatch(line[3:6]):
                raise InputFileError(self.path, f"line {number}", line[3:6], "a number of observation types")
            self.types[line[0]], self.counts[line[0]] = [], int(line[3:6])
        elif not self.last_system:
            raise InputFileError(self.path, f"line {number}", "a continuation", "the system of the observation types")
        self.types[self.last_system] += line[6:58].split()

    def check(self, number: int) -> None:
        """Raise `InputFileError` or `UnsupportedError` if a required line of the header is missing or not usable."""
        if self.time_system is None:
            raise InputFileError(self.path, f"line {number}", "the end of the header", "TIME OF FIRST OBS before it")
        name = self.time_system or ONE_SYSTEM_TIME.get(self.system, "")
        if name == "GLO":
            raise UnsupportedError(f"{self.path}: epochs in GLONASS time (UTC) are not read")
        if name not in TIME_SYSTEMS:
            raise InputFileError(self.path, "TIME OF FIRST OBS", name, f"a time system: {', '.join(TIME_SYSTEMS)}")
        self.time_system = name
        types = self.types.get("E", [])
        if len(types) != self.counts.get("E", 0):
            expected = f"{self.counts['E']} observation types of Galileo"
            raise InputFileError(self.path, "SYS / # / OBS TYPES", f"{len(types)}", expected)
        if not any(f"C{signal}" in types for signal in SIGNALS):
            expected = f"a Galileo E1 pseudorange, one of {', '.join('C' + s for s in SIGNALS)}"
            raise InputFileError(self.path, "SYS / # / OBS TYPES", " ".join(types) or "no Galileo", expected)

    @property
    def signals(self) -> dict[str, dict[str, int]]:
        """Columns of the observations of each E1 signal in the file, in order of preference."""
        types = self.types["E"]
        start = {code: 3 + 16 * index for index, code in enumerate(types)}
        return {
            signal: {name: start[kind + signal] for kind, name in FIELDS.items() if kind + signal in start}
            for signal in SIGNALS
            if "C" + signal in start
        }


def is_rinex_observations(first_line: str) -> bool:
    """Return whether the first line of a file marks RINEX observations, of any version."""
    return first_line[60:80].strip() == "RINEX VERSION / TYPE" and first_line[20:21] == "O"


class RinexParser:
    """`EpochParser` of RINEX observations.

    The last record of an epoch completes the epoch. After an error in an epoch, the parser skips everything until the
    next epoch record. Epochs without a Galileo satellite are empty. A field that is blank or zero was not measured.
    Doppler rates are NaN, because RINEX has no Doppler rates. A satellite has a cycle slip after a power failure, or if
    bit 0 of its loss-of-lock indicator is set. A satellite also has a cycle slip if its observations come from another
    signal than its previous observations.

    `take` raises `InputFileError` if the file has another format, the header is incomplete, a line is damaged, a
    satellite appears twice in an epoch, or time does not advance. `take` raises `UnsupportedError` for RINEX 1 and 2,
    compact RINEX, GLONASS time and scaled observations of Galileo.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._header: _Header | None = None
        self._signals: dict[str, dict[str, int]] = {}
        self._taken: dict[int, str] = {}
        self._before: GalileoTime | None = None
        self._head: tuple[int, str] = (0, "")  # the epoch record to which `_records` belong
        self._records: list[tuple[int, str]] = []
        self._wanted = 0
        self._lost = False
        self._number = 1

    @property
    def begun(self) -> bool:
        """Whether the header was read without error."""
        return bool(self._signals)

    def take(self, number: int, line: str) -> ObservationEpoch | None:
        """Return the epoch that a line completes, or None."""
        self._number = number
        if not self._signals:
            self._take_header(number, line)
            return None
        if not self._wanted and (not line.strip() or (self._lost and not line.startswith(">"))):
            return None
        self._lost = True
        epoch = self._take_record(number, line)
        self._lost = False
        return epoch

    def finish(self) -> ObservationEpoch | None:
        """Return None, because `take` has returned all epochs.

        The function raises `InputFileError` if the file is empty or was cut off.
        """
        if self._header is None:
            _first_line(self._path, "")
        if not self._signals:
            raise InputFileError(self._path, f"line {self._number}", "the end of the file", "END OF HEADER")
        if self._wanted:
            found = f"the end of the file after {len(self._records)} records of this epoch"
            raise InputFileError(self._path, f"line {self._head[0]}", found, f"{self._wanted} records")
        return None

    def _take_header(self, number: int, line: str) -> None:
        if self._header is None:
            self._header = _first_line(self._path, line)
        elif line[60:80].strip() == "END OF HEADER":
            self._header.check(number)
            self._signals = self._header.signals
        else:
            self._header.take(number, line)

    def _take_record(self, number: int, line: str) -> ObservationEpoch | None:
        if self._wanted:
            self._records.append((number, line))
        else:
            if not line.startswith(">"):
                raise InputFileError(self._path, f"line {number}", line, "an epoch record, which begins with >")
            flag = line[31:32].strip() or "0"
            if flag not in "0123456" or not _COUNT.fullmatch(line[32:35]):
                expected = "an event flag 0 to 6 and a number of records"
                raise InputFileError(self._path, f"line {number}", line[31:35], expected)
            self._head, self._records, self._wanted = (number, line), [], int(line[32:35])
        if len(self._records) < self._wanted:
            return None
        self._wanted = 0
        return self._epoch()

    def _epoch(self) -> ObservationEpoch | None:
        """Return the epoch of the records, or None if the records belong to an event."""
        path, (number, line), header = self._path, self._head, self._header
        assert header is not None  # noqa: S101  (records come after the header)
        flag = line[31:32].strip() or "0"
        if flag not in "01":
            if flag == "4":
                for at, record in self._records:
                    header.take(at, record)
                header.check(number)
                self._signals = header.signals
            return None
        time = _time(path, number, line, TIME_SYSTEMS[header.time_system or "GAL"])
        check_order(path, number, self._before, time)
        self._before = time
        epoch = _epoch(path, time, self._records, self._signals, self._taken)
        return replace(epoch, slipped=frozenset(epoch.observations)) if flag == "1" else epoch


def _first_line(path: Path, line: str) -> _Header:
    if line[60:80].startswith("CRINEX VERS"):
        raise UnsupportedError(f"{path}: compact RINEX is not read; expand it with crx2rnx")
    if not is_rinex_observations(line):
        raise InputFileError(path, "line 1", line, "the first line of RINEX observations")
    if not re.fullmatch(r" *[34]\.\d\d *", line[:9]):
        if re.fullmatch(r" *[12](\.\d*)? *", line[:9]):
            raise UnsupportedError(f"{path}: RINEX {line[:9].strip()} is not read, only 3 and 4")
        raise InputFileError(path, "line 1", line[:9], "RINEX version 3 or 4")
    return _Header(path=path, system=line[40:41])


def _time(path: Path, number: int, line: str, offset_s: int) -> GalileoTime:
    match = _EPOCH.match(line[:29].ljust(29))
    try:
        if match is None:
            raise ValueError(line)
        whole = GalileoTime.from_calendar(datetime(*map(int, match.groups()[:6])))  # type: ignore[arg-type]
        return GalileoTime.normalized(whole.week, whole.second + offset_s, float("0." + match[7]))
    except ValueError as error:
        raise InputFileError(path, f"line {number}", line[:29], "an epoch: > YYYY MM DD hh mm ss.fffffff") from error


def _epoch(
    path: Path,
    time: GalileoTime,
    records: list[tuple[int, str]],
    signals: dict[str, dict[str, int]],
    taken: dict[int, str],
) -> ObservationEpoch:
    """Return the epoch of records of observations.

    `taken` contains the previous signal of each satellite, and is updated.
    """
    observations: dict[int, E1Observation] = {}
    slipped = set()
    for number, line in records:
        if line[:1] == ">" or not line[:1].strip():
            raise InputFileError(path, f"line {number}", line, "the observations of a satellite")
        if line[0] != "E":
            continue
        svid = checked_svid(path, number, line[1:3])
        if svid in observations:
            raise InputFileError(path, f"line {number}", f"E{svid:02d} again", "each satellite once an epoch")
        for signal, columns in signals.items():
            values = {name: _value(path, number, line, column, name) for name, column in columns.items()}
            if math.isnan(values["pseudorange_m"]):
                continue
            observations[svid] = _observation(svid, values, SIGNALS[signal])
            phase = columns.get("carrier_phase_cycles")
            if (phase is not None and _lost_lock(path, number, line, phase)) or taken.get(svid, signal) != signal:
                slipped.add(svid)
            taken[svid] = signal
            break
    return ObservationEpoch(time=time, observations=observations, slipped=frozenset(slipped))


def _observation(svid: int, values: dict[str, float], cn0_offset_db: float) -> E1Observation:
    return E1Observation(
        svid=svid,
        pseudorange_m=values["pseudorange_m"],
        carrier_phase_cycles=values.get("carrier_phase_cycles", math.nan),
        doppler_hz=values.get("doppler_hz", math.nan),
        doppler_rate_hz_per_s=math.nan,
        cn0_dbhz=values.get("cn0_dbhz", math.nan) + cn0_offset_db,
    )


def _value(path: Path, number: int, line: str, column: int, name: str) -> float:
    text = line[column : column + 14]
    if not text.strip():
        return math.nan
    if len(text) != 14 or not _VALUE.fullmatch(text):
        raise InputFileError(path, f"line {number}: column {column + 1}", text, "a number with three decimals (F14.3)")
    value = checked(path, number, name, float(text))
    return math.nan if value == 0 else value


def _lost_lock(path: Path, number: int, line: str, column: int) -> bool:
    indicator = line[column + 14 : column + 15].strip() or "0"
    if indicator not in "01234567":
        raise InputFileError(
            path, f"line {number}: column {column + 15}", indicator, "a loss-of-lock indicator, 0 to 7"
        )
    return bool(int(indicator) & 1)
