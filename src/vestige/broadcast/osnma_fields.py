"""Make the OSNMA fields of the pages of all satellites, at the first request for a page of a subframe.

The fields of a subframe depend on the words of the `SUBFRAMES_REMEMBERED` subframes before the subframe, and on no
earlier words. So the fields of any subframe can be made without the earlier broadcast, and have the same bits as in a
full broadcast.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field
from threading import Lock

from vestige.broadcast.satellite_words import SatelliteWords
from vestige.constants import PAGES_A_SUBFRAME, SUBFRAME_S
from vestige.crypto.osnma.messages.navigation_data import TAGGED_WORDS
from vestige.crypto.osnma.operator.osnma_operator import OsnmaOperator
from vestige.crypto.osnma.operator.tag_plan import SUBFRAMES_REMEMBERED
from vestige.navigation.inav.page import FIRST_PAGE_OFFSET_S, PAGE_S
from vestige.navigation.inav.schedule import scheduled_word
from vestige.time import GalileoTime

_SUBFRAMES_KEPT = 8

_Fields = dict[int, tuple[bytes, ...]]


@dataclass(frozen=True, kw_only=True)
class OsnmaFields:
    """Source of the OSNMA fields of all satellites of a sky, page by page; threads may share a source.

    Attributes
    ----------
    operator
        Operator that makes the fields; nothing else may use this operator.
    words
        Words of all satellites by SVID. The words begin at the operator's start, or `SUBFRAMES_REMEMBERED` subframes
        before the first page.
    """

    operator: OsnmaOperator
    words: Mapping[int, SatelliteWords]
    _made: OrderedDict[GalileoTime, _Fields] = field(default_factory=OrderedDict, repr=False, compare=False)
    _lock: Lock = field(default_factory=Lock, repr=False, compare=False)

    def __call__(self, svid: int, start: GalileoTime) -> bytes:
        """Return the 5 bytes of OSNMA in the page of a satellite that starts at a time.

        Raises
        ------
        VestigeError
            If the operator does not broadcast at this time, or a satellite has no ephemeris for a needed subframe.
        """
        subframe = start.subframe
        with self._lock:
            if subframe not in self._made:
                self._made[subframe] = self._fields(subframe)
                if len(self._made) > _SUBFRAMES_KEPT:
                    self._made.popitem(last=False)
            return self._made[subframe][svid][(start.second - subframe.second - FIRST_PAGE_OFFSET_S) // PAGE_S]

    def _fields(self, time: GalileoTime) -> _Fields:
        operator = self.operator
        if not 0 <= time - operator.next_subframe <= SUBFRAME_S * SUBFRAMES_REMEMBERED:
            begin = time + -float(SUBFRAME_S * SUBFRAMES_REMEMBERED)
            operator.resume_at(max(begin, operator.configuration.start))
        while operator.next_subframe < time:
            before = operator.next_subframe
            operator.pass_over(before, self._tagged(before))
        return operator.subframe(time, self._tagged(time))

    def _tagged(self, subframe: GalileoTime) -> dict[int, dict[int, int]]:
        """Return the words of a subframe that tags cover, by SVID and type of the word."""
        starts = page_starts(subframe)
        due = [(time, kind) for time in starts if (kind := scheduled_word(time)) in TAGGED_WORDS]
        return {svid: {kind: one.word(time) for time, kind in due} for svid, one in self.words.items()}


def page_starts(subframe: GalileoTime) -> tuple[GalileoTime, ...]:
    """Return the starts of the pages of the subframe that starts at a time."""
    return tuple(subframe + float(FIRST_PAGE_OFFSET_S + PAGE_S * k) for k in range(PAGES_A_SUBFRAME))
