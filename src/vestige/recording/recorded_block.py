"""A snapshot of a recording as a block for the processor, with what other channels say since the last one."""

from __future__ import annotations

from dataclasses import dataclass, replace

from vestige.acas_processor.osnma_comparison import compare_osnma
from vestige.acas_processor.searches.sampled_snapshot import block_of
from vestige.constants import SUBFRAME_S
from vestige.records import Assistance, Snapshot
from vestige.records.inertial import Accelerations
from vestige.records.snapshot_block import SnapshotBlock
from vestige.time import GalileoTime

OSNMA_SUBFRAMES = 20  # in which keys are looked for at first, 10 minutes


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherChannels:
    """What a receiver has beside samples and assistance."""

    # OSNMA keys, and pages if there are any, that came over another channel [WFO, Sec. IV-C]; None without one.
    second_channel: Assistance | None = None
    accelerations: Accelerations | None = None  # of inertial sensors; None without any

    def block(self, snapshot: Snapshot, assistance: Assistance, since: GalileoTime | None) -> SnapshotBlock:
        """Return a snapshot as a block of one epoch.

        `since` is the time of the snapshot before; None at first.
        """
        block = block_of(snapshot, since=since, accelerations=self.accelerations)
        if self.second_channel is None or not block.svids:
            return block
        begin = snapshot.time + -SUBFRAME_S * OSNMA_SUBFRAMES if since is None else since
        osnma = compare_osnma(assistance, self.second_channel, begin, snapshot.time, block.svids)
        return replace(block, osnma=osnma)
