"""Represent Galileo System Time (GST) with full precision.

A float64 time of week has steps of up to 0.12 ns, which is 3.5 cm of range. So an absolute time is never a single
float. An absolute time is a week, a whole second of the week and a fraction. The difference of two times in s is a
float.

GST started on 1999-08-22 00:00:00 GST = 1999-08-21 23:59:47 UTC [OS-ICD, 5.1.2]. Many receivers report UTC, so this
module has a table of the leap seconds since 1999.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from vestige.constants import SECONDS_PER_WEEK, SUBFRAME_S

GST_EPOCH = datetime(1999, 8, 22, tzinfo=UTC)  # start of GST [OS-ICD, 5.1.2]; `UTC` stands for GST in this `datetime`
LAST_YEAR = 9000  # latest year of an input; the calendar ends in 9999, and results may be later than the input
MAX_WEEK = 400_000  # largest week of a time, in the year 9665

# first UTC day on which an offset is valid, and offset GST − UTC in s [IERS Bulletin C]
LEAP_SECONDS = (
    (datetime(2017, 1, 1, tzinfo=UTC), 18),
    (datetime(2015, 7, 1, tzinfo=UTC), 17),
    (datetime(2012, 7, 1, tzinfo=UTC), 16),
    (datetime(2009, 1, 1, tzinfo=UTC), 15),
    (datetime(2006, 1, 1, tzinfo=UTC), 14),
    (datetime(1999, 1, 1, tzinfo=UTC), 13),
)

_ISO = re.compile(
    r"(?P<y>\d{4})-(?P<mo>\d{2})-(?P<d>\d{2})[T ](?P<h>\d{2}):(?P<mi>\d{2}):(?P<s>\d{2})(?P<f>\.\d+)?"
    r" ?(?P<scale>GST|UTC|Z)?"
)


@dataclass(frozen=True, slots=True, order=True)
class GalileoTime:
    """Point in Galileo System Time.

    Parameters
    ----------
    week
        Number of the Galileo week, not reduced modulo 4096, 0 to `MAX_WEEK`.
    second
        Whole second of the week, 0 to 604799.
    fraction
        Fraction of the second, [0, 1), in s.

    Raises
    ------
    ValueError
        If a number is outside its range; `normalized` accepts any `second` and `fraction`.

    Examples
    --------
    >>> import vestige as vs
    >>> time = vs.GalileoTime.parse("2026-11-21T12:00:00 GST")
    >>> time.week, time.second
    (1421, 561600)
    >>> print(time + 30.5)
    2026-11-21T12:00:30.500 GST
    >>> (time + 30.5) - time
    30.5
    """

    week: int
    second: int
    fraction: float = 0.0

    def __post_init__(self) -> None:
        if not (0 <= self.week <= MAX_WEEK and 0 <= self.second < SECONDS_PER_WEEK and 0.0 <= self.fraction < 1.0):
            raise ValueError(f"not a Galileo time: week {self.week}, second {self.second}, fraction {self.fraction}")

    @classmethod
    def normalized(cls, week: int, second: int, fraction: float = 0.0) -> GalileoTime:
        """Return the time for a second and a fraction that may be negative or larger than allowed."""
        whole = math.floor(fraction)
        fraction -= whole
        if fraction >= 1.0:  # a tiny negative fraction rounds up to 1.0
            whole, fraction = whole + 1, 0.0
        carry, second = divmod(second + whole, SECONDS_PER_WEEK)
        return cls(week + carry, second, fraction)

    def __add__(self, seconds: float) -> GalileoTime:
        """Return the time that is `seconds` later."""
        whole = math.floor(seconds)
        return GalileoTime.normalized(self.week, self.second + whole, self.fraction + (seconds - whole))

    def __sub__(self, other: GalileoTime) -> float:
        """Return the difference self - other in seconds."""
        whole = (self.week - other.week) * SECONDS_PER_WEEK + self.second - other.second
        return whole + (self.fraction - other.fraction)

    @property
    def subframe(self) -> GalileoTime:
        """Start of the 30 s I/NAV subframe that contains this time."""
        return GalileoTime(self.week, self.second - self.second % SUBFRAME_S)

    @property
    def gst_seconds(self) -> int:
        """Whole seconds since the GST epoch, week · 604800 + second."""
        return self.week * SECONDS_PER_WEEK + self.second

    @classmethod
    def from_gst_seconds(cls, seconds: int, fraction: float = 0.0) -> GalileoTime:
        """Return the time that is `seconds` whole seconds and a fraction of a second after the GST epoch."""
        return cls(*divmod(seconds, SECONDS_PER_WEEK), fraction)

    @classmethod
    def from_calendar(cls, moment: datetime) -> GalileoTime:
        """Return the time for a calendar date and time in GST; a time zone is ignored."""
        if moment.year > LAST_YEAR:
            raise ValueError(f"year {moment.year} is too late, expected {LAST_YEAR} at most")
        elapsed = moment.replace(tzinfo=UTC) - GST_EPOCH
        seconds = elapsed.days * 86_400 + elapsed.seconds
        if seconds < 0:
            raise ValueError(f"{moment:%Y-%m-%d} is before the start of Galileo time, 1999-08-22")
        return cls(*divmod(seconds, SECONDS_PER_WEEK), elapsed.microseconds * 1e-6)

    @classmethod
    def from_utc(cls, moment: datetime) -> GalileoTime:
        """Return the time for a UTC calendar date and time; a time zone is ignored."""
        moment = moment.replace(tzinfo=UTC)
        offset = next((leap for day, leap in LEAP_SECONDS if moment >= day), LEAP_SECONDS[-1][1])
        return cls.from_calendar(moment + timedelta(seconds=offset))

    @classmethod
    def parse(cls, text: str, *, default_scale: str = "GST") -> GalileoTime:
        """Return the time that a text describes: `2025-12-12T13:22:16.5 GST`, `… UTC`, `…Z`, or `WEEK:SECOND`.

        Parameters
        ----------
        text
            Text of the time. A calendar time without `GST`, `UTC` or `Z` is in `default_scale`. `WEEK:SECOND` is
            always in GST.
        default_scale
            Time scale of a calendar time without a time scale, `GST` or `UTC`.

        Raises
        ------
        ValueError
            If the text is not a time in a known form, or the time is outside the range of `GalileoTime`.
        """
        text = text.strip()
        if match := re.fullmatch(r"(\d{1,5}):(\d{1,6})(\.\d+)?", text):
            if int(match[2]) >= SECONDS_PER_WEEK:
                raise ValueError(f"second of week {match[2]} is not below {SECONDS_PER_WEEK}")
            return cls(int(match[1]), int(match[2]), float(match[3] or 0.0))
        match = _ISO.fullmatch(text)
        if match is None:
            raise ValueError(f"not a time: {text!r} (expected YYYY-MM-DDTHH:MM:SS[.f] GST or UTC, or WEEK:SECOND)")
        year, month, day, hour, minute, second = (int(match[key]) for key in ("y", "mo", "d", "h", "mi", "s"))
        moment = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
        make = cls.from_calendar if (match["scale"] or default_scale) == "GST" else cls.from_utc
        try:
            return make(moment) + float(match["f"] or 0.0)
        except OverflowError:
            raise ValueError(f"{text} is beyond the end of the calendar") from None

    @property
    def calendar(self) -> datetime:
        """Calendar date and time in GST, rounded down to the microsecond."""
        whole = timedelta(weeks=self.week, seconds=self.second, microseconds=int(self.fraction * 1e6))
        return GST_EPOCH + whole

    @property
    def utc(self) -> datetime:
        """Calendar date and time in UTC, rounded down to the microsecond."""
        moment = self.calendar
        for day, leap in LEAP_SECONDS:
            if moment - timedelta(seconds=leap) >= day:
                return moment - timedelta(seconds=leap)
        return moment - timedelta(seconds=LEAP_SECONDS[-1][1])

    def __str__(self) -> str:
        # The fraction is truncated, never rounded, because 59.9996 s must not print as 60.
        return f"{self.calendar:%Y-%m-%dT%H:%M:%S}.{int(self.fraction * 1000):03d} GST"
