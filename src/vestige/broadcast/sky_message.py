"""The navigation message of all satellites of a sky: I/NAV words with OSNMA in them, and the symbols of E1-B.

In each subframe the operator of OSNMA authenticates the words of earlier subframes, from all satellites. So a message
is made once, in the order of time, from the operator's first subframe on. Afterwards any part can be read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Int8, Int64

from vestige.broadcast.inav_transmission import InavTransmission
from vestige.broadcast.satellite_words import EphemerisIssue, SatelliteWords, SystemData
from vestige.constants import PAGES_A_SUBFRAME, SUBFRAME_S, SYMBOLS_PER_S
from vestige.crypto.osnma.operator.osnma_operator import OsnmaOperator
from vestige.errors import VestigeError
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.almanac_words import almanac_sets
from vestige.navigation.inav.ephemeris_words import as_broadcast
from vestige.navigation.inav.ionosphere import NO_IONOSPHERE, BroadcastIonosphere
from vestige.navigation.inav.page import FIRST_PAGE_OFFSET_S, PAGE_S, InavPage
from vestige.navigation.inav.timing_words import UtcModel
from vestige.navigation.inav.words import word_type
from vestige.navigation.reissue import referred_to
from vestige.time import GalileoTime

_ISSUE_S = 600  # a new issue every ten minutes, as on air
_ISSUES = 128  # IODnav as on air: it counts the ten minutes of its toe
Symbols = Callable[[Int64[np.ndarray, " n"]], Int8[np.ndarray, " n"]]
_SYMBOLS_A_PAGE = PAGE_S * SYMBOLS_PER_S


def ephemeris_issues(ephemeris: Ephemeris, start: GalileoTime, end: GalileoTime) -> Iterator[EphemerisIssue]:
    """Yield the issues of a satellite from `start` to `end`: the same orbit each time, with a new IODnav.

    Parameters
    ----------
    ephemeris
        Orbit and clock, which all issues share to within the rounding of their fields.
    start, end
        Between these times the satellite always sends an issue.
    """
    first = start + -(start.gst_seconds % _ISSUE_S + start.fraction)
    for number in range(int((end - first) // _ISSUE_S) + 1):
        toe = first + float(number * _ISSUE_S)
        moved = replace(referred_to(ephemeris, toe), iod_nav=toe.gst_seconds // _ISSUE_S % _ISSUES)
        yield EphemerisIssue(start=toe, ephemeris=as_broadcast(moved))


@dataclass(frozen=True, kw_only=True)
class SkyMessage:
    """E1-B messages of the satellites of a sky: their I/NAV pages, and the transmissions that make the pages.

    Attributes
    ----------
    pages
        The pages of each satellite by SVID, in the order of time, one every 2 s.
    transmissions
        Transmission of each satellite, which makes the pages, by SVID.
    """

    pages: Mapping[int, tuple[InavPage, ...]]
    transmissions: Mapping[int, InavTransmission]

    def symbols(self, svid: int, reference: GalileoTime) -> Symbols:
        """Return the symbols of a satellite as ±1 by their number after a whole second; logic 0 is +1.

        The sequence raises `VestigeError` for a symbol that is not in the message.

        Parameters
        ----------
        svid
            SVID of the satellite.
        reference
            A whole second, at which symbol 0 begins.
        """
        made: dict[int, Int8[np.ndarray, " 500"]] = {}
        pages, transmission = self.pages[svid], self.transmissions[svid]
        before = (reference.gst_seconds - pages[0].time.gst_seconds) * SYMBOLS_PER_S

        def page(number: int) -> Int8[np.ndarray, " 500"]:
            if number not in made:
                if not 0 <= number < len(pages):
                    raise VestigeError(
                        f"E{svid:02d}: the message goes from {pages[0].time} to {pages[-1].time}; found a symbol "
                        f"{number} pages after its beginning"
                    )
                made[number] = np.int8(1) - np.int8(2) * transmission.symbols(pages[number].time).astype(np.int8)
            return made[number]

        def symbol(index: Int64[np.ndarray, " n"]) -> Int8[np.ndarray, " n"]:
            number, place = np.divmod(index + before, _SYMBOLS_A_PAGE)
            values = np.empty(index.size, np.int8)
            for one in np.unique(number):
                here = number == one
                values[here] = page(int(one))[place[here]]
            return values

        return symbol


def make_sky_message(
    ephemerides: Iterable[Ephemeris],
    operator: OsnmaOperator,
    end: GalileoTime,
    *,
    almanac: Iterable[Ephemeris] = (),
    ionosphere: BroadcastIonosphere = NO_IONOSPHERE,
) -> SkyMessage:
    """Return the message of some satellites from the operator's first subframe on.

    Parameters
    ----------
    ephemerides
        One ephemeris of each satellite that sends.
    operator
        Operator that makes the OSNMA fields; no field has been made yet.
    end
        Time up to which the message must last.
    almanac
        One ephemeris of each satellite of the constellation, for words 7 to 10. Without any ephemeris, word 0 is sent
        instead.
    ionosphere
        Ionosphere model, for word 5.

    Raises
    ------
    VestigeError
        If an ephemeris does not fit into its words; the message names the satellite.
    """
    start = operator.configuration.start
    system = SystemData(
        utc=UtcModel.at(start),
        ionosphere=ionosphere,
        almanac=almanac_sets(tuple(almanac), start + -float(start.gst_seconds % _ISSUE_S)),
    )
    fields: dict[tuple[int, GalileoTime], bytes] = {}
    transmissions = {
        one.svid: InavTransmission(
            words=SatelliteWords(tuple(ephemeris_issues(one, start, end)), system),
            osnma=lambda svid, time: fields[svid, time],
        )
        for one in ephemerides
    }
    subframes = int((end - start) // SUBFRAME_S) + 1
    pages: dict[int, list[InavPage]] = {svid: [] for svid in transmissions}
    for number in range(subframes):
        subframe = start + float(SUBFRAME_S * number)
        starts = [subframe + float(FIRST_PAGE_OFFSET_S + PAGE_S * k) for k in range(PAGES_A_SUBFRAME)]
        words = {svid: [one.words.word(time) for time in starts] for svid, one in transmissions.items()}
        made = operator.subframe(
            subframe, {svid: {word_type(word): word for word in sent} for svid, sent in words.items()}
        )
        for svid, of_pages in made.items():
            fields |= {(svid, time): field for time, field in zip(starts, of_pages, strict=True)}
            pages[svid] += [transmissions[svid].page(time) for time in starts]
    return SkyMessage(pages={svid: tuple(made) for svid, made in pages.items()}, transmissions=transmissions)
