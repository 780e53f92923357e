"""Define the interface of a source of snapshots, which simulations and recordings have in common."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol, runtime_checkable

from vestige.records.recs_block import AssistanceData
from vestige.records.snapshot_block import SnapshotBlock


@runtime_checkable
class Source(Protocol):
    """Source that yields blocks of snapshots in order of time, and has the assistance for these snapshots."""

    @property
    def assistance(self) -> AssistanceData:
        """RECS, group delays and validated keys for the snapshots of this source."""
        ...

    def __iter__(self) -> Iterator[SnapshotBlock]:
        """Yield the blocks of snapshots in order of time."""
        ...
