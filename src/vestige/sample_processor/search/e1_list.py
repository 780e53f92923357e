"""Measure all signals on E1 at one time, for the list of `vestige search e1`.

`search_e1` finds signals on a grid of 125 Hz and about a quarter of a chip. This module measures each signal in the
samples of the search with `measure_e1`, and refers all signals to the first sample. If samples are missing, every
signal jumps to another code phase. After a jump was found, only the longest part without a jump is used, and all
signals are measured in this part.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from vestige.constants import E1_CARRIER_HZ, E1_CODE_PERIOD_S, SECONDARY_PERIOD_S
from vestige.records import SampleBatch
from vestige.sample_processor.acquisition import MAX_STRETCHES, Acquisition
from vestige.sample_processor.e1_snapshot import MIN_PERIODS, measure_e1
from vestige.sample_processor.search.e1_jump import Jump
from vestige.sample_processor.search.e1_search import search_e1
from vestige.signals.definitions import E1C

GUARD_S = 2 * E1_CODE_PERIOD_S  # margin before and after a jump, because its time is known only to 4 ms
_MOST_JUMPS = 4  # largest number of new searches after jumps; with more jumps, the remaining parts are too short
_SAME_CHIPS = 1.0  # largest distance in chips from the found to the measured code phase of the same signal


@dataclass(frozen=True, slots=True, kw_only=True)
class E1Signal:
    """One signal on E1 at the first sample of `E1Signals.batch`."""

    found: Acquisition  # cell in which the search found the signal
    code_start_s: float  # time from the first sample to the start of the first code period, [0, 4 ms)
    doppler_hz: float
    cn0_dbhz: float  # C/N0 of E1-C alone
    # satellite time at which the first sample was transmitted, in s, modulo 100 ms; None without a measurement
    transmit_phase_s: float | None

    @property
    def svid(self) -> int:
        """SVID of the satellite whose codes the signal has."""
        return self.found.svid

    @property
    def is_measured(self) -> bool:
        """Whether `measure_e1` measured the signal.

        Otherwise the values come from the search, whose error is up to 63 Hz in Doppler and 4 dB in C/N0.
        """
        return self.transmit_phase_s is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class E1Signals:
    """Signals of all satellites on E1 at the time of the first sample of `batch`."""

    batch: SampleBatch  # samples that were used, which contain no jump
    # signals in the order of the given satellites, and for each satellite from strong to weak
    signals: tuple[E1Signal, ...]
    jumps: tuple[Jump, ...]  # jumps that the search found in the given samples


def list_e1(
    batch: SampleBatch,
    svids: Iterable[int],
    *,
    overall_pfa: float = 1e-3,
    doppler_span_hz: float = 5000.0,
    periods: int = MAX_STRETCHES,
    progress: Callable[[int, int], None] | None = None,
) -> E1Signals:
    """Return every signal of the satellites `svids` on E1, all for the time of the first sample that is used.

    Parameters
    ----------
    batch
        E1 samples, at least 8 ms; with the default of `periods`, up to 100 ms are used. For `measure_e1`, 60 ms without
        a jump are enough.
    overall_pfa, doppler_span_hz, periods, progress
        Arguments with the same meaning as in `search_e1`.
    """
    jumps: list[Jump] = []
    wanted = tuple(svids)
    seconds = max(periods + 1, MIN_PERIODS + 3) * E1_CODE_PERIOD_S
    used = _part(batch, 0.0, seconds)
    found = search_e1(
        used,
        wanted,
        overall_pfa=overall_pfa,
        doppler_span_hz=doppler_span_hz,
        periods=periods,
        progress=progress,
        jumped=jumps.append,
    )
    new = tuple(jumps)
    for _ in range(_MOST_JUMPS):
        if not new:
            break
        used = _longest_part(used, new)
        further: list[Jump] = []
        found = search_e1(
            used,
            tuple(dict.fromkeys(one.svid for one in found)),
            overall_pfa=overall_pfa,
            doppler_span_hz=doppler_span_hz,
            periods=periods,
            jumped=further.append,
        )
        new = tuple(further)
        offset_s = (used.first_sample - batch.first_sample) / batch.sample_rate_hz
        jumps.extend(replace(jump, at_s=jump.at_s + offset_s) for jump in new)
    return E1Signals(batch=used, signals=tuple(_measured(used, one) for one in found), jumps=tuple(jumps))


def _measured(batch: SampleBatch, found: Acquisition) -> E1Signal:
    snapshot = measure_e1(batch, found)
    if snapshot is not None:
        rate = 1 + snapshot.doppler_hz / E1_CARRIER_HZ
        phase_s = snapshot.transmit_phase_s + (batch.start - snapshot.time) * rate
        start_s = -phase_s % E1_CODE_PERIOD_S / rate
        half = E1_CODE_PERIOD_S / 2
        away_s = abs((start_s - found.code_start_s + half) % E1_CODE_PERIOD_S - half)
        if away_s * E1C.chip_rate_hz <= _SAME_CHIPS:
            return E1Signal(
                found=found,
                code_start_s=start_s,
                doppler_hz=snapshot.doppler_hz,
                cn0_dbhz=snapshot.cn0_dbhz,
                transmit_phase_s=phase_s % SECONDARY_PERIOD_S,
            )
    return E1Signal(
        found=found,
        code_start_s=found.code_start_s,
        doppler_hz=found.doppler_hz,
        cn0_dbhz=found.cn0_dbhz,
        transmit_phase_s=None,
    )


def _longest_part(batch: SampleBatch, jumps: tuple[Jump, ...]) -> SampleBatch:
    """Return the longest part of a batch that contains no jump."""
    end_s = batch.samples.size / batch.sample_rate_hz
    times = sorted(jump.at_s for jump in jumps)
    begins = [0.0, *(at_s + GUARD_S for at_s in times)]
    ends = [*(at_s - GUARD_S for at_s in times), end_s]
    begin_s, stop_s = max(zip(begins, ends, strict=True), key=lambda part: part[1] - part[0])
    return _part(batch, begin_s, stop_s)


def _part(batch: SampleBatch, begin_s: float, end_s: float) -> SampleBatch:
    rate = batch.sample_rate_hz
    first = max(round(begin_s * rate), 0)
    return replace(
        batch,
        samples=batch.samples[first : round(end_s * rate)],
        first_sample=batch.first_sample + first,
        start=batch.start + first / rate,
    )
