"""Parse and format the names of RECS files, with their fields and their time code [SASLIB].

| file | pattern | example |
|---|---|---|
| unitary | `XXXXII_YYDDDHHMMSSS_ss_K_R_VV.RCS` | `GSCX01_251551107160_14_0_0_01.RCS` |
| aggregated | `II_YYDDDHHMMSSS_tdur_rtba_ss_K_R_N_VV.bin` | `01_253540000000_000600_00300_14_0_0_3_01.bin` |

XXXX is the provider, II the interface version, ss the SVID, K the KDI, R RAND, N NChip, and VV the file version. The
duration of the file is tdur, and the time between two RECS is rtba. YYDDDHHMMSSS is the start in the GST calendar:
year, day of year, hour, minute, *deciseconds* of the minute. An aggregated name has tdur in whole *seconds* and
rtba in *deciseconds*. The header of an aggregated file has tdur and rtba in deciseconds.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from vestige.constants import SECONDS_PER_WEEK
from vestige.errors import InputFileError
from vestige.time import GalileoTime

DECISECONDS_PER_WEEK = 10 * SECONDS_PER_WEEK

_UNITARY = re.compile(
    r"(?P<provider>[A-Z0-9]{4})(?P<interface_version>\d{2,3})_(?P<start>\d{12})_(?P<svid>\d{2,3})"
    r"_(?P<key_delay>\d)_(?P<random_offset>\d)_(?P<file_version>\d{2,3})\.RCS",
    re.ASCII | re.IGNORECASE,
)
_AGGREGATED = re.compile(
    r"(?P<interface_version>\d{2,3})_(?P<start>\d{12})_(?P<duration_s>\d{6,7})_(?P<period_ds>\d{5})_(?P<svid>\d{2,3})"
    r"_(?P<key_delay>\d)_(?P<random_offset>\d)_(?P<n_chip_code>\d)_(?P<file_version>\d{2,3})\.bin",
    re.ASCII | re.IGNORECASE,
)
_TIME_CODE = re.compile(r"(\d{2})(\d{3})(\d{2})(\d{2})(\d{3})", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecsName:
    """Fields of the name of a RECS file."""

    start: GalileoTime  # time of transmission of the first RECS, a whole number of deciseconds
    svid: int
    key_delay: int
    random_offset: int
    provider: str = ""  # four characters in unitary names; empty for an aggregated file
    duration_s: int = 0  # tDur in s, only in aggregated names
    period_ds: int = 0  # RTBA in ds, only in aggregated names
    n_chip_code: int = 0  # NChip, only in aggregated names
    interface_version: int = 1
    file_version: int = 1

    def __str__(self) -> str:
        start = format_time_code(self.start)
        if self.provider:
            return (
                f"{self.provider}{self.interface_version:02d}_{start}_{self.svid:02d}"
                f"_{self.key_delay}_{self.random_offset}_{self.file_version:02d}.RCS"
            )
        return (
            f"{self.interface_version:02d}_{start}_{self.duration_s:06d}_{self.period_ds:05d}_{self.svid:02d}"
            f"_{self.key_delay}_{self.random_offset}_{self.n_chip_code}_{self.file_version:02d}.bin"
        )


def parse_name(name: str) -> RecsName | None:
    """Return the fields of the file name; None if the name does not have the form of a RECS name (a renamed file).

    The function raises `InputFileError` if the name has the form of a RECS name, but its start is not a date and time
    since 1999-08-22.
    """
    match = _UNITARY.fullmatch(name) or _AGGREGATED.fullmatch(name)
    if match is None:
        return None
    fields = match.groupdict()
    start, provider = fields.pop("start"), fields.pop("provider", "")
    try:
        time = parse_time_code(start)
    except ValueError as error:
        raise InputFileError(
            name, "file name: start", start, "YYDDDHHMMSSS, a date and time since 1999-08-22"
        ) from error
    return RecsName(start=time, provider=provider, **{field: int(value) for field, value in fields.items()})


def format_time_code(time: GalileoTime) -> str:
    """Return `YYDDDHHMMSSS` of a time: year, day of year, hour, minute, deciseconds of the minute, in GST."""
    exact = time_of_deciseconds(
        time.week, deciseconds_of_week(time)
    )  # a float fraction may be slightly below a whole decisecond
    moment = exact.calendar
    return f"{moment:%y%j%H%M}{10 * moment.second + round(10 * exact.fraction):03d}"


def parse_time_code(text: str) -> GalileoTime:
    """Return the time of `YYDDDHHMMSSS`; year 99 is 1999, and years 00 to 98 are 2000 to 2098.

    The function raises `ValueError` if `text` does not have 12 digits, or is not a date and time since 1999-08-22.
    """
    match = _TIME_CODE.fullmatch(text)
    if match is None:
        raise ValueError(f"not a time code YYDDDHHMMSSS: {text!r}")
    year, day, hour, minute, deciseconds = (int(group) for group in match.groups())
    midnight = datetime(1999 if year == 99 else 2000 + year, 1, 1, tzinfo=UTC)
    moment = midnight + timedelta(days=day - 1)
    if moment.year != midnight.year or hour > 23 or minute > 59 or deciseconds > 599:
        raise ValueError(f"no such date or time: {text!r}")
    whole = GalileoTime.from_calendar(moment + timedelta(hours=hour, minutes=minute))
    return time_of_deciseconds(whole.week, 10 * whole.second + deciseconds)


def deciseconds_of_week(time: GalileoTime) -> int:
    """Return the time of week in deciseconds, the unit of RECS files, 0 to 6,048,000.

    A time less than 1 ns before the end of a week gives 6,048,000.

    The function raises `ValueError` if the time is not a whole number of deciseconds (to 1 ns).
    """
    tenths = round(10 * time.fraction)
    if abs(time.fraction - tenths / 10) > 1e-9:
        raise ValueError(f"{time} (fraction {time.fraction!r} s) is not a whole number of deciseconds")
    return 10 * time.second + tenths


def time_of_deciseconds(week: int, deciseconds: int) -> GalileoTime:
    """Return the time that is `deciseconds` after the start of `week`; the time may be in a later week."""
    carry, deciseconds = divmod(deciseconds, DECISECONDS_PER_WEEK)
    return GalileoTime(week + carry, deciseconds // 10, deciseconds % 10 / 10)
