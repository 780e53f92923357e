"""Read and write RINEX navigation files of versions 3 and 4 with Galileo broadcast ephemerides [RINEX].

A Galileo record has eight lines. The first line has the satellite, the time of clock (toc) and the clock polynomial.
The other lines have up to four numbers each. Records of other systems are skipped. Records of F/NAV are also skipped,
because the clock of F/NAV belongs to the pair (E1, E5a). In version 4 a line before each record names the kind of the
record.

The files count Galileo weeks from the GPS epoch, so a week number is 1024 larger than in Galileo System Time. Near the
end of a week some writers give the week of transmission in place of the week of toe (time of ephemeris). So the reader
chooses the week that puts toe nearest to toc.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime
from pathlib import Path

from vestige.constants import SECONDS_PER_WEEK
from vestige.errors import InputFileError, UnsupportedError
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.ionosphere import BroadcastIonosphere
from vestige.recording.observations.observation_epoch import checked_svid
from vestige.recording.text_lines import numbered_lines
from vestige.time import GalileoTime

WEEK_OFFSET = 1024  # RINEX week minus Galileo week [RINEX]
_LINES = 8
_WIDTH = 19
_E1B_INAV, _CLOCK_E5B_E1 = 1 << 0, 1 << 9  # bits of "data sources" [RINEX]
_ANY_INAV, _ANY_SOURCE = 0b101, 0b111
_SMALLEST = 1e-99  # smallest number whose exponent has two digits
_UNKNOWN_TIME = 0.9999e9  # number that marks an unknown transmission time [RINEX]

# field -> (line, position in the line from 0, smallest value, largest value) [RINEX]; other values are invalid
_PLACES: Mapping[str, tuple[int, int, float, float]] = {
    "af0_s": (0, 1, -1.0, 1.0),
    "af1": (0, 2, -1e-6, 1e-6),
    "af2_per_s": (0, 3, -1e-12, 1e-12),
    "crs_m": (1, 1, -2000.0, 2000.0),
    "delta_n_radps": (1, 2, -1e-7, 1e-7),
    "m0_rad": (1, 3, -7.0, 7.0),
    "cuc_rad": (2, 0, -1e-3, 1e-3),
    "eccentricity": (2, 1, 0.0, 0.5),
    "cus_rad": (2, 2, -1e-3, 1e-3),
    "sqrt_a": (2, 3, 4000.0, 8192.0),
    "cic_rad": (3, 1, -1e-3, 1e-3),
    "omega0_rad": (3, 2, -7.0, 7.0),
    "cis_rad": (3, 3, -1e-3, 1e-3),
    "i0_rad": (4, 0, -7.0, 7.0),
    "crc_m": (4, 1, -2000.0, 2000.0),
    "omega_rad": (4, 2, -7.0, 7.0),
    "omega_dot_radps": (4, 3, -1e-6, 1e-6),
    "i_dot_radps": (5, 0, -1e-6, 1e-6),
    "bgd_e1_e5a_s": (6, 2, -2e-7, 2e-7),
    "bgd_e1_e5b_s": (6, 3, -2e-7, 2e-7),
}
_IOD, _TOE, _SOURCES, _WEEK, _SISA, _HEALTH = (1, 0), (3, 0), (5, 1), (5, 2), (6, 0), (6, 1)

_NUMBER = re.compile(r" *[+-]?(\d+\.?\d*|\.\d+)([DEde][+-]?\d{1,3})? *", re.ASCII)
_CLOCK_TIME = re.compile(r"E[ \d]\d (\d{4}) ([ \d]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d)", re.ASCII)
_KIND = re.compile(r"> EPH E[ \d]\d INAV *", re.ASCII)

_Lines = list[tuple[int, str]]


def is_rinex_navigation(first_line: str) -> bool:
    """Return whether the first line of a file marks RINEX navigation data, of any version."""
    return first_line[60:80].strip() == "RINEX VERSION / TYPE" and first_line[20:21] == "N"


def read_rinex_navigation(path: Path) -> tuple[Ephemeris, ...]:
    """Return the Galileo I/NAV ephemerides in the order of the file, without repeated issues of a satellite.

    The function raises `InputFileError` if the file has another format, is cut off, has an impossible number, or no
    Galileo I/NAV ephemeris. The function raises `UnsupportedError` for RINEX 1 and 2.
    """
    return parse_rinex_navigation(path, numbered_lines(path))


def parse_rinex_navigation(path: Path, lines: Iterator[tuple[int, str]]) -> tuple[Ephemeris, ...]:
    """Return the ephemerides in numbered lines from any source.

    Error messages name `path` as the source of the lines.
    """
    found: dict[tuple[int, int, GalileoTime], Ephemeris] = {}
    for record in _records(path, lines):
        ephemeris = _ephemeris(path, record)
        if ephemeris is not None:
            found.setdefault((ephemeris.svid, ephemeris.iod_nav, ephemeris.toe), ephemeris)
    if not found:
        raise InputFileError(path, "file", "none", "Galileo I/NAV ephemerides")
    return tuple(found.values())


def _records(path: Path, lines: Iterator[tuple[int, str]]) -> Iterator[_Lines]:
    """Yield the lines of each Galileo record that may be I/NAV."""
    version = _read_header(path, lines)
    record: _Lines = []
    wanted = version == 3
    for number, line in lines:
        if line.startswith(">") and version == 4:
            yield from _complete(path, record)
            record, wanted = [], _KIND.fullmatch(line) is not None
        elif line[:1].strip():
            yield from _complete(path, record)
            record = [(number, line)] if wanted and line[0] == "E" else []
        elif record:
            record.append((number, line))
    yield from _complete(path, record)


def _complete(path: Path, record: _Lines) -> Iterator[_Lines]:
    while record and not record[-1][1].strip():
        record = record[:-1]
    if not record:
        return
    if len(record) != _LINES:
        raise InputFileError(
            path, f"line {record[0][0]}", f"{len(record)} lines", f"{_LINES} lines of a Galileo record"
        )
    yield record


def _read_header(path: Path, lines: Iterator[tuple[int, str]]) -> int:
    """Return the major version of the RINEX format, and read the lines of the header."""
    _, line = next(lines, (1, ""))
    if not is_rinex_navigation(line):
        raise InputFileError(path, "line 1", line, "the first line of RINEX navigation data")
    version = re.fullmatch(r" *(\d)\.\d* *", line[:9], re.ASCII)
    if version is None or version[1] not in "1234":
        raise InputFileError(path, "line 1", line[:9], "RINEX version 3 or 4")
    if version[1] in "12":
        raise UnsupportedError(f"{path}: RINEX {line[:9].strip()} is not read, only 3 and 4")
    number = 1
    for number, line in lines:  # noqa: B007  (the last `number` is the place of the error)
        if line[60:80].strip() == "END OF HEADER":
            return int(version[1])
    raise InputFileError(path, f"line {number}", "the end of the file", "END OF HEADER")


def _ephemeris(path: Path, record: _Lines) -> Ephemeris | None:
    """Return the ephemeris of a record, or None if the record is F/NAV."""
    sources = _integer(path, record, _SOURCES, "data sources", 1, (1 << 10) - 1)
    if not sources & _ANY_SOURCE:
        raise InputFileError(path, f"line {record[5][0]}: data sources", sources, "a bit that says I/NAV or F/NAV")
    if not sources & _ANY_INAV:
        return None
    number, first = record[0]
    health = _integer(path, record, _HEALTH, "health", 0, (1 << 9) - 1)
    sisa_m = _number(path, record, _SISA, "SISA", -1.0, 1e5)
    toc = _time_of_clock(path, number, first)
    return Ephemeris(
        svid=checked_svid(path, number, first[1:3]),
        iod_nav=_integer(path, record, _IOD, "IODnav", 0, 1023),
        toe=_time_of_ephemeris(path, record, toc),
        toc=toc,
        sisa_m=math.nan if sisa_m < 0 else sisa_m,
        e1b_health=health >> 1 & 0b11,
        e1b_data_valid=not health & 1,
        **{
            name: _number(path, record, (line, column), name, low, high)
            for name, (line, column, low, high) in _PLACES.items()
        },
    )


def _time_of_clock(path: Path, number: int, line: str) -> GalileoTime:
    match = _CLOCK_TIME.match(line)
    try:
        if match is None:
            raise ValueError(line)
        return GalileoTime.from_calendar(datetime(*map(int, match.groups())))  # type: ignore[arg-type]
    except ValueError as error:
        raise InputFileError(
            path, f"line {number}", line[:23], "a satellite and time: Enn YYYY MM DD hh mm ss"
        ) from error


def _time_of_ephemeris(path: Path, record: _Lines, toc: GalileoTime) -> GalileoTime:
    second = _integer(path, record, _TOE, "toe", 0, SECONDS_PER_WEEK)
    week = _integer(path, record, _WEEK, "week", WEEK_OFFSET, 9999) - WEEK_OFFSET
    half = SECONDS_PER_WEEK // 2
    toe = GalileoTime.from_gst_seconds(max(0, toc.gst_seconds + (second - toc.second + half) % SECONDS_PER_WEEK - half))
    if abs(toe.week - week) > 1:
        expected = f"about {toe.week + WEEK_OFFSET}, the week of the time of clock"
        raise InputFileError(path, f"line {record[5][0]}: week", week + WEEK_OFFSET, expected)
    return toe


def _number(path: Path, record: _Lines, place: tuple[int, int], name: str, low: float, high: float) -> float:
    number, line = record[place[0]]
    start = 4 + _WIDTH * place[1]
    text = line[start : start + _WIDTH]
    if _NUMBER.fullmatch(text) is None:
        raise InputFileError(path, f"line {number}: column {start + 1}", text, f"{name}, a number (D19.12)")
    value = float(text.upper().replace("D", "E"))
    if not low <= value <= high:
        raise InputFileError(path, f"line {number}: {name}", value, f"a number from {low:g} to {high:g}")
    return value


def _integer(path: Path, record: _Lines, place: tuple[int, int], name: str, low: int, high: int) -> int:
    value = _number(path, record, place, name, low, high)
    if value != int(value):
        raise InputFileError(path, f"line {record[place[0]][0]}: {name}", value, "a whole number")
    return int(value)


def write_rinex_navigation(
    path: Path, ephemerides: Iterable[Ephemeris], *, ionosphere: BroadcastIonosphere | None = None
) -> None:
    """Write ephemerides as a RINEX 3.05 navigation file.

    Numbers keep 13 digits, so the rounding moves an orbit by about 0.1 mm at most.

    The function raises `ValueError` if there is no ephemeris, or toe or toc is not a whole second.

    Parameters
    ----------
    path
        The file to write.
    ephemerides
        Ephemerides to write, at least one.
    ionosphere
        Coefficients of the ionosphere for the header, which keeps five digits; None for a header without ionosphere.
    """
    path.write_text(rinex_navigation_text(ephemerides, ionosphere=ionosphere), encoding="ascii", newline="\n")


def rinex_navigation_text(ephemerides: Iterable[Ephemeris], *, ionosphere: BroadcastIonosphere | None = None) -> str:
    """Return the text that `write_rinex_navigation` writes.

    The function raises `ValueError` for the same reasons as `write_rinex_navigation`.
    """
    records = [line for ephemeris in ephemerides for line in _written(ephemeris)]
    if not records:
        raise ValueError("a navigation file needs an ephemeris")
    header = [
        (f"{'3.05':>9}{'':11}{'N: GNSS NAV DATA':20}{'E: Galileo':20}", "RINEX VERSION / TYPE"),
        (f"{'vestige':20}", "PGM / RUN BY / DATE"),
        *([] if ionosphere is None else [(_coefficients(ionosphere), "IONOSPHERIC CORR")]),
        ("", "END OF HEADER"),
    ]
    lines = [f"{content:60}{label:20}".rstrip() for content, label in header] + records
    return "".join(line + "\n" for line in lines)


def _coefficients(ionosphere: BroadcastIonosphere) -> str:
    """Return the coefficients as a line of the header in the format A4, 1X, 4D12.4 [RINEX]."""
    values = ionosphere.ai0_sfu, ionosphere.ai1_sfu_per_deg, ionosphere.ai2_sfu_per_deg2, 0.0
    return "GAL  " + "".join(f"{value:12.4E}" for value in values)


def _written(ephemeris: Ephemeris) -> list[str]:
    if ephemeris.toe.fraction or ephemeris.toc.fraction:
        raise ValueError("toe and toc are whole seconds")
    table = [[0.0] * 4 for _ in range(_LINES)]
    for name, (line, column, _, _) in _PLACES.items():
        value = getattr(ephemeris, name)
        table[line][column] = value if abs(value) > _SMALLEST else 0.0
    health = ephemeris.e1b_health << 1 | (not ephemeris.e1b_data_valid)
    others: list[tuple[tuple[int, int], float]] = [
        (_IOD, ephemeris.iod_nav),
        (_TOE, ephemeris.toe.second),
        (_SOURCES, _E1B_INAV | _CLOCK_E5B_E1),
        (_WEEK, ephemeris.toe.week + WEEK_OFFSET),
        (_SISA, -1.0 if math.isnan(ephemeris.sisa_m) else ephemeris.sisa_m),
        (_HEALTH, health),
        ((7, 0), _UNKNOWN_TIME),
    ]
    for (line, column), value in others:
        table[line][column] = float(value)
    first = f"E{ephemeris.svid:02d} {ephemeris.toc.calendar:%Y %m %d %H %M %S}"
    columns = {5: 3, 7: 1}
    rows = [first + "".join(f"{value:19.12E}" for value in table[0][1:])]
    for line in range(1, _LINES):
        rows.append(" " * 4 + "".join(f"{value:19.12E}" for value in table[line][: columns.get(line, 4)]))
    return rows
