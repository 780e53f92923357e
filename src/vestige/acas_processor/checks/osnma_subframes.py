"""Compare OSNMA with a second channel, and count lost and different fields in each subframe [WFO, Sec. IV-C].

A subframe is compared at the first epoch after its end. The key of the subframe counts as received in two cases: the
whole key agrees with the second channel, or all pages of the key came from one satellite and agree.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Int64

from vestige.acas_processor.monitoring.memory import OsnmaMemory, Subframe
from vestige.constants import PAGES_A_SUBFRAME
from vestige.records.snapshot_block import OsnmaBlock

KEY_WINDOW = 20  # number of subframes in which missing keys are counted (10 minutes)
KEY_BIT = 1 << PAGES_A_SUBFRAME  # bit for a key that is compared as a whole; the lower bits are for the pages
_KEY_PAGES = sum(1 << page for page in range(10, 15))  # bits of the pages that carry a key of 128 bits [OSNMA-ICD]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Subframes:
    """The k subframes that ended in a block."""

    epoch: Int64[np.ndarray, " k"]  # row of the epoch at which each subframe is compared
    missing: Int64[np.ndarray, " k"]  # number of subframes without a received key among the last `window`
    window: Int64[np.ndarray, " k"]  # number of subframes over which `missing` counts, at most `KEY_WINDOW`
    # The next attributes are numbers of pages and keys, summed over the satellites.
    due: Int64[np.ndarray, " k"]  # pages and keys that were sent according to the second channel
    lost: Int64[np.ndarray, " k"]  # pages and keys that are due, but were not received
    received: Int64[np.ndarray, " k"]  # pages and keys that were received
    differs: Int64[np.ndarray, " k"]  # received pages and keys that differ from the second channel


def subframes(block: OsnmaBlock | None, svids: tuple[int, ...], memory: OsnmaMemory) -> tuple[Subframes, OsnmaMemory]:
    """Return the subframes that ended in a block, and the memory after the block.

    `block` contains pieces of subframes in order of time; None without a second channel.
    """
    keyed, current = memory.keyed, memory.open
    rows: list[tuple[int, ...]] = []
    for of in _together(block):
        if current is None or of.start != current.start:  # the last pieces of the earlier subframe are missing
            current = Subframe(start=of.start)
        current = _joined(current, of, svids)
        if not of.last:
            continue
        counts = _counts(current)
        keyed = (*keyed, counts[0])[-KEY_WINDOW:]
        rows.append((of.epoch, keyed.count(False), len(keyed), *counts[1:]))
        current = None
    columns = np.array(rows, np.int64).reshape(-1, 7).T
    names = ("epoch", "missing", "window", "due", "lost", "received", "differs")
    return Subframes(**dict(zip(names, columns, strict=True))), OsnmaMemory(keyed=keyed, open=current)


class _Pieces(NamedTuple):
    """Consecutive pieces of one subframe, with the bits of all pieces."""

    start: int  # start of the subframe in s since the GST epoch
    epoch: int  # row of the epoch of the last piece
    last: bool  # whether the last piece ends the subframe
    # The next attributes have an integer for each satellite, with a bit for each page and a bit for the key.
    due: list[int]
    received: list[int]
    differs: list[int]


def _together(block: OsnmaBlock | None) -> Iterator[_Pieces]:
    """Yield the pieces of a block, grouped by subframe."""
    if block is None or not block.epoch.size:
        return
    ends = np.append((block.subframe[1:] != block.subframe[:-1]) | block.last[:-1], True)
    final = np.flatnonzero(ends)
    first = np.concatenate([[0], final[:-1] + 1])
    bits = (np.bitwise_or.reduceat(one, first, axis=0).tolist() for one in (block.due, block.received, block.differs))
    of_ends = (one[final].tolist() for one in (block.subframe, block.epoch, block.last))
    yield from map(_Pieces, *of_ends, *bits)


def _joined(known: Subframe, pieces: _Pieces, svids: tuple[int, ...]) -> Subframe:
    """Return a subframe to which the bits of further pieces are added."""

    def with_bits(bits: Mapping[int, int], more: list[int]) -> dict[int, int]:
        return {svid: bits.get(svid, 0) | new for svid, new in zip(svids, more, strict=True)}

    return Subframe(
        start=known.start,
        due=with_bits(known.due, pieces.due),
        received=with_bits(known.received, pieces.received),
        differs=with_bits(known.differs, pieces.differs),
    )


def _counts(known: Subframe) -> tuple[bool, int, int, int, int]:
    """Return whether the key was received, and how many pages and keys were due, lost, received and different."""
    keyed, due, lost, received, differs = False, 0, 0, 0, 0
    for svid, bits in known.due.items():
        came, wrong = known.received.get(svid, 0), known.differs.get(svid, 0)
        right = came & ~wrong
        keyed |= bool(right & KEY_BIT) or right & _KEY_PAGES == _KEY_PAGES
        due += bits.bit_count()
        lost += (bits & ~came).bit_count()
        received += came.bit_count()
        differs += (came & wrong).bit_count()
    return keyed, due, lost, received, differs
