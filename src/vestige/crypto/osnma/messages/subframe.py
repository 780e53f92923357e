"""Assemble the OSNMA message of one satellite and subframe from I/NAV pages.

A subframe of 30 s has 15 pages. Each page carries 8 bits of the HKROOT message and 32 bits of the MACK message
[OSNMA-ICD, 2]. A subframe carries 120 bits of the HKROOT message and 480 bits of the MACK message. Pages get lost, so a
subframe records which of its 15 fields were received. A part of the MACK message can still be read if the pages of this
part were received.

The assembler keeps a subframe open until a page arrives that starts at least 10 s after the end of the subframe. Pages
may therefore come in any order of satellites, and a few seconds out of order in time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from vestige.constants import PAGES_A_SUBFRAME, SUBFRAME_S
from vestige.navigation.inav.page import FIRST_PAGE_OFFSET_S, PAGE_S, InavPage
from vestige.navigation.inav.word_table import DUMMY_WORD
from vestige.time import GalileoTime

MACK_BITS = 32  # MACK bits in one page [OSNMA-ICD, 2]
MACK_TOTAL_BITS = PAGES_A_SUBFRAME * MACK_BITS

_GRACE_S, _RESTART_S = 10, 600


class Content(Enum):
    """Content of the OSNMA fields of a satellite over one subframe."""

    OSNMA = "OSNMA"
    NONE = "no OSNMA"
    FILLER = "dummy pages"
    INCOMPLETE = "incomplete"


@dataclass(frozen=True, slots=True, kw_only=True)
class SatelliteSubframe:
    """The received pages of one satellite in one subframe, which has 15 pages."""

    svid: int
    time: GalileoTime  # start of the subframe (GST_SF)
    # 15 OSNMA fields of 5 bytes; None for a lost or dummy page, and zero bytes if the satellite sent no OSNMA
    osnma: tuple[bytes | None, ...]
    words: tuple[int | None, ...]  # 15 navigation words of 128 bits; None for a lost page

    @property
    def n_missing(self) -> int:
        """Number of lost pages."""
        return self.words.count(None)

    @property
    def content(self) -> Content:
        """Content of the satellite's OSNMA fields."""
        if self.osnma.count(None) == PAGES_A_SUBFRAME and not self.n_missing:
            return Content.FILLER
        if None in self.osnma:
            return Content.INCOMPLETE
        return Content.OSNMA if self.sends_osnma else Content.NONE

    @property
    def sent(self) -> tuple[bytes | None, ...]:
        """The 15 OSNMA fields; None for a field that was not received or not sent.

        OSNMA may start or stop within a subframe. A zero field counts as not sent, so that its bits are not read as
        bits of a key.
        """
        return tuple(field if field is not None and any(field) else None for field in self.osnma)

    @property
    def sends_osnma(self) -> bool:
        """Whether the received OSNMA fields contain any bit that is not zero."""
        return any(field is not None for field in self.sent)

    @property
    def nma_header(self) -> int | None:
        """The NMA header (8 bits), or None if the first page is lost or contains no OSNMA."""
        first = self.osnma[0]
        return first[0] if first is not None and any(first) else None

    @property
    def hkroot(self) -> bytes | None:
        """The HKROOT message, 15 bytes; None if a field was not received or not sent (see `sent`)."""
        return _hkroot(self.sent)

    @property
    def hkroot_if_sent(self) -> bytes | None:
        """The HKROOT message if only the last field is zero; None for any other subframe, or if a page is lost.

        The last page may contain only padding of the MACK message, so a zero field may have been sent.
        """
        last = self.osnma[-1]
        return None if last is None or any(last) else _hkroot((*self.sent[:-1], last))

    def mack_bits(self, start: int, length: int) -> int | None:
        """Return `length` bits of the MACK message from bit `start` on; None if a page of these bits is missing."""
        first, last = start // MACK_BITS, (start + length - 1) // MACK_BITS
        joined = 0
        for field in self.sent[first : last + 1]:
            if field is None:
                return None
            joined = joined << MACK_BITS | int.from_bytes(field[1:], "big")
        return (joined >> ((last + 1) * MACK_BITS - start - length)) & ((1 << length) - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Epoch:
    """The received pages of all satellites in one subframe."""

    time: GalileoTime  # start of the subframe (GST_SF)
    satellites: Mapping[int, SatelliteSubframe]  # subframe of each satellite by SVID


class PageStatus(Enum):
    """Status of a page that was given to the assembler."""

    TAKEN = "taken"
    DUPLICATE = "duplicate"  # an equal page of this satellite and time came before
    CONTRADICTION = "contradiction"  # a different page of this satellite and time came before, and is kept
    OFF_GRID = "off grid"  # the page does not start at an odd second
    LATE = "late"  # the subframe of the page is closed


class SubframeAssembler:
    """Assembler that collects I/NAV pages into subframes.

    A subframe is closed when a page arrives that starts `_GRACE_S` or more after the end of the subframe. If a page is
    more than `_RESTART_S` older than the newest page, the recording is assumed to start again with this page.
    """

    def __init__(self) -> None:
        self._open: dict[int, dict[int, list[InavPage | None]]] = {}
        self._newest: int | None = None

    def add(self, page: InavPage) -> tuple[PageStatus, list[Epoch]]:
        """Add a page, and return its status and the subframes that the page closed, oldest first."""
        second = page.time.gst_seconds
        index, rest = divmod(second % SUBFRAME_S - FIRST_PAGE_OFFSET_S, PAGE_S)
        if rest or page.time.fraction:
            return PageStatus.OFF_GRID, []
        closed: list[Epoch] = []
        if self._newest is None or second > self._newest:
            closed = self._close(before=second - _GRACE_S)
            self._newest = second
        elif second < self._newest - _RESTART_S:
            closed = self.flush()
            self._newest = second
        start = second - second % SUBFRAME_S
        if start + SUBFRAME_S <= self._newest - _GRACE_S:
            return PageStatus.LATE, closed
        pages = self._open.setdefault(start, {}).setdefault(page.svid, [None] * PAGES_A_SUBFRAME)
        earlier = pages[index]
        if earlier is not None:
            same = earlier.data == page.data
            return PageStatus.DUPLICATE if same else PageStatus.CONTRADICTION, closed
        pages[index] = page
        return PageStatus.TAKEN, closed

    def flush(self) -> list[Epoch]:
        """Close and return all open subframes, oldest first, after the last page."""
        epochs = [_epoch(start, self._open[start]) for start in sorted(self._open)]
        self._open.clear()
        self._newest = None
        return epochs

    def _close(self, before: int) -> list[Epoch]:
        starts = sorted(start for start in self._open if start + SUBFRAME_S <= before)
        return [_epoch(start, self._open.pop(start)) for start in starts]


def _hkroot(fields: Sequence[bytes | None]) -> bytes | None:
    return None if None in fields else bytes(field[0] for field in fields if field is not None)


def _epoch(start: int, satellites: Mapping[int, list[InavPage | None]]) -> Epoch:
    time = GalileoTime.from_gst_seconds(start)
    return Epoch(
        time=time,
        satellites={
            svid: SatelliteSubframe(
                svid=svid,
                time=time,
                osnma=tuple(None if page is None or page.word >> 122 == DUMMY_WORD else page.osnma for page in pages),
                words=tuple(None if page is None else page.word for page in pages),
            )
            for svid, pages in sorted(satellites.items())
        },
    )
