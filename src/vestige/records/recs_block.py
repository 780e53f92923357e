"""Find the RECS of each satellite and epoch of a block, and the key of each RECS if the key is known."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records import Assistance, EncryptedSegment, GroupDelay
from vestige.records.snapshot_block import SnapshotBlock
from vestige.records.times import GalileoTimes
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

SEGMENT_WINDOW_S = 0.5  # largest difference in s between the expected and the stated transmission time of a RECS
_NEVER = GalileoTime(0, 0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecsBlock:
    """Whether RECS of n epochs and m satellites were found, and the times at which the keys of the RECS are on air."""

    found: Bool[np.ndarray, "n m"]  # whether a RECS was found for the epoch and satellite
    with_key: Bool[np.ndarray, "n m"]  # whether a RECS and its validated key were found
    key_time: GalileoTimes  # start of the subframe that sends the key; undefined without a RECS
    disclosed: GalileoTimes  # time of the first bit of the key on air; undefined without a validated key
    complete: GalileoTimes  # end of the last bit of the key on air; undefined without a validated key


@runtime_checkable
class RecsLookup(Protocol):
    """Source of the RECS of a block: arrays for all RECS, and single RECS with their keys on request."""

    @property
    def block(self) -> RecsBlock:
        """Whether the RECS of the block were found, and the times at which the keys of these RECS are on air."""

    def segment(self, epoch: int, satellite: int) -> tuple[EncryptedSegment, ValidatedKey]:
        """Return the RECS of one satellite at one epoch, and the key that decrypts this RECS."""


@runtime_checkable
class Corrections(Protocol):
    """Corrections of the delay of E6 relative to E1, which `Assistance` and other sources of data provide."""

    @property
    def group_delays(self) -> tuple[GroupDelay, ...]:
        """Broadcast group delays BGD(E1,E6) of the satellites."""

    @property
    def hardware_bias_e1_e6_s(self) -> float:
        """Calibrated delay of the E6 front end minus the delay of the E1 front end, in s."""

    @property
    def ionosphere_e1_m(self) -> Mapping[int, float]:
        """Predicted slant ionospheric delay on E1 by SVID, in m."""


@runtime_checkable
class AssistanceData(Corrections, Protocol):
    """Data that the processor gets in addition to snapshots: `Assistance`, or the data of a simulated service."""

    def recs_of(self, snapshots: SnapshotBlock) -> RecsLookup:
        """Return the RECS that the satellites of a block sent, each with its key if the key is known."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundRecs:
    """RECS of a block that were found in the assistance, by epoch and satellite."""

    block: RecsBlock
    segments: dict[tuple[int, int], tuple[EncryptedSegment, ValidatedKey]]

    def segment(self, epoch: int, satellite: int) -> tuple[EncryptedSegment, ValidatedKey]:
        """Return the RECS of one satellite at one epoch, and the key that decrypts this RECS."""
        return self.segments[epoch, satellite]


def find_recs(snapshots: SnapshotBlock, assistance: Assistance) -> FoundRecs:
    """Return the RECS of the satellites tracked on E1 in a block, and the keys of these RECS in the assistance."""
    shape = snapshots.asked.shape
    found, with_key = np.zeros(shape, np.bool_), np.zeros(shape, np.bool_)
    times = np.full((3, *shape), _NEVER, object)
    segments = {}
    keys = {key.time: key for key in reversed(assistance.keys)}
    for epoch, column in zip(*(axis.tolist() for axis in np.nonzero(snapshots.e1.seen)), strict=True):
        svid, travel_m = snapshots.svids[column], float(snapshots.e1.pseudorange_m[epoch, column])
        sent = snapshots.time.at(epoch) + -travel_m / SPEED_OF_LIGHT_MPS
        segment = segment_at(assistance, svid, sent)
        if segment is None:
            continue
        found[epoch, column] = True
        times[0, epoch, column] = segment.key_time
        key = keys.get(segment.key_time)
        if key is not None:
            with_key[epoch, column] = True
            times[1:, epoch, column] = key.disclosed_at, key.complete_at
            segments[epoch, column] = (segment, key)
    key_time, disclosed, complete = (GalileoTimes.of(one.flat).reshaped(shape) for one in times)
    block = RecsBlock(found=found, with_key=with_key, key_time=key_time, disclosed=disclosed, complete=complete)
    return FoundRecs(block=block, segments=segments)


def segments_between(assistance: Assistance, first: GalileoTime, last: GalileoTime) -> tuple[EncryptedSegment, ...]:
    """Return the RECS that are sent between two times, with a margin of `SEGMENT_WINDOW_S` on both sides."""
    segments = assistance.segments
    low = bisect_left(segments, first + -SEGMENT_WINDOW_S, key=lambda segment: segment.transmit_time)
    high = bisect_right(segments, last + SEGMENT_WINDOW_S, key=lambda segment: segment.transmit_time)
    return segments[low:high]


def segment_at(assistance: Assistance, svid: int, transmit_time: GalileoTime) -> EncryptedSegment | None:
    """Return the satellite's RECS nearest to a time; None if this satellite sends no RECS within `SEGMENT_WINDOW_S`."""
    own = [one for one in segments_between(assistance, transmit_time, transmit_time) if one.svid == svid]
    return min(own, key=lambda segment: abs(segment.transmit_time - transmit_time), default=None)
