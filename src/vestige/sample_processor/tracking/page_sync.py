"""Decode the I/NAV pages of a satellite from the E1-B prompts of its tracking channel.

Each code period of E1-B carries one symbol, so the code loop also gives the clock of the symbols. Every Galileo second
begins with a half-page and with a period of the secondary code of E1-C. So a page can begin at only 20 of 500
positions. At each position, the sign of the symbols follows from the synchronisation pattern. The checksum tells
whether the position is right [OS-ICD, 4.3.2]. When the position is found, a page is read every 500 symbols, until
`LOST_PAGES` pages in a row have a bad checksum or a wrong synchronisation pattern.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Complex, Float, Int64

from vestige.navigation.inav.coding.channel_coding import HALF_SYMBOLS, PAGE_SYMBOLS, SYNC_PATTERN, page_from_symbols
from vestige.navigation.inav.page import InavPage
from vestige.sample_processor.tracking.settings import PERIODS_PER_SECONDARY
from vestige.time import GalileoTime

LOST_PAGES = 15  # number of bad pages in a row (30 s) after which the position of the pages is searched again
_PATTERN = 1.0 - 2.0 * np.array(SYNC_PATTERN, np.float64)
_MAX_SYNC_ERRORS = 3  # largest number of wrong symbols in the two patterns (20 symbols) of a decoded page
_ANY_TIME = GalileoTime(0, 1)  # placeholder for the start of a page whose time is not known yet


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivedPage:
    """I/NAV page with a good checksum."""

    period: int  # number of the channel's code period at which the page begins
    data: bytes  # 30 bytes, the even half first


@dataclass(slots=True, kw_only=True)
class PageSync:
    """Reader that takes the E1-B prompts of one channel in order and returns the I/NAV pages in these prompts.

    Attributes
    ----------
    svid
        SVID of the satellite.
    tried, good
        Number of pages tried at a known position, and number of these pages with a good checksum.
    """

    svid: int
    tried: int = 0
    good: int = 0
    _soft: Float[np.ndarray, " n"] = field(default_factory=lambda: np.empty(0))
    _first: int = 0  # number of the code period of the first kept symbol
    _place: int | None = None  # number of the code period at which the next page begins; None if unknown
    _bad: int = 0  # number of consecutive pages with a bad checksum

    def take(self, numbers: Int64[np.ndarray, " n"], prompts: Complex[np.ndarray, " n"]) -> list[ReceivedPage]:
        """Take the next prompts, and return the pages that end in these prompts.

        Parameters
        ----------
        numbers
            Numbers of the code periods. After a gap in the numbers, the position of the pages is searched again. A
            secondary code begins at multiples of 25.
        prompts
            Prompts of E1-B, with the carrier locked to E1-C.
        """
        if numbers.size == 0:
            return []
        if self._soft.size and int(numbers[0]) != self._first + self._soft.size:
            self._soft, self._place = np.empty(0), None
        if not self._soft.size:
            self._first = int(numbers[0])
        self._soft = np.concatenate((self._soft, np.where(np.isfinite(prompts.real), prompts.real, 0.0)))
        pages = []
        while (page := self._next()) is not None:
            if page.data:
                pages.append(page)
        return pages

    def _next(self) -> ReceivedPage | None:
        """Return the next page, without data if the page was not decoded; None if there are too few symbols."""
        if self._place is not None:
            if self._place + PAGE_SYMBOLS > self._first + self._soft.size:
                return None
            at, self._place = self._place, self._place + PAGE_SYMBOLS
            data = self._decode(at)
            self.tried, self.good = self.tried + 1, self.good + bool(data)
            self._bad = 0 if data else self._bad + 1
            if self._bad == LOST_PAGES:
                self._place = None
            self._drop(at + PAGE_SYMBOLS)
            return ReceivedPage(period=at, data=data)
        at = self._first + -self._first % PERIODS_PER_SECONDARY
        if at + PAGE_SYMBOLS > self._first + self._soft.size:
            return None
        data = self._decode(at)
        if data:
            self._place, self._bad = at + PAGE_SYMBOLS, 0
            self.tried, self.good = self.tried + 1, self.good + 1
            self._drop(at + PAGE_SYMBOLS)
        else:
            self._drop(at + 1)
        return ReceivedPage(period=at, data=data)

    def _drop(self, until: int) -> None:
        self._soft = self._soft[until - self._first :]
        self._first = until

    def _decode(self, at: int) -> bytes:
        """Return the data of the page that begins at a code period; empty if the pattern or the checksum is bad."""
        soft = self._soft[at - self._first : at - self._first + PAGE_SYMBOLS]
        signs = np.sign(soft.reshape(2, HALF_SYMBOLS)[:, : _PATTERN.size]) * _PATTERN
        if abs(signs.sum()) < signs.size - 2 * _MAX_SYNC_ERRORS:
            return b""
        data = page_from_symbols(soft)
        page = InavPage(svid=self.svid, time=_ANY_TIME, data=data)
        return data if page.crc_ok else b""
