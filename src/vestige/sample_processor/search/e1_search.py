"""All signals of a satellite on E1, not only the strongest: the first step of the hand-over search [WFO, Sec. III-E].

Theory of operation
-------------------
The powers are those of `vestige.sample_processor.acquisition`: one code period (4 ms) coherently at every code phase
and Doppler bin, K periods non-coherently, E1-B and E1-C added. Signals are taken out of them from the strongest down.
What belongs to a signal that has been taken is not a second one:

* its own correlation peak with the side peaks of BOC(1,1) and CBOC at ±½ chip, which ends one chip away, widened by
  the code Doppler of a wrong bin (0.6 chip over 100 ms and 10 kHz): all cells within `BLIND_CHIPS`;
* its Doppler side lobes (−13 dB, −18 dB, …): they lie at its code phase, so the same cells at *every* Doppler;
* its code side lobes, at any code phase: at most −20 dB for one code period of a memory code at a wrong Doppler, or
  with a symbol that turns. So nothing counts that is `CROSS_CORRELATION_DB` below it.

A peak that is only there while a stronger one is not is that signal after a jump: samples are missing (`e1_jump`).

What is given up: a second signal within 2 chips (586 m) in code phase modulo 4 ms, where the correlator bank and the
range checks watch, and one 16 dB below the strongest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from vestige.records import SampleBatch
from vestige.sample_processor.acquisition import (
    CROSS_CORRELATION_DB,
    MAX_STRETCHES,
    Acquisition,
    CellPowers,
    search_cells,
)
from vestige.sample_processor.search.e1_jump import Jump, find_jump
from vestige.signals.definitions import E1B, E1C, SignalDefinition

BLIND_CHIPS = 2.0  # see above


def search_e1(
    batch: SampleBatch,
    svids: Iterable[int],
    *,
    overall_pfa: float = 1e-3,
    doppler_span_hz: float = 5000.0,
    doppler_center_hz: float = 0.0,
    periods: int = MAX_STRETCHES,
    signals: tuple[SignalDefinition, ...] = (E1C, E1B),
    progress: Callable[[int, int], None] | None = None,
    jumped: Callable[[Jump], None] | None = None,
) -> tuple[Acquisition, ...]:
    """Return every signal of `svids` on E1 in `batch`, in the order of `svids`, the strongest of a satellite first.

    Parameters
    ----------
    batch
        E1 samples, at least 8 ms; up to 100 ms are used.
    overall_pfa
        Probability that noise alone gives any signal.
    doppler_span_hz, doppler_center_hz
        Searched from centre − span to centre + span.
    periods
        K, code periods that are added non-coherently at most; 1 needs 8 ms of samples.
    signals
        Components whose powers are added.
    progress
        Called with the number of satellites that are done, and of all, as the search goes on.
    jumped
        Called with every jump of a signal whose second peak was left out.
    """
    found = search_cells(
        batch,
        tuple(svids),
        separate,
        signals=signals,
        max_stretches=periods,
        overall_pfa=overall_pfa,
        doppler_span_hz=doppler_span_hz,
        doppler_center_hz=doppler_center_hz,
        progress=progress,
    )
    kept: list[Acquisition] = []
    for one in found:
        stronger = (other for other in kept if other.svid == one.svid)
        jump = next(filter(None, (find_jump(batch, other, one, signals, periods) for other in stronger)), None)
        if jump is None:
            kept.append(one)
        elif jumped is not None:
            jumped(jump)
    return tuple(kept)


def separate(powers: CellPowers) -> tuple[Acquisition, ...]:
    """Return the signals in the powers of one satellite, the strongest first."""
    best = np.max(powers.powers, axis=0)  # over Doppler: a signal takes its code phases at every Doppler
    blind = int(np.ceil(BLIND_CHIPS / E1C.chip_rate_hz * powers.rate_hz))
    found: list[Acquisition] = []
    while True:
        column = int(np.argmax(best))
        if best[column] <= powers.threshold:
            return tuple(found)
        one = powers.acquisition(int(np.argmax(powers.powers[:, column])), column)
        if found and one.cn0_dbhz < found[0].cn0_dbhz - CROSS_CORRELATION_DB:
            return tuple(found)
        found.append(one)
        best[(column + np.arange(-blind, blind + 1)) % best.size] = 0.0  # code phases are a circle
