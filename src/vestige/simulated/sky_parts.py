"""Provide the signals of a recording part by part, in order of time.

The truth of a recording of hours is too large for the memory. So the signals of a part are requested only when the
samples of this part are made.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

from vestige.receiver.samples.recorder import ReceivedSatellite
from vestige.records import Band

Part = tuple[range, tuple[ReceivedSatellite, ...]]


class SkyParts(Protocol):
    """Protocol of an object that provides the signals of a recording in both bands."""

    @property
    def svids(self) -> tuple[int, ...]:
        """SVIDs of the satellites of the recording, in ascending order."""

    def parts(self, band: Band, samples: range) -> Iterator[Part]:
        """Yield ranges of successive sample numbers, each with the signals of a band in these samples.

        Parameters
        ----------
        band
            Band of the samples.
        samples
            Numbers of the requested samples, which the parts cover in order. Samples before the first and after the
            last sample of the recording are possible.
        """


@dataclass(frozen=True, kw_only=True)
class WholeSky:
    """Signals of a recording that is not divided into parts."""

    signals: Mapping[Band, tuple[ReceivedSatellite, ...]]

    @property
    def svids(self) -> tuple[int, ...]:
        """SVIDs of the satellites of the recording, in ascending order."""
        return tuple(sorted({one.svid for sky in self.signals.values() for one in sky}))

    def parts(self, band: Band, samples: range) -> Iterator[Part]:
        """Yield a single part: the range `samples`, with all signals of a band."""
        yield samples, self.signals[band]
