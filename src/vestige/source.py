"""Where snapshots come from: a simulation and a recording are two of the same thing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol, runtime_checkable

from vestige.records import Snapshot


@runtime_checkable
class Source(Protocol):
    """Anything that yields snapshots in time order."""

    def __iter__(self) -> Iterator[Snapshot]:
        """Yield the snapshots."""
        ...
