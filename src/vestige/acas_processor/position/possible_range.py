"""Test whether ranges are possible, by travel time, receiver clock, other satellites and known position.

A search can mistake noise for a signal anywhere in the searched time. Three tests exclude impossible ranges:

1. **Travel time and clock.** The travel time lies between `SHORTEST_TRAVEL_S` and `LONGEST_TRAVEL_S`, and the clock
   error is below its upper limit.
2. **The other satellites.** The clock error is common to all ranges of an epoch, so ranges differ mainly by the travel
   times. A range that is farther from the median than `SPREAD_M` is wrong. With only two ranges, the test cannot tell
   which of the two ranges is wrong.
3. **The known position.** The known position is the last fix, or the approximate position from the settings. P is the
   pseudorange, d is the distance from the satellite to the known position, and Δt_sat is the error of the satellite's
   clock. P − d + c Δt_sat is the error of the receiver's clock multiplied by c, to within `reach_m` + `MARGIN_M`. This
   error must lie within the upper limit of the clock error, and agree with the error from the other satellites. Test 3
   is made only for ranges of signals other than the E1 signal, because the checks test the range of E1.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np
from jaxtyping import Bool, Float, Int8

from vestige.acas_processor.monitoring.memory import FixMemory, Vector
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.position_fix import Transmission

# Travel times from a Galileo satellite are 77.5 ms at the zenith and 95 ms at 5° elevation. The limits have a margin of
# at least 10 ms.
SHORTEST_TRAVEL_S, LONGEST_TRAVEL_S = 0.065, 0.105
SPREAD_M = (LONGEST_TRAVEL_S - SHORTEST_TRAVEL_S) * SPEED_OF_LIGHT_MPS

FIX_REACH_M = 1000.0  # upper limit of the error of a fix by ionosphere, troposphere and an undetected attack
FASTEST_MPS = 500.0  # highest speed of the receiver; an airliner has 300 m/s
MARGIN_M = 500.0  # margin for ionosphere, troposphere, orbit error, and 46 m of Earth rotation
_RANGE_RATE_MPS = 1000.0  # upper limit of range rates on the Earth, to convert a clock error to a range error

# reasons why a range is not possible; `why_impossible` returns the index of the reason
REASONS = (
    "",
    "no possible travel time and clock error give such a range",
    "the ranges of the other satellites disagree with it",
    "no satellite has such a range at the known position",
)
_TRAVEL, _OTHERS, BY_POSITION = 1, 2, 3


@dataclass(frozen=True, slots=True, kw_only=True)
class ApproximatePosition:
    """Approximate position of the receiver, known before the recording is processed.

    Attributes
    ----------
    position_m
        ECEF coordinates in m.
    reach_m
        Upper limit of the distance to the receiver in m.

    Examples
    --------
    >>> ApproximatePosition(position_m=(4.18e6, 0.86e6, 4.72e6), reach_m=5000.0).reach_m
    5000.0
    """

    position_m: Vector
    reach_m: float

    def __post_init__(self) -> None:
        if not (self.reach_m > 0 and isfinite(self.reach_m) and all(isfinite(one) for one in self.position_m)):
            raise ValueError(f"a position within some metres, found {self.position_m} within {self.reach_m} m")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KnownPositions:
    """Positions near which the receiver must be at each of n epochs; NaN, with infinite reach, where unknown."""

    position_m: Float[np.ndarray, "n 3"]
    reach_m: Float[np.ndarray, " n"]


def why_impossible(
    range_m: Float[np.ndarray, "n m"],
    clock_limit_s: Float[np.ndarray, " n"],
) -> Int8[np.ndarray, "n m"]:
    """Return the index in `REASONS` of the test (1 or 2) that excludes each range; 0 if the range is possible.

    Parameters
    ----------
    range_m
        Pseudoranges; NaN where there is no pseudorange.
    clock_limit_s
        Upper limit of the error of the receiver's clock.
    """
    lowest_m, highest_m = (
        SPEED_OF_LIGHT_MPS * (one + sign * clock_limit_s)[:, None]
        for one, sign in ((SHORTEST_TRAVEL_S, -1), (LONGEST_TRAVEL_S, 1))
    )
    wrong = (range_m < lowest_m) | (range_m > highest_m)
    others = np.abs(range_m - row_median(np.where(wrong, np.nan, range_m))) > SPREAD_M
    return np.where(wrong, _TRAVEL, np.where(others, _OTHERS, 0)).astype(np.int8)


def too_far_away(
    range_m: Float[np.ndarray, "n m"],
    sent: Transmission,
    found: Bool[np.ndarray, "n m"],
    clock_limit_s: Float[np.ndarray, " n"],
    known: KnownPositions,
) -> Bool[np.ndarray, "n m"]:
    """Return True for found signals that the known position excludes (test 3).

    Parameters
    ----------
    range_m
        Pseudoranges that passed tests 1 and 2; NaN elsewhere.
    sent
        Positions and clocks of the satellites when the signals with the ranges `range_m` were sent.
    found
        True for ranges that belong to a signal other than the E1 signal.
    clock_limit_s
        Upper limit of the error of the receiver's clock.
    known
        Possible positions of the receiver.
    """
    distance_m = np.linalg.norm(sent.position_m - known.position_m[:, None], axis=2)
    clock_m = range_m + sent.clock_m - distance_m
    limit_m = (known.reach_m + MARGIN_M + _RANGE_RATE_MPS * clock_limit_s)[:, None]
    wrong = np.abs(clock_m) > limit_m + SPEED_OF_LIGHT_MPS * clock_limit_s[:, None]
    others = np.abs(clock_m - row_median(np.where(wrong & found, np.nan, clock_m))) > 2 * limit_m
    return found & (wrong | others)


def known_positions(
    time_s: Float[np.ndarray, " n"],
    fixed_m: Float[np.ndarray, "n 3"],
    before: FixMemory | None,
    stated: ApproximatePosition | None,
) -> KnownPositions:
    """Return the possible position at each epoch: near the last fix before the epoch, or near the stated position.

    If both positions are known, the position with the smaller reach is returned.

    Parameters
    ----------
    time_s
        Times of the epochs in s after the first epoch that the receiver processed.
    fixed_m
        Fix of each epoch that satisfies the conditions of `FixMemory`; NaN at other epochs.
    before
        Last fix before the first epoch that satisfies the conditions of `FixMemory`; None without such a fix.
    stated
        Approximate position from the settings; None if the settings have no position.
    """
    rows = np.where(np.isfinite(fixed_m[:, 0]), np.arange(time_s.size), -1)
    last = np.concatenate([[-1], np.maximum.accumulate(rows)[:-1]])
    nowhere = (np.full(3, np.nan), -np.inf) if before is None else (np.array(before.position_m), before.time_s)
    inside = last >= 0
    position_m = np.where(inside[:, None], fixed_m[last], nowhere[0])
    reach_m = FIX_REACH_M + FASTEST_MPS * (time_s - np.where(inside, time_s[last], nowhere[1]))
    if stated is not None:
        nearer = stated.reach_m < reach_m
        position_m = np.where(nearer[:, None], np.array(stated.position_m), position_m)
        reach_m = np.minimum(stated.reach_m, reach_m)
    return KnownPositions(position_m=position_m, reach_m=reach_m)


def row_median(values: Float[np.ndarray, "n m"]) -> Float[np.ndarray, "n 1"]:
    """Return the median of the finite values of each row; NaN if no value is finite."""
    order = np.sort(values, axis=1)  # NaN is sorted to the end
    count = np.count_nonzero(np.isfinite(values), axis=1)
    row, middle = np.arange(count.size), np.maximum(count - 1, 0)
    return (0.5 * (order[row, middle // 2] + order[row, (middle + 1) // 2]))[:, None]
