"""Make the signals of a test case in blocks of epochs, so that the memory does not grow with the number of epochs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from threading import Lock

from vestige.receiver.samples.recorder import stretch_samples
from vestige.records import Band
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_satellite import ExportedSatellite
from vestige.simulated.sky_parts import Part


class _Blocks:
    """Blocks of a test case by number; several threads may use one object.

    The last requested block is kept, and a later block continues from the kept block. A request for an earlier block
    starts again with the first block.
    """

    def __init__(self, case: AcasTestCase) -> None:
        self._case, self._lock = case, Lock()
        self._following: Iterator[tuple[ExportedSatellite, ...]] = iter(())
        self._number = -1
        self._block: tuple[ExportedSatellite, ...] = ()

    def block(self, number: int) -> tuple[ExportedSatellite, ...]:
        """Return the satellites of the test case in the block `number`."""
        with self._lock:
            if self._number < 0 or number < self._number:
                self._number, self._following = -1, self._case.blocks()
            while self._number < number:
                self._block = next(self._following)
                self._number += 1
            return self._block


@dataclass(frozen=True, kw_only=True)
class SkyInBlocks:
    """All signals of a test case, of which each band has only one block of epochs in memory.

    The two bands have separate blocks, because one band may be written much faster than the other band.
    """

    case: AcasTestCase
    _blocks: dict[Band, _Blocks] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_blocks", {band: _Blocks(self.case) for band in Band})

    @property
    def svids(self) -> tuple[int, ...]:
        """SVIDs of the satellites of the recording, in ascending order."""
        return tuple(sorted(one.svid for one in self.case.scenario.simulations))

    def parts(self, band: Band, samples: range) -> Iterator[Part]:
        """Yield the sample numbers of each block, with the signals of a band in this block.

        The recorder makes samples in stretches of about 10 ms. A block begins with the stretch that contains the
        transmission of the block's first epoch.
        """
        case, rate_hz = self.case, self.case.scenario.receiver.sample_rate_hz
        length = stretch_samples(rate_hz)
        begins_s = (epoch * case.scenario.interval_s for epoch in range(case.first, case.end, case.block_epochs))
        begins = [int(begin_s * rate_hz) // length * length for begin_s in begins_s]
        ends = [*begins[1:], max(samples.stop, begins[-1])]
        begins[0] = min(samples.start, begins[0])
        for number, (begin, end) in enumerate(zip(begins, ends, strict=True)):
            part = range(max(begin, samples.start), min(end, samples.stop))
            if part:
                satellites = self._blocks[band].block(number)
                yield part, tuple(signal for one in satellites for signal in one.received(band))
