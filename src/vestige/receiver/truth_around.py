"""Compute the truth of a block of epochs and of the epochs around the block, which also affect the block's samples.

Between two epochs the receiver's samples change from the truth of the first epoch to the truth of the second epoch
(`continuous`). In a spoofing signal, the chips of an epoch may arrive later than in the true signal. So the samples of
a block depend on epochs before its first and after its last epoch. A delayed signal has the errors of a time that is
earlier by the delay.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from vestige.receiver.draws import rows_of
from vestige.receiver.truth import TruthBlock, TruthProcess
from vestige.records import Band

if TYPE_CHECKING:
    from vestige.receiver.simulation import Simulation

# time in s after the transmission of a RECS in which the RECS and the 100 ms of E1 around the RECS are received
TAIL_S = 0.3
_REACH_S = 0.5  # time in s that is longer than the time from an epoch to the end of the epoch's true samples
_SPARE_S = 0.2

_T = TypeVar("_T")


def epochs_around(interval_s: float, tail_s: float) -> tuple[int, int]:
    """Return how many epochs before and after a block of epochs affect the samples of the block.

    Parameters
    ----------
    interval_s
        Time in s between two epochs.
    tail_s
        Time in s from the transmission at an epoch to the epoch's last sample, at least `TAIL_S`.
    """
    reaches_s = (_REACH_S + tail_s - TAIL_S, tail_s + _SPARE_S)
    before, after = (int(np.ceil(reach_s / interval_s)) + 1 for reach_s in reaches_s)
    return before, after


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthWithin(TruthBlock):
    """Truth of a block of epochs and of the epochs around the block."""

    around: TruthBlock  # truth of the block's epochs, and of some epochs before and after the block

    def part(self, rows: slice) -> TruthBlock:
        """Return the truth of some of the block's epochs, without the epochs around the block."""
        return rows_of(TruthBlock(**{one.name: getattr(self, one.name) for one in fields(TruthBlock)}), rows)


class TruthAround:
    """Process that steps through the epochs in order, as `TruthProcess` does, and adds the epochs around a block."""

    def __init__(self, of: Simulation, *, before: int, after: int) -> None:
        self._of, self._before, self._after = of, before, after
        self._process = TruthProcess(of)
        self._known: TruthBlock | None = None
        # number of the first known epoch, and number of the epoch after the last known epoch
        self._first = self._end = 0

    def advance(self, first: int, count: int) -> TruthWithin:
        """Return the truth of the next epochs, `first` to `first + count − 1`."""
        begin, end = max(first - self._before, 0), first + count + self._after
        fresh = self._process.advance(self._end, end - self._end) if end > self._end else None
        if self._known is None:
            around = fresh
        else:
            kept = rows_of(self._known, slice(begin - self._first, None))
            around = kept if fresh is None else self._joined(kept, fresh)
        assert around is not None  # noqa: S101  (the first call has something new)
        self._known, self._first, self._end = around, begin, max(end, self._end)
        own = rows_of(around, slice(first - begin, first - begin + count))
        return TruthWithin(around=around, **{one.name: getattr(own, one.name) for one in fields(TruthBlock)})

    def _joined(self, before: TruthBlock, after: TruthBlock) -> TruthBlock:
        """Return the truth of two consecutive blocks as one block.

        The spoofing signals, noise and jamming of attacks are computed again from the times of the joined block.
        """
        times_s = np.concatenate([before.time_s, after.time_s])
        spoofer, svid = self._of.spoofer_as_received, self._of.svid
        joined: dict[str, Any] = {
            "e1_attack": spoofer.effects(Band.E1, svid, times_s),
            "e6": spoofer.effects(Band.E6, svid, times_s),
        }
        for one in fields(TruthBlock):
            if one.name not in joined:
                joined[one.name] = _end_to_end(getattr(before, one.name), getattr(after, one.name))
        return TruthBlock(**joined)


def _end_to_end(before: _T, after: _T) -> _T:
    """Return two arrays, or two records of arrays, joined end to end."""
    if not is_dataclass(before):
        arrays: Any = (before, after)
        return np.concatenate(arrays)  # type: ignore[return-value]
    values = {one.name: _end_to_end(getattr(before, one.name), getattr(after, one.name)) for one in fields(before)}
    return replace(before, **values)  # type: ignore[type-var]
