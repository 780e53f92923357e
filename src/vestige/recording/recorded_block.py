"""Make blocks of one epoch for the processor, from a snapshot of a recording or from E1 tracking between snapshots.

If the receiver has a second OSNMA channel, a block includes the comparison with this channel. The comparison covers the
OSNMA data since the previous block. If the receiver has inertial sensors, a block includes their velocity increments
since the previous block.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vestige.acas_processor.osnma_comparison import compare_osnma
from vestige.acas_processor.searches.sampled_snapshot import block_of
from vestige.constants import SUBFRAME_S
from vestige.records import Assistance, Band, Snapshot
from vestige.records.inertial import Accelerations
from vestige.records.observation_epoch import ObservationEpoch
from vestige.records.snapshot_block import OBSERVED, E1Block, FrontEndBlock, SnapshotBlock, VelocityIncrements
from vestige.records.times import GalileoTimes
from vestige.time import GalileoTime

OSNMA_SUBFRAMES = 20  # number of subframes that are compared at the first block: the 10 minutes before this block


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherChannels:
    """Data of a receiver in addition to samples and assistance: second OSNMA channel and inertial sensors."""

    # OSNMA keys of a second channel, and its pages if known [WFO, Sec. IV-C]; None without a second channel
    second_channel: Assistance | None = None
    accelerations: Accelerations | None = None  # accelerations from inertial sensors; None without sensors

    def block(self, snapshot: Snapshot, assistance: Assistance, since: GalileoTime | None) -> SnapshotBlock:
        """Return a snapshot as a block of one epoch.

        `since` is the time of the previous block; None for the first block.
        """
        return self.joined(block_of(snapshot, since=since, accelerations=self.accelerations), assistance, since)

    def joined(self, block: SnapshotBlock, assistance: Assistance, since: GalileoTime | None) -> SnapshotBlock:
        """Compare the OSNMA data with the second channel, and return the block of one epoch with the result."""
        now = block.time.at(0)
        if self.second_channel is None or not block.svids:
            return block
        begin = now + -SUBFRAME_S * OSNMA_SUBFRAMES if since is None else since
        osnma = compare_osnma(assistance, self.second_channel, begin, now, block.svids)
        return replace(block, osnma=osnma)


def tracked_block(
    index: int, epoch: ObservationEpoch, *, time_uncertainty_s: float, increments: VelocityIncrements | None
) -> SnapshotBlock:
    """Return a block with the measurements of E1 tracking at an epoch without RECS.

    Parameters
    ----------
    index
        Running number of the block in its source.
    epoch
        Observations, correlators and power.
    time_uncertainty_s
        Upper limit of the error of the receiver's clock in s.
    increments
        Velocity increments of the inertial sensors since the previous block; None without inertial sensors.
    """
    svids = tuple(sorted(epoch.observations))
    rows: dict[str, Any] = {
        name: np.array([[getattr(epoch.observations[svid], name) for svid in svids]]) for name in OBSERVED
    }
    shape = (1, len(svids))
    block = SnapshotBlock(
        index=np.array([index]),
        time=GalileoTimes.of([epoch.time]),
        received_at=GalileoTimes.of([epoch.time]).reshaped(shape),
        time_uncertainty_s=np.array([time_uncertainty_s], np.float64),
        svids=svids,
        asked=np.ones(shape, np.bool_),
        recs=np.zeros(1, np.bool_),
        e1=E1Block(**rows),
        increments=increments,
    )
    return with_correlators(block, epoch)


def with_correlators(block: SnapshotBlock, epoch: ObservationEpoch) -> SnapshotBlock:
    """Return a block of one epoch with the E1 correlators that were tracked at `epoch`.

    The E1 power of `epoch` is added if the block has no E1 power. If `epoch` has no correlators, the block is returned
    without a change.
    """
    if not epoch.tap_chips:
        return block
    nothing = np.full(len(epoch.tap_chips), np.nan + 0j)
    taps = np.array([[epoch.taps.get(svid, nothing) for svid in block.svids]], np.complex128)
    unknown = np.array([np.nan])
    power = FrontEndBlock(agc_gain_db=unknown, total_power_db=np.array([epoch.power_db]), saturated=np.zeros(1, bool))
    return replace(
        block,
        e1=replace(block.e1, taps=taps.reshape(1, len(block.svids), -1), tap_chips=epoch.tap_chips),
        front_end={Band.E1: power} | dict(block.front_end),
    )
