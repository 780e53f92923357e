"""Make the navigation words of one satellite over time, with the issues of its ephemeris.

A new issue of data starts with a subframe, so words 1 to 4 and the FEC2 words of a subframe have the same IODnav.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

from vestige.constants import SUBFRAME_S
from vestige.errors import VestigeError
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.almanac_words import ALMANAC_WORDS, AlmanacSet
from vestige.navigation.inav.coding.fec2 import parity_words
from vestige.navigation.inav.ephemeris_words import STATUS_WORD, ephemeris_words, status_word
from vestige.navigation.inav.ionosphere import NO_IONOSPHERE, BroadcastIonosphere
from vestige.navigation.inav.reduced_ced import REDUCED_CED_WORD, ReducedCed
from vestige.navigation.inav.schedule import scheduled_word
from vestige.navigation.inav.timing_words import UTC_WORD, UtcModel, time_word
from vestige.time import GalileoTime

_MINUTE_S = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class EphemerisIssue:
    """Ephemeris of a satellite, and the time of its issue.

    Attributes
    ----------
    start
        Time of issue. The ephemeris is sent from the first subframe that starts at this time or later, until the next
        issue.
    ephemeris
        The ephemeris that is sent.
    """

    start: GalileoTime
    ephemeris: Ephemeris

    @property
    def first_subframe(self) -> GalileoTime:
        """Start of the first subframe that carries the ephemeris."""
        past = self.start - self.start.subframe
        return self.start.subframe + (SUBFRAME_S if past else 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SystemData:
    """Data that all satellites send with the same content: UTC conversion, ionosphere model and almanac.

    Attributes
    ----------
    utc
        Conversion to UTC, sent in word 6.
    ionosphere
        Ionosphere model, sent in word 5.
    almanac
        Sets of words 7 to 10. Each satellite sends one set a minute, in turn. Without any set, word 0 is sent instead
        of words 7 to 10.
    """

    utc: UtcModel
    ionosphere: BroadcastIonosphere = NO_IONOSPHERE
    almanac: tuple[AlmanacSet, ...] = ()


class SatelliteWords:
    """Navigation words of one satellite.

    Parameters
    ----------
    issues
        Ephemerides of the satellite with their times of issue, in any order; successive issues have different IODnav.
    system
        Data that all satellites send with the same content.
    fec2
        Whether the satellite sends FEC2 and reduced CED.

    Raises
    ------
    VestigeError
        If there is no ephemeris, a value does not fit into its word, or two successive issues have the same IODnav. In
        the last two cases the text of the error names the satellite.
    ValueError
        If the ephemerides belong to several satellites.
    """

    def __init__(self, issues: Iterable[EphemerisIssue], system: SystemData, *, fec2: bool = True) -> None:
        ordered = sorted(issues, key=lambda one: one.first_subframe)
        if not ordered:
            raise VestigeError("a satellite without an ephemeris cannot send navigation words")
        if len({one.ephemeris.svid for one in ordered}) > 1:
            raise ValueError("ephemerides of several satellites were given for a single satellite")
        self.svid = ordered[0].ephemeris.svid
        self.fec2 = fec2
        self._system = system
        self._issues = ordered
        self._starts = [one.first_subframe for one in ordered]
        self._words = [ephemeris_words(one.ephemeris) for one in ordered]
        for earlier, later in pairwise(ordered):
            if later.ephemeris.iod_nav == earlier.ephemeris.iod_nav:
                raise VestigeError(
                    f"E{self.svid:02}: the ephemeris issued at {later.start} has the IODnav "
                    f"{later.ephemeris.iod_nav} of the previous issue; receivers would mix the words of both"
                )
        if fec2:
            self._words = [{**words, **parity_words(words)} for words in self._words]
        self._almanac = [one.words() for one in system.almanac]
        self._reduced: tuple[GalileoTime, ReducedCed | None] | None = None

    @property
    def system(self) -> SystemData:
        """Data that all satellites send with the same content."""
        return self._system

    @property
    def issues(self) -> tuple[EphemerisIssue, ...]:
        """Ephemerides of the satellite in the order of their issue."""
        return tuple(self._issues)

    def ephemeris(self, time: GalileoTime) -> Ephemeris:
        """Return the ephemeris that is sent in the subframe of a time.

        Parameters
        ----------
        time
            Any time in the subframe.

        Raises
        ------
        VestigeError
            If no ephemeris is issued up to this subframe; the message names the satellite.
        """
        return self._issues[self._number(time)].ephemeris

    def word(self, start: GalileoTime) -> int:
        """Return the word in the page that starts at a time.

        Parameters
        ----------
        start
            Start of the page, an odd whole second.

        Returns
        -------
        int
            Word of 128 bits; the first bit of the word is the most significant bit.

        Raises
        ------
        VestigeError
            If no ephemeris is issued up to this page; the message names the satellite.
        ValueError
            If no page starts at the given time.
        """
        kind = scheduled_word(start, fec2=self.fec2)
        number = self._number(start)
        if kind in self._words[number]:
            return self._words[number][kind]
        if kind == REDUCED_CED_WORD:
            reduced = self._reduced_ced(start)
            if reduced is not None:
                return reduced.word
            kind = scheduled_word(start, fec2=self.fec2, reduced_ced=False)
        if kind == STATUS_WORD:
            return status_word(self._issues[number].ephemeris, start, self._system.ionosphere)
        if kind == UTC_WORD:
            return self._system.utc.word(start)
        if kind in ALMANAC_WORDS and self._almanac:
            return self._almanac[start.gst_seconds // _MINUTE_S % len(self._almanac)][kind]
        return time_word(start)

    def _number(self, time: GalileoTime) -> int:
        number = bisect_right(self._starts, time) - 1  # each issue starts with a subframe
        if number < 0:
            raise VestigeError(
                f"E{self.svid:02}: no ephemeris was issued before {time}; the first is of {self._starts[0]}"
            )
        return number

    def _reduced_ced(self, start: GalileoTime) -> ReducedCed | None:
        """Return the reduced CED of a subframe, fitted once for its pages; None if the orbit or clock does not fit."""
        subframe, known = start.subframe, self._reduced  # the attribute is read once, because threads share the words
        if known is None or known[0] != subframe:
            known = self._reduced = subframe, _fitted(self.ephemeris(start), subframe)
        return known[1]


@lru_cache(maxsize=1024)
def _fitted(ephemeris: Ephemeris, subframe: GalileoTime) -> ReducedCed | None:
    """Return the reduced CED of a subframe, cached for all messages; None if the orbit or clock does not fit."""
    return ReducedCed.from_ephemeris(ephemeris, subframe)
