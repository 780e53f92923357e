"""Describe the RECS that were sent outside the recording, and estimate the error of the start time.

A common mistake is a start that was read from a UTC clock, but is written without `UTC`. Such a start is taken as GST,
and is 18 s too early [IERS Bulletin C]. With such a start, the time window of a short recording can miss the right
RECS, although the folder has these RECS.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from vestige.constants import DAY_S
from vestige.time import GalileoTime

OTHER_TIMES = "no RECS for this time"  # beginning of the line for the user
_CLOCK_S = 1.0  # largest error in s of a start that was typed in whole seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class RecsOfOtherTimes:
    """RECS that were sent outside the time window of a recording.

    Attributes
    ----------
    n
        Number of RECS, at least 1.
    first, last
        Times of transmission of the first and of the last RECS.
    before
        Time of transmission of the last RECS before the window; None if there is no such RECS.
    after
        Time of transmission of the first RECS after the window; None if there is no such RECS.
    leap_s
        Probable error of the window in whole seconds. The value is GST − UTC if a window that is later by this time
        contains a RECS. Otherwise the value is −(GST − UTC) if a window that is earlier by this time contains a RECS.
        If no such window contains a RECS, the value is 0.
    """

    n: int
    first: GalileoTime
    last: GalileoTime
    before: GalileoTime | None
    after: GalileoTime | None
    leap_s: int

    @classmethod
    def of(cls, times: Iterable[GalileoTime], window: tuple[GalileoTime, GalileoTime]) -> RecsOfOtherTimes | None:
        """Return the RECS whose times of transmission lie outside a window, or None if all times lie in the window."""
        begin, end = window
        outside = [time for time in times if not begin <= time <= end]
        if not outside:
            return None
        leap_s = _gst_minus_utc_s(begin)
        shifts = [shift_s for shift_s in (leap_s, -leap_s) if any(_fits(time, window, shift_s) for time in outside)]
        return cls(
            n=len(outside),
            first=min(outside),
            last=max(outside),
            before=max((time for time in outside if time < begin), default=None),
            after=min((time for time in outside if time > end), default=None),
            leap_s=shifts[0] if shifts else 0,
        )

    def __or__(self, other: RecsOfOtherTimes) -> RecsOfOtherTimes:
        """Return the RECS of two files that lie outside the same window."""
        return RecsOfOtherTimes(
            n=self.n + other.n,
            first=min(self.first, other.first),
            last=max(self.last, other.last),
            before=max((time for time in (self.before, other.before) if time is not None), default=None),
            after=min((time for time in (self.after, other.after) if time is not None), default=None),
            leap_s=self.leap_s or other.leap_s,
        )

    def line(self, begin: GalileoTime, end: GalileoTime) -> str:
        """Return a line for the user about a recording from `begin` to `end`, for which there are no RECS.

        Examples
        --------
        >>> sent = GalileoTime.parse("2026-11-21T12:00:16")
        >>> begin = GalileoTime.parse("2026-11-21T11:00:00")
        >>> RecsOfOtherTimes.of([sent], (begin, begin + 1.0)).line(begin, begin + 1.0).split("; ")[1]
        'the nearest is 1.0 h after its end'
        """
        sent = f"sent at {self.first}" if self.first == self.last else f"sent from {self.first} to {self.last}"
        early_s = [] if self.before is None else [(begin - self.before, "before its start")]
        late_s = [] if self.after is None else [(self.after - end, "after its end")]
        distance_s, side = min(early_s + late_s)
        return (
            f"{OTHER_TIMES}: the assistance folder has {self.n}, {sent}, but the recording is from {begin} to "
            f"{end}; the nearest is {_duration(distance_s)} {side}; {self._advice}"
        )

    @property
    def _advice(self) -> str:
        behind = f"UTC is {abs(self.leap_s)} s behind GST"
        if self.leap_s > 0:
            return (
                f"perhaps the start is UTC and was taken as GST ({behind}): write UTC after the time, or give --start"
            )
        if self.leap_s < 0:
            return (
                f"perhaps the start is GST and was taken as UTC ({behind}): write GST after the time, or give --start"
            )
        return "correct the start of the recording (--start), or get the RECS of this time"


def _fits(time: GalileoTime, window: tuple[GalileoTime, GalileoTime], shift_s: float) -> bool:
    return time - window[0] >= shift_s - _CLOCK_S and time - window[1] <= shift_s + _CLOCK_S


def _gst_minus_utc_s(time: GalileoTime) -> int:
    return round((time.calendar - time.utc.replace(tzinfo=time.calendar.tzinfo)).total_seconds())


def _duration(seconds: float) -> str:
    for unit_s, unit in ((DAY_S, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= (2 * unit_s if unit == "days" else unit_s):
            return f"{seconds / unit_s:.1f} {unit}"
    return f"{seconds:.1f} s"
