"""Assemble pages into the subframes of all satellites, and count received and lost pages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from vestige.crypto.osnma.messages.subframe import Content, Epoch, PageStatus, SubframeAssembler
from vestige.crypto.osnma.osnma_report import ProblemKind, ProblemLog
from vestige.navigation.inav.page import InavPage
from vestige.navigation.inav.words import time_in_word
from vestige.time import GalileoTime


class PageIntake:
    """Assembler of subframes from pages, which also counts received and lost pages."""

    def __init__(self, problems: ProblemLog) -> None:
        self._problems = problems
        self._assembler = SubframeAssembler()
        self.counts: Counter[str] = Counter()  # counts with the names "pages", "crc", "alert" and "missing"
        self.statuses: Counter[PageStatus] = Counter()
        self.contents: Counter[Content] = Counter()
        self.stamps = [0, 0]  # numbers of navigation words with the time of the recording, and with another time
        self.satellites: set[int] = set()
        self.osnma_satellites: set[int] = set()
        self.first: GalileoTime | None = None
        self.last: GalileoTime | None = None

    def add(self, page: InavPage) -> tuple[Epoch, ...]:
        """Add a page, and return the subframes that the page closes, oldest first."""
        self.counts["pages"] += 1
        if not page.crc_ok:
            self.counts["crc"] += 1
            return ()
        if page.is_alert:
            self.counts["alert"] += 1
            return ()
        status, epochs = self._assembler.add(page)
        self.statuses[status] += 1
        if status is PageStatus.CONTRADICTION:
            text = f"E{page.svid:02d}: two different pages of one time; the first one is used"
            self._problems.report(ProblemKind.PAGE, page.time, text)
        elif status is PageStatus.TAKEN:
            self.first = page.time if self.first is None else min(self.first, page.time)
            self.last = page.time if self.last is None else max(self.last, page.time)
            self._check_time(page)
        return self._counted(epochs)

    def flush(self) -> tuple[Epoch, ...]:
        """Return the subframes that are still open after the last page, oldest first."""
        return self._counted(self._assembler.flush())

    def _counted(self, epochs: Iterable[Epoch]) -> tuple[Epoch, ...]:
        closed = tuple(epochs)
        for epoch in closed:
            for svid, subframe in epoch.satellites.items():
                self.contents[subframe.content] += 1
                self.counts["missing"] += subframe.n_missing
                self.satellites.add(svid)
                if subframe.sends_osnma:
                    self.osnma_satellites.add(svid)
        return closed

    def _check_time(self, page: InavPage) -> None:
        stamp = time_in_word(page.word)
        if stamp is None:
            return
        week, second = stamp
        same = second == page.time.second and week in (None, page.time.week % 4096)
        self.stamps[not same] += 1
        if not same:
            found = f"{'' if week is None else f'week {week} '}second {second}"
            text = f"E{page.svid:02d} sends a time that differs from the time of the recording"
            self._problems.report_once(ProblemKind.TIME, page.time, text, f" (first: {found})")
