"""A sky whose OSNMA an operator makes: navigation words with random payloads, and pages for receivers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from osnma_builder import make_page, make_word
from vestige.crypto.osnma.operator.configuration import OperatorConfiguration
from vestige.crypto.osnma.operator.osnma_operator import OsnmaOperator
from vestige.navigation.inav.page import InavPage
from vestige.time import GalileoTime

# Word types by page: words 7 to 10 take two subframes, as on air.
SCHEDULES = ((2, 4, 6, 7, 8, 0, 0, 0, 0, 0, 1, 3, 5, 0, 0), (2, 4, 6, 9, 10, 0, 0, 0, 0, 0, 1, 3, 5, 0, 0))
SVIDS = (2, 4, 7, 8, 11, 13, 30, 33)  # all remainders modulo 8: a DSM of 8 blocks is complete in one subframe
TAGGED = (1, 2, 3, 4, 5, 6, 10)


@dataclass
class OperatorSky:
    """Satellites, their words, and the operator."""

    configuration: OperatorConfiguration
    svids: tuple[int, ...] = SVIDS
    issue_of: Callable[[int, int], int] = lambda _svid, _index: 5
    operator: OsnmaOperator = field(init=False)

    def __post_init__(self) -> None:
        self.operator = OsnmaOperator(self.configuration)

    def words(self, svid: int, index: int) -> list[tuple[GalileoTime, int]]:
        """The 15 words of a subframe with the times of their pages."""
        start = self.configuration.start + 30 * index
        schedule = SCHEDULES[start.second // 30 % 2]
        times = [start + (1 + 2 * k) for k in range(15)]
        return [
            (t, make_word(kind, svid, t, self.issue_of(svid, index))) for t, kind in zip(times, schedule, strict=True)
        ]

    def pages(self) -> list[InavPage]:
        """All pages in time order."""
        pages = []
        for index in range(self.configuration.n_subframes):
            words = {svid: self.words(svid, index) for svid in self.svids}
            tagged = {svid: {w >> 122: w for _, w in sent if w >> 122 in TAGGED} for svid, sent in words.items()}
            fields = self.operator.subframe(self.configuration.start + 30 * index, tagged)
            for svid, sent in words.items():
                pages += [make_page(svid, t, w, osnma) for (t, w), osnma in zip(sent, fields[svid], strict=True)]
        return sorted(pages, key=lambda page: page.time)
