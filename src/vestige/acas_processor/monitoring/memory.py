"""Memory of the receiver and of its checks: values from the epochs before a block."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

Vector = tuple[float, float, float]
# Numbers that a check remembers from block to block, by SVID; numbers of the receiver have the key 0. Each check gives
# the numbers its own meaning.
CheckMemory = Mapping[int, tuple[float, ...]]
RECEIVER = 0  # key of the receiver


@dataclass(frozen=True, slots=True, kw_only=True)
class FixMemory:
    """Last position from authentic ranges without an alarm."""

    time_s: float  # in s after the first epoch that the receiver ever processed
    position_m: Vector  # ECEF


@dataclass(frozen=True, slots=True, kw_only=True)
class Subframe:
    """OSNMA of one subframe, as far as received."""

    start: int  # in s since the GST epoch
    # by satellite, a bit for each page: due, received, and received but different
    due: Mapping[int, int] = field(default_factory=dict)
    received: Mapping[int, int] = field(default_factory=dict)
    differs: Mapping[int, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaMemory:
    """OSNMA of earlier epochs: whether each of the last subframes brought a key, and the unfinished subframe."""

    keyed: tuple[bool, ...] = ()
    open: Subframe | None = None
