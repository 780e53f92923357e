"""Correlate every code period of a batch around an acquired code phase, and find the delay of the correlation peak.

The modules `e1_snapshot` and `e6_acquisition` measure E1 and E6 with the functions of this module. An acquisition on E6
finds the code phase with an error of up to half a sample, which is about half a chip at 5.5 MHz. The taps around the
acquired code phase show how far away the peak is.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Complex128, Float64

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records import ChipSequence, Handover, SampleBatch
from vestige.sample_processor.correlator import correlate
from vestige.signals.codes import primary_code
from vestige.signals.definitions import SignalDefinition
from vestige.signals.pulse import BPSK

# Delays of the taps in chips, 0.05 chip apart. The main peak of BOC(1,1) extends to ±1/3 chip. The peak of BPSK extends
# to ±1 chip.
TAPS_CHIPS = np.linspace(-0.6, 0.6, 25)
_EARLY_LATE_TAPS = 3  # number of taps from prompt to early and late: ±0.15 chip, on the flanks of the main peak


def period_taps(
    batch: SampleBatch,
    signal: SignalDefinition,
    svid: int,
    start_s: float,
    doppler_hz: float,
    taps_chips: Float64[np.ndarray, " taps"] = TAPS_CHIPS,
) -> tuple[Complex128[np.ndarray, "periods taps"], float]:
    """Return the taps of every full period in the batch, with phases relative to one carrier, and the noise power.

    The replica is BPSK on E6 and BOC(1,1) on E1.

    Parameters
    ----------
    batch
        Samples of the signal's band.
    start_s
        Time from the first sample to the start of the first code period, in s.
    doppler_hz
        Doppler in Hz on the carrier of the signal.
    taps_chips
        Delays of the taps after the expected start, in chips.

    Examples
    --------
    >>> from vestige.records import Band
    >>> from vestige.signals.definitions import E6B
    >>> from vestige.time import GalileoTime
    >>> chips = primary_code(E6B, 11)[np.arange(50_000) // 2 % 5115]
    >>> batch = SampleBatch(
    ...     band=Band.E6, samples=chips.astype(np.complex64), sample_rate_hz=2 * E6B.chip_rate_hz,
    ...     center_frequency_hz=E6B.carrier_hz, first_sample=0, start=GalileoTime(1372, 0),
    ... )
    >>> taps, _ = period_taps(batch, E6B, 11, 0.0, 0.0, np.array([0.0]))
    >>> taps.shape, round(float(abs(taps[0, 0])), 3)
    ((4, 1), 1.0)
    """
    chips = primary_code(signal, svid)
    per_chip = 1
    if signal.pulse != BPSK:  # BOC(1,1) is a code of twice the rate, in which each chip is followed by its negative
        chips, per_chip = np.kron(chips, np.array([1, -1], np.int8)).astype(np.int8), 2
    sequence = ChipSequence.of(
        svid=svid, transmit_time=batch.start, chip_rate_hz=per_chip * signal.chip_rate_hz, chips=chips
    )
    offsets_m = taps_chips / signal.chip_rate_hz * SPEED_OF_LIGHT_MPS
    period_s = signal.period_s / (1 + doppler_hz / signal.carrier_hz)
    carrier_hz = signal.carrier_hz - batch.center_frequency_hz + doppler_hz
    rows: list[Complex128[np.ndarray, " taps"]] = []
    noise: list[float] = []
    for m in range(int(batch.samples.size / batch.sample_rate_hz / period_s) + 1):
        at_s = start_s + m * period_s
        handover = Handover(
            svid=svid,
            chips=sequence,
            start_time=batch.start + at_s,
            doppler_hz=doppler_hz,
            doppler_rate_hz_per_s=0.0,
        )
        bank = correlate(batch, handover, offsets_m)
        if bank is None:
            if rows:
                break
            start_s += period_s  # the first tap of the first period may lie before the first sample
            continue
        rows.append(bank.taps * np.exp(-2j * np.pi * (carrier_hz * m * period_s)))
        noise.append(bank.noise_power)
    return np.array(rows, np.complex128).reshape(len(rows), taps_chips.size), float(np.mean(noise)) if noise else 0.0


def peak_chips(magnitudes: Float64[np.ndarray, " taps"]) -> float:
    """Return the delay of the peak after the middle tap in chips, at which early and late magnitude are equal.

    If the magnitudes have no such delay, the result is the delay of the tap with the largest magnitude within 0.4 chip.

    Parameters
    ----------
    magnitudes
        Magnitude at each of `TAPS_CHIPS`.

    Examples
    --------
    >>> round(peak_chips(1 - np.abs(TAPS_CHIPS - 0.12)), 6)
    0.12
    """
    inner = np.arange(_EARLY_LATE_TAPS, TAPS_CHIPS.size - _EARLY_LATE_TAPS)
    late_minus_early = magnitudes[inner + _EARLY_LATE_TAPS] - magnitudes[inner - _EARLY_LATE_TAPS]
    peak = int(np.argmax(np.where(np.abs(TAPS_CHIPS[inner]) < 0.4, magnitudes[inner], 0.0)))
    for i in sorted(range(inner.size - 1), key=lambda i: abs(i - peak)):
        a, b = late_minus_early[i], late_minus_early[i + 1]
        if a > 0 >= b:
            step = TAPS_CHIPS[1] - TAPS_CHIPS[0]
            return float(TAPS_CHIPS[inner[i]] + step * a / (a - b))
    return float(TAPS_CHIPS[inner[peak]])
