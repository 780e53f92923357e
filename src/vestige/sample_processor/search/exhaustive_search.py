"""Search E6 at every half chip of the time uncertainty and in every Doppler bin [WFO, Sec. III-D].

Theory of operation
-------------------
The samples are summed into chips on two grids half a chip apart (`half_chip_kernel`) and scaled to the range of int8.
An engine receives the chips in blocks of code offsets and returns the largest power over the Doppler bins for every
offset. So a file is read piece by piece, and all codes use the same chips of a block. Blocks are searched in order of
time. Therefore even an interrupted search finds the earliest signal of a satellite first. Under Assumption 2, the
earliest signal is the true signal. An interrupted search can be continued.

**Code Doppler.** A replica without code Doppler slides by 0.32 chip at 5 kHz and 16 ms, and loses up to 0.72 dB. The
slide is the Doppler over the carrier frequency, times the number of chips. A Doppler span that is wider than
`Grid.half_width_hz` on each side is cut into passes. Each pass removes the Doppler of its own middle from carrier *and*
code. A span of ±5 kHz needs two passes for 8 ms and three passes for 16 ms. The remaining loss is at most 0.24 dB.

**Decision.** Only cells whose power is above the threshold, lowered by the engine's loss and by `SCREEN_MARGIN_DB`, are
computed again. The exact value is the largest magnitude over all Doppler bins, computed in complex128. This magnitude
is divided by the standard deviation of the noise in the same samples (Σ|chip|², see
`vestige.sample_processor.correlator`). Only the exact value is compared with the threshold. Then Doppler and code phase
are refined. The margin is needed because noise differs between an engine's sum and the exact sum. The margin costs a
few exact cells per hour.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int16

from vestige.records import ChipSequence, SampleSource
from vestige.sample_processor.search.engines.choice import EngineName, make_engine
from vestige.sample_processor.search.engines.engine import CHIP_RATE_HZ, CHIP_SIGMA, CLIP, GRIDS, Engine, chip_variance
from vestige.sample_processor.search.exact_cell import Cell, exact_peak
from vestige.sample_processor.search.half_chip_kernel import chip_sums, half_chip_sums
from vestige.sample_processor.search.peak import Peak, separated, shortened
from vestige.signals.definitions import CARRIER_HZ
from vestige.time import GalileoTime

# 3 σ of the difference in dB between an engine's sum and the exact sum, at the threshold of a search over 30 s
SCREEN_MARGIN_DB = 1.0
_CLUSTER_CHIPS = 2.0  # largest distance in chips between two neighbouring offsets of a cluster
# number of cells tried in a cluster, because the exact value of the strongest cell may be just below the threshold
_CELLS_OF_CLUSTER = 4
_TRIANGLE_CHIPS = 1.25  # distance in chips from a cell to the end of its peak: ¼ chip to the peak, then 1 chip
_AHEAD = 2  # number of blocks per worker that are read in advance


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchState:
    """Progress of an exhaustive search, with the signals found so far.

    Attributes
    ----------
    done, total
        Number of hypotheses that were tested so far, and number of hypotheses of the whole search.
    peaks
        Signals found so far, in order of time.
    block_start
        Time of the first code offset of the last block.
    block_magnitude
        Magnitude of the strongest cell in the last block, as computed by the engine; 0 if the engine left out all
        cells. The unit is the standard deviation of the noise per dimension.
    blocks
        Number of searched blocks from the first block on.
    """

    done: float
    total: float
    peaks: tuple[Peak, ...]
    block_start: GalileoTime
    block_magnitude: float = 0.0
    blocks: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ExhaustiveSearch:
    """Exhaustive search of E6 over code offsets and Doppler, with its settings.

    Attributes
    ----------
    integration_s
        Integration time T_I in s: the first 1, 2, 4, 8 or 16 ms of a RECS.
    doppler_span_hz
        Half width of the Doppler search in Hz; the search goes from −span to +span.
    engine
        `fft` is the reference, `segment` is fast, `cuda` is for a GPU. `auto` takes the fastest engine that this
        machine can run. With every engine, only exactly computed cells decide. `segment` misses a few of the weakest
        signals (`theory/screen_loss.py`).
    workers
        Number of threads; None for all cores. The result does not depend on this number.
    """

    integration_s: float = 4e-3
    doppler_span_hz: float = 5000.0
    engine: EngineName = "auto"
    workers: int | None = None

    def __post_init__(self) -> None:
        if round(self.integration_s * CHIP_RATE_HZ) not in GRIDS:
            raise ValueError(f"the integration time must be 1, 2, 4, 8 or 16 ms, not {self.integration_s * 1e3:g} ms")
        if not 0 < self.doppler_span_hz < 1e6:
            raise ValueError(f"the Doppler span must be positive, not {self.doppler_span_hz} Hz")

    @property
    def n_chips(self) -> int:
        """Number of chips in the integration time, which are correlated."""
        return round(self.integration_s * CHIP_RATE_HZ)

    @property
    def passes_hz(self) -> tuple[float, ...]:
        """Doppler in the middle of each pass in Hz."""
        count = int(np.ceil(self.doppler_span_hz / GRIDS[self.n_chips].half_width_hz - 1e-9))
        width = 2 * self.doppler_span_hz / count
        return tuple(-self.doppler_span_hz + (k + 0.5) * width for k in range(count))

    @property
    def bins_hz(self) -> Float64[np.ndarray, " bins"]:
        """Doppler bins of a pass relative to its middle in Hz; no bin is more than half a bin beyond the pass."""
        bins = GRIDS[self.n_chips].bins_hz
        half = self.doppler_span_hz / len(self.passes_hz) + 0.25 / self.integration_s
        return bins[np.abs(bins) <= half * (1 + 1e-9)]

    def hypotheses(self, uncertainty_s: float, n_codes: int = 1) -> float:
        """Return the number of hypotheses: offsets (two for each chip) · bins of all passes · codes."""
        return max(uncertainty_s, 0.0) * 2 * CHIP_RATE_HZ * self.bins_hz.size * len(self.passes_hz) * n_codes

    def run(
        self,
        source: SampleSource,
        codes: Iterable[ChipSequence],
        first_start: GalileoTime,
        last_start: GalileoTime,
        threshold: float,
        *,
        after: SearchState | None = None,
    ) -> Iterator[SearchState]:
        """Yield the progress of the search after each block.

        A caller that stops early has the signals that were found so far. After an interrupt from the keyboard, the
        method lets the workers end their blocks, yields once more, and raises the interrupt again.

        Parameters
        ----------
        source
            E6 samples. An offset is searched only if the samples contain the whole sum.
        codes
            Decrypted RECS, of one or more satellites, each with at least the chips of the integration time.
        first_start, last_start
            Time uncertainty: earliest and latest arrival of the first chip.
        threshold
            Threshold on the magnitude, in standard deviations of the noise per dimension.
        after
            Progress from which an interrupted search continues. The continued search must have the same samples,
            arguments and settings as the interrupted search, except for `workers`.

        Raises
        ------
        ValueError
            If a code has fewer chips than the integration time.
        EngineUnavailableError
            If the engine cannot run on this machine.
        """
        chips = tuple(shortened(one, self.n_chips) for one in codes)
        if any(one.n_chips < self.n_chips for one in chips):
            raise ValueError(f"a RECS has fewer than the {self.n_chips} chips of the integration time")
        begin, uncertainty_s = searchable(source, self.integration_s, first_start, last_start)
        total = self.hypotheses(uncertainty_s, len(chips))
        if total <= 0 or not chips:
            yield SearchState(done=0.0, total=0.0, peaks=(), block_start=begin)
            return
        engine = make_engine(self.engine, np.stack([one.chips for one in chips]))
        n = int(uncertainty_s * CHIP_RATE_HZ) + 1
        blocks = [
            _Block(search=self, middle_hz=middle_hz, begin=begin, first=first, count=min(engine.block, n - first))
            for first in range(0, n, engine.block)
            for middle_hz in self.passes_hz
        ]
        done = total * (np.cumsum([block.count for block in blocks]) / sum(block.count for block in blocks))
        state = after or SearchState(done=0.0, total=total, peaks=(), block_start=begin)
        if after is not None:
            yield after
        pool = ThreadPoolExecutor(max_workers=self.workers or os.cpu_count())
        waiting: deque[tuple[_Block, Future[tuple[list[Peak], float]]]] = deque()
        ahead = _AHEAD * (self.workers or os.cpu_count() or 1)
        try:
            rest = iter(blocks[state.blocks :])
            while True:
                for block in rest:
                    waiting.append((block, pool.submit(block.peaks, source, engine, chips, threshold)))
                    if len(waiting) >= ahead:
                        break
                if not waiting:
                    return
                block, future = waiting[0]
                found = future.result()
                waiting.popleft()
                state = _next(state, block, *found, done)
                yield state
        except KeyboardInterrupt:
            pool.shutdown(wait=True, cancel_futures=True)
            for block, future in waiting:  # the results of started blocks are used; blocks start in order
                if future.cancelled():
                    break
                state = _next(state, block, *future.result(), done)
            yield state
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _next(
    state: SearchState, block: _Block, found: list[Peak], magnitude: float, done: Float64[np.ndarray, " blocks"]
) -> SearchState:
    """Return the progress after one more block; `done` is the number of hypotheses tested after each block."""
    return SearchState(
        done=float(done[state.blocks]),
        total=state.total,
        peaks=separated((*state.peaks, *found)) if found else state.peaks,
        block_start=block.begin + block.first / CHIP_RATE_HZ,
        block_magnitude=magnitude,
        blocks=state.blocks + 1,
    )


def searchable(
    source: SampleSource, integration_s: float, first_start: GalileoTime, last_start: GalileoTime
) -> tuple[GalileoTime, float]:
    """Return the part of the time uncertainty whose sums lie completely in the samples: first time, and width in s."""
    head = source.read(source.first_sample, 1)
    # two chips are a margin for the code Doppler and the last half chip
    length_s = (source.end_sample - source.first_sample) / head.sample_rate_hz - integration_s - 2 / CHIP_RATE_HZ
    begin_s = max(first_start - head.start, 0.0)
    return head.start + begin_s, min(last_start - head.start, length_s) - begin_s


@dataclass(frozen=True, slots=True, kw_only=True)
class _Block:
    """Code offsets of one pass that are searched at once; offset j is `first` + j received chips after `begin`."""

    search: ExhaustiveSearch
    middle_hz: float
    begin: GalileoTime
    first: int
    count: int

    def peaks(
        self, source: SampleSource, engine: Engine, codes: tuple[ChipSequence, ...], threshold: float
    ) -> tuple[list[Peak], float]:
        """Return the peaks of the block, and the magnitude of its strongest cell."""
        chips = self._chips(source)
        noise = chip_variance(chips) * self.search.n_chips  # noise variance of a sum over the code, per dimension
        if noise == 0:
            return [], 0.0
        screen = threshold**2 * noise * 10 ** (-(engine.loss_db + SCREEN_MARGIN_DB) / 10)
        found: list[Peak] = []
        strongest = 0.0
        for code, powers in zip(codes, engine.powers(chips, self.count, threshold), strict=True):
            strongest = max(strongest, float(np.max(powers)))
            for cluster in _clusters(powers, screen):
                found.extend(self._decide(source, code, cluster, threshold))
        return found, float(np.sqrt(strongest / noise))

    def _decide(self, source: SampleSource, code: ChipSequence, offsets: list[float], threshold: float) -> list[Peak]:
        """Return the peaks of a cluster; its cells are computed exactly, the cell with the largest engine power first.

        Further cells on the correlation triangle of a peak are not tested. Beyond the triangle there may be another
        signal. The test of a cluster ends after `_CELLS_OF_CLUSTER` cells in a row without a peak.
        """
        peaks: list[Peak] = []
        rest, tries = offsets, _CELLS_OF_CLUSTER
        while rest and tries:
            offset, *rest = rest
            cell = Cell(
                code=code,
                start_time=self.begin + (self.first + offset) / self._code_rate(source),
                middle_hz=self.middle_hz,
            )
            peak = exact_peak(source, cell, self.search.bins_hz, threshold)
            if peak is None:
                tries -= 1
                continue
            peaks.append(peak)
            rest, tries = [one for one in rest if abs(one - offset) > _TRIANGLE_CHIPS], _CELLS_OF_CLUSTER
        return peaks

    def _code_rate(self, source: SampleSource) -> float:
        return CHIP_RATE_HZ * (1 + self.middle_hz / CARRIER_HZ[source.read(source.first_sample, 1).band])

    def _chips(self, source: SampleSource) -> Int16[np.ndarray, "2 2 n"]:
        """Return the samples of the block, summed into chips on each grid and scaled to σ = `CHIP_SIGMA`.

        The second axis has the real and the imaginary part. Chips after the end of the samples are zero.
        """
        n = self.count + self.search.n_chips
        head = source.read(source.first_sample, 1)
        rate, code_rate = head.sample_rate_hz, self._code_rate(source)
        low = int((self.begin - head.start + self.first / code_rate) * rate) - 1
        high = int((self.begin - head.start + (self.first + n + 1) / code_rate) * rate) + 2
        low, high = max(low, 0) + source.first_sample, min(high + source.first_sample, source.end_sample)
        batch = source.read(low, high - low)
        halves = np.empty((2, 2 * n + 1), np.float32)
        half_chip_sums(
            batch.samples.view(np.float32),
            batch.start - self.begin,
            1.0 / rate,
            code_rate,
            0.0,
            CARRIER_HZ[batch.band] - batch.center_frequency_hz + self.middle_hz,
            0.0,
            2 * self.first,
            *halves,
        )
        sums = np.empty((2, 2, n), np.float32)
        power = sum(chip_sums(halves[part], sums[0, part], sums[1, part]) for part in (0, 1))
        scale = np.float32(CHIP_SIGMA / np.sqrt(power / (2 * n))) if power > 0 else np.float32(0)
        np.multiply(sums, scale, out=sums)
        np.clip(np.rint(sums, out=sums), -CLIP, CLIP, out=sums)
        return sums.astype(np.int16)


def _clusters(powers: Float32[np.ndarray, "grids offsets"], screen: float) -> list[list[float]]:
    """Return clusters of code offsets in chips with a power above `screen`, the strongest offset of a cluster first."""
    grid, offset = np.nonzero(powers > screen)
    place = offset + 0.5 * grid
    order = np.argsort(place)
    cuts = np.flatnonzero(np.diff(place[order]) > _CLUSTER_CHIPS) + 1
    strength = powers[grid, offset]
    return [
        [float(place[i]) for i in sorted(part, key=lambda i: -strength[i])]
        for part in np.split(order, cuts)
        if part.size
    ]
