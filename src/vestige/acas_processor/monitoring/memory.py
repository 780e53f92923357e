"""Define the values from the epochs before a block that the receiver and its checks remember."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

Vector = tuple[float, float, float]
# Numbers that a check remembers from block to block, by SVID; numbers of the receiver have the key 0. The meaning of
# the numbers depends on the check.
CheckMemory = Mapping[int, tuple[float, ...]]
RECEIVER = 0  # key of the numbers of the receiver in `CheckMemory`


@dataclass(frozen=True, slots=True, kw_only=True)
class FixMemory:
    """Last position fix of an epoch that has no alarm and at least four AUTHENTIC satellites.

    In this epoch no range in use belongs to a signal that is earlier than the E1 signal.
    """

    time_s: float  # time of the position in s after the first epoch that the receiver ever processed
    position_m: Vector  # ECEF coordinates


@dataclass(frozen=True, slots=True, kw_only=True)
class Subframe:
    """Comparison of the OSNMA of one subframe with the second channel, up to the last epoch."""

    start: int  # beginning of the subframe in s since the GST epoch
    # bits of each satellite, a bit for each page and a bit for the key: due, received, and received with different data
    due: Mapping[int, int] = field(default_factory=dict)
    received: Mapping[int, int] = field(default_factory=dict)
    differs: Mapping[int, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaMemory:
    """OSNMA of earlier epochs: whether each of the last subframes had a key, and the unfinished subframe."""

    keyed: tuple[bool, ...] = ()
    open: Subframe | None = None
