"""Make the navigation message of all satellites of a sky: I/NAV words with OSNMA, and the symbols of E1-B.

In each subframe the operator of OSNMA authenticates the words of earlier subframes, from all satellites. Pages are made
when they are needed, and a message keeps only a few pages. The bits of a page do not depend on the first and the last
subframe of the message.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Int8, Int64

from vestige.broadcast.inav_transmission import InavTransmission, OsnmaSource
from vestige.broadcast.osnma_fields import OsnmaFields, page_starts
from vestige.broadcast.satellite_words import EphemerisIssue, SatelliteWords, SystemData
from vestige.constants import PAGES_A_SUBFRAME, SUBFRAME_S, SYMBOLS_PER_S
from vestige.crypto.osnma.operator.osnma_operator import OsnmaOperator
from vestige.crypto.osnma.operator.tag_plan import SUBFRAMES_REMEMBERED
from vestige.errors import VestigeError
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.almanac_words import almanac_sets
from vestige.navigation.inav.ephemeris_words import as_broadcast
from vestige.navigation.inav.ionosphere import NO_IONOSPHERE, BroadcastIonosphere
from vestige.navigation.inav.page import FIRST_PAGE_OFFSET_S, OSNMA_BYTES, PAGE_S, InavPage
from vestige.navigation.inav.timing_words import UtcModel
from vestige.navigation.reissue import referred_to
from vestige.streams import stream_key
from vestige.time import GalileoTime

_ISSUE_S = 600  # time between two issues in s: ten minutes, as on air
_ISSUES = 128  # number of IODnav values: IODnav is toe in steps of ten minutes, modulo 128, as on air
Symbols = Callable[[Int64[np.ndarray, " n"]], Int8[np.ndarray, " n"]]
_SYMBOLS_A_PAGE = PAGE_S * SYMBOLS_PER_S
_PAGES_KEPT = 16  # number of pages of a satellite that are kept, enough for the workers and for a delayed signal
_FORGED_CLOCK_S = 2.0**-20  # clock offset of 286 m, a multiple of the resolution of word 4


def ephemeris_issues(ephemeris: Ephemeris, start: GalileoTime, end: GalileoTime) -> Iterator[EphemerisIssue]:
    """Yield the issues of a satellite from `start` to `end`, with the same orbit and consecutive values of IODnav.

    Parameters
    ----------
    ephemeris
        Orbit and clock, which all issues share to within the rounding of their fields.
    start, end
        First and last time at which the satellite must have an issue to send.
    """
    first = start + -(start.gst_seconds % _ISSUE_S + start.fraction)
    for number in range(int((end - first) // _ISSUE_S) + 1):
        toe = first + float(number * _ISSUE_S)
        moved = replace(referred_to(ephemeris, toe), iod_nav=toe.gst_seconds // _ISSUE_S % _ISSUES)
        yield EphemerisIssue(start=toe, ephemeris=as_broadcast(moved))


@dataclass(frozen=True, kw_only=True)
class SkyMessage:
    """E1-B messages of the satellites of a sky, over whole subframes.

    Attributes
    ----------
    transmissions
        Transmissions of the satellites, by SVID; a transmission makes the pages of its satellite.
    first
        Start of the first subframe.
    n_subframes
        Number of subframes.
    """

    transmissions: Mapping[int, InavTransmission]
    first: GalileoTime
    n_subframes: int

    @property
    def pages(self) -> dict[int, tuple[InavPage, ...]]:
        """All pages of each satellite by SVID, in the order of time. Each access makes the pages again."""
        subframes = list(self.subframes())
        return {svid: tuple(page for pages in subframes for page in pages[svid]) for svid in self.transmissions}

    def subframes(self) -> Iterator[dict[int, tuple[InavPage, ...]]]:
        """Yield the pages of each subframe by SVID, in the order of time."""
        for number in range(self.n_subframes):
            starts = page_starts(self.first + float(SUBFRAME_S * number))
            yield {svid: tuple(one.page(time) for time in starts) for svid, one in self.transmissions.items()}

    def symbols(self, svid: int, reference: GalileoTime) -> Symbols:
        """Return a function that gives the symbols of a satellite as ±1 by their number; logic 0 is +1.

        The returned function raises `VestigeError` for a symbol that is not in the message.

        Parameters
        ----------
        svid
            SVID of the satellite.
        reference
            Whole second at which symbol 0 begins.
        """
        transmission, n_pages = self.transmissions[svid], self.n_subframes * PAGES_A_SUBFRAME
        first = self.first + float(FIRST_PAGE_OFFSET_S)
        before = (reference.gst_seconds - first.gst_seconds) * SYMBOLS_PER_S

        @lru_cache(maxsize=_PAGES_KEPT)
        def page(number: int) -> Int8[np.ndarray, " 500"]:
            start = first + float(PAGE_S * number)
            if not 0 <= number < n_pages:
                raise VestigeError(
                    f"E{svid:02d}: found a symbol of {start}, expected one of the message, from {first} to "
                    f"{first + float(PAGE_S * n_pages)}"
                )
            return np.int8(1) - np.int8(2) * transmission.symbols(start).astype(np.int8)

        def symbol(index: Int64[np.ndarray, " n"]) -> Int8[np.ndarray, " n"]:
            number, place = np.divmod(index + before, _SYMBOLS_A_PAGE)
            values = np.empty(index.size, np.int8)
            for one in np.unique(number):
                here = number == one
                values[here] = page(int(one))[place[here]]
            return values

        return symbol

    def forged(self, seed: int) -> SkyMessage:
        """Return the message of an attacker, with the attacker's words, and with tags and keys that are not valid.

        In the ephemeris words, the FEC2 words and the reduced CED, the offset af0 of every satellite clock is 2⁻²⁰ s
        too large (0.95 µs, 286 m). The almanac is not changed. The attacker repeats the public HKROOT bytes. The
        attacker cannot know the keys, so the MACK bits are random.

        Parameters
        ----------
        seed
            Seed of the MACK bits.
        """
        return replace(
            self,
            transmissions={
                svid: replace(one, words=_with_later_clock(one.words), osnma=_invented_mack(one.osnma, seed))
                for svid, one in self.transmissions.items()
            },
        )


def _with_later_clock(words: SatelliteWords) -> SatelliteWords:
    issues = [
        replace(one, ephemeris=replace(one.ephemeris, af0_s=one.ephemeris.af0_s + _FORGED_CLOCK_S))
        for one in words.issues
    ]
    return SatelliteWords(issues, words.system, fec2=words.fec2)


def _invented_mack(true: OsnmaSource, seed: int) -> OsnmaSource:
    """Return a source of fields that have the HKROOT byte of the true field and four random bytes."""

    def field(svid: int, start: GalileoTime) -> bytes:
        key = stream_key(seed, "MACK that an attacker invents", svid, start.gst_seconds)
        return true(svid, start)[:1] + key[: OSNMA_BYTES - 1]

    return field


def make_sky_message(
    ephemerides: Iterable[Ephemeris],
    operator: OsnmaOperator,
    end: GalileoTime,
    *,
    first: GalileoTime | None = None,
    almanac: Iterable[Ephemeris] = (),
    ionosphere: BroadcastIonosphere = NO_IONOSPHERE,
) -> SkyMessage:
    """Return the navigation message of the satellites of a sky.

    Parameters
    ----------
    ephemerides
        One ephemeris of each satellite that sends.
    operator
        Operator that makes the OSNMA fields; nothing else may use this operator.
    end
        Time up to which the message must last.
    first
        Time in the first subframe of the message; None for the operator's first subframe. Pages have the same bits for
        any `first`.
    almanac
        One ephemeris of each satellite of the constellation, for words 7 to 10. Without any ephemeris, word 0 is sent
        instead of words 7 to 10.
    ionosphere
        Ionosphere model, sent in word 5.

    Raises
    ------
    VestigeError
        If an ephemeris does not fit into its words; the text of the error names the satellite. The
        returned message also raises this error when it makes a page for a time at which the operator does not
        broadcast.
    """
    start = operator.configuration.start
    begin = start if first is None else max(first.subframe, start)
    remembered = max(begin + -float(SUBFRAME_S * SUBFRAMES_REMEMBERED), start)
    system = SystemData(
        utc=UtcModel.at(start),
        ionosphere=ionosphere,
        almanac=almanac_sets(tuple(almanac), start + -float(start.gst_seconds % _ISSUE_S)),
    )
    words = {one.svid: SatelliteWords(tuple(ephemeris_issues(one, remembered, end)), system) for one in ephemerides}
    fields = OsnmaFields(operator=operator, words=words)
    return SkyMessage(
        transmissions={svid: InavTransmission(words=one, osnma=fields) for svid, one in words.items()},
        first=begin,
        n_subframes=int((end - begin) // SUBFRAME_S) + 1,
    )
