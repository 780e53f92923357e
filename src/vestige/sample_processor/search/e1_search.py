"""Find all signals of a satellite on E1, from strong to weak: the first step of the hand-over search [WFO, Sec. III-E].

Theory of operation
-------------------
`vestige.sample_processor.acquisition` computes the powers at every code phase and Doppler bin. The sum over one code
period (4 ms) is coherent. The sum over K periods and the components E1-B and E1-C is non-coherent. Signals are taken
from the powers, the strongest first. The following parts of a taken signal are not taken as a second signal:

* the correlation peak of the signal: all cells within `BLIND_CHIPS`. The peak ends one chip away, with the side peaks
  of BOC(1,1) and CBOC at ±½ chip. In a bin that is 10 kHz away from the signal, the code Doppler widens the peak by 0.6
  chip over 100 ms;
* the Doppler side lobes of the signal (−13 dB, −18 dB, …) at its code phase: the same cells at *every* Doppler;
* the code side lobes of the signal, at any code phase. These side lobes have at most −20 dB for one code period of a
  memory code at a wrong Doppler, or with a symbol that changes. So a signal that is more than `CROSS_CORRELATION_DB`
  below the strongest signal is left out.

At most `MAX_SIGNALS` signals of a satellite are taken. More peaks usually come from interference. For example, a swept
jammer can exceed the threshold at hundreds of code phases.

If a peak is present only while a stronger peak is absent, the two peaks are one signal before and after a jump. A
signal jumps where samples are missing (`e1_jump`). If `MAX_SIGNALS` peaks of a satellite were found, the search does
not look for jumps of this satellite.

The search cannot separate two signals whose code phases modulo 4 ms differ by less than 2 chips (586 m). If the weaker
signal is up to 600 m earlier, the default bank of correlators on E6 contains this signal. The search also does not find
a signal that is more than 16 dB weaker than the strongest signal.
"""

from __future__ import annotations

from collections import Counter
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

BLIND_CHIPS = 2.0  # distance in chips around a peak in which no second signal is taken
# largest number of signals of a satellite; the time of the searches on E6 grows with this number
MAX_SIGNALS = 8


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
    """Return every signal of `svids` on E1 in `batch`, in the order of `svids` and from strong to weak.

    Parameters
    ----------
    batch
        E1 samples, at least 8 ms; with the default of `periods`, up to 100 ms are used.
    overall_pfa
        Probability that noise alone gives any signal.
    doppler_span_hz, doppler_center_hz
        Half width and middle of the searched Dopplers, in Hz.
    periods
        K, largest number of code periods that are added non-coherently; 1 needs 8 ms of samples.
    signals
        Components whose powers are added.
    progress
        Function that is called with the number of finished satellites and the number of all satellites.
    jumped
        Function that is called with each jump because of which a weaker peak was left out.
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
    count = Counter(one.svid for one in found)
    for one in found:
        stronger = (other for other in kept if other.svid == one.svid and count[one.svid] < MAX_SIGNALS)
        jump = next(filter(None, (find_jump(batch, other, one, signals, periods) for other in stronger)), None)
        if jump is None:
            kept.append(one)
        elif jumped is not None:
            jumped(jump)
    return tuple(kept)


def separate(powers: CellPowers) -> tuple[Acquisition, ...]:
    """Return the signals in the powers of one satellite, the strongest first, `MAX_SIGNALS` at most."""
    # maximum over Doppler, because a signal occupies the same code phases at every Doppler
    best = np.max(powers.powers, axis=0)
    blind = int(np.ceil(BLIND_CHIPS / E1C.chip_rate_hz * powers.rate_hz))
    found: list[Acquisition] = []
    while len(found) < MAX_SIGNALS:
        column = int(np.argmax(best))
        if best[column] <= powers.threshold:
            return tuple(found)
        one = powers.acquisition(int(np.argmax(powers.powers[:, column])), column)
        if found and one.cn0_dbhz < found[0].cn0_dbhz - CROSS_CORRELATION_DB:
            return tuple(found)
        found.append(one)
        best[(column + np.arange(-blind, blind + 1)) % best.size] = 0.0  # code phases are cyclic
    return tuple(found)
