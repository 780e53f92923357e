"""Plan the tags of a MACK message: the satellite and the kind of data of each tag, and the cut-off points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from vestige.constants import SUBFRAME_S
from vestige.crypto.osnma.messages.chain_parameters import ChainParameters
from vestige.crypto.osnma.messages.mac_lookup import slots
from vestige.crypto.osnma.messages.navigation_data import (
    ADKD_EPHEMERIS,
    ADKD_SLOW,
    ADKD_TIMING,
    NavigationData,
    NavigationWords,
)
from vestige.crypto.osnma.operator.mack import TagContent
from vestige.time import GalileoTime

MAX_CUT_OFF = 15  # COP has 4 bits [OSNMA-ICD, MACK]
# COP counts the subframes after the transmission of all words. The transmission of all words takes two subframes for
# data with word 10.
SUBFRAMES_REMEMBERED = MAX_CUT_OFF + 3


@dataclass(slots=True)
class NavigationHistory:
    """The navigation words on air, and the number of consecutive subframes in which the tagged data did not change.

    Subframes are added in the order of time.
    """

    _words: dict[int, NavigationWords] = field(default_factory=dict)
    _unchanged: dict[tuple[int, int], tuple[int, int]] = field(default_factory=dict)  # (SVID, ADKD) -> (bits, count)

    def add(self, time: GalileoTime, words: Mapping[int, Mapping[int, int]]) -> None:
        """Add the words that the satellites send in a subframe.

        Parameters
        ----------
        time
            Start of the subframe.
        words
            Words of 128 bits by SVID and word type. Words that are not sent in every subframe may be missing.
        """
        start = time.gst_seconds
        for svid, sent in words.items():
            before = self._words.get(svid, NavigationWords())
            timed = {kind: (word, start) for kind, word in sent.items()}
            self._words[svid] = NavigationWords(words={**before.words, **timed}, subframe_s=start)
            for adkd in (ADKD_EPHEMERIS, ADKD_TIMING):
                data = self.data(svid, adkd, time + SUBFRAME_S)
                bits, count = self._unchanged.pop((svid, adkd), (-1, 0))
                if data is not None:
                    same = data.bits == bits and before.subframe_s == start - SUBFRAME_S
                    self._unchanged[svid, adkd] = data.bits, count + 1 if same else 1

    def data(self, svid: int, adkd: int, time: GalileoTime) -> NavigationData | None:
        """Return the data that a tag of the subframe of `time` covers; None if words are missing or inconsistent.

        The result is also None if the satellite sent no words in the previous subframe.
        """
        return self._words.get(svid, NavigationWords()).data(svid, adkd, time)

    def cut_off(self, svid: int, adkd: int) -> int:
        """Return COP, the number of consecutive subframes without a change of the data (at most 15); 0 without data."""
        kind = ADKD_EPHEMERIS if adkd == ADKD_SLOW else adkd
        return min(self._unchanged.get((svid, kind), (0, 0))[1], MAX_CUT_OFF)

    def authenticable(self, time: GalileoTime) -> tuple[int, ...]:
        """Return the satellites whose ephemeris a tag of the subframe of `time` can cover, in the order of SVID."""
        return tuple(sorted(svid for svid in self._words if self.data(svid, ADKD_EPHEMERIS, time) is not None))


def plan_tags(
    svid: int, time: GalileoTime, history: NavigationHistory, parameters: ChainParameters
) -> tuple[TagContent, ...]:
    """Return the contents of the tags of one satellite and subframe [OSNMA-ICD, Annex C].

    Slots for any satellite and flexible slots use in turn the other satellites that have ephemeris data (neighbours).
    Without neighbours, all slots are for the sending satellite. Flexible slots carry ADKD 0, as on air. A tag is a
    dummy if `NavigationHistory.data` returns None for its data.

    Parameters
    ----------
    svid
        SVID of the satellite that sends the tags.
    time
        Start of the subframe.
    history
        Words that were sent up to the previous subframe.
    parameters
        Parameters of the chain on air.

    Raises
    ------
    UnsupportedError
        If the MAC look-up table has no row for the parameters.
    """
    ring = _neighbours(svid, history.authenticable(time))
    minute, rest = divmod(time.gst_seconds, 60)
    # The count of neighbours continues through both subframes of a minute. Every minute starts with the next neighbour.
    turn = minute + (sum(not slot.own for slot in slots(parameters, time + -rest)) if rest else 0)
    contents = []
    for slot in slots(parameters, time):
        adkd = ADKD_EPHEMERIS if slot.adkd is None else slot.adkd
        target = svid if slot.own or not ring else ring[turn % len(ring)]
        turn += not slot.own
        contents.append(_content(target, adkd, time, history))
    return tuple(contents)


def _neighbours(svid: int, svids: Sequence[int]) -> tuple[int, ...]:
    """Return the other satellites, starting with the next higher SVID."""
    return tuple(other for other in svids if other > svid) + tuple(other for other in svids if other < svid)


def _content(svid: int, adkd: int, time: GalileoTime, history: NavigationHistory) -> TagContent:
    data = history.data(svid, adkd, time)
    if data is None:
        nothing = NavigationData(svid=svid, iod_nav=None, bits=0, n_bits=0, oldest_s=0)
        return TagContent(svid=svid, adkd=adkd, cut_off=0, data=nothing)
    return TagContent(svid=svid, adkd=adkd, cut_off=history.cut_off(svid, adkd), data=data)
