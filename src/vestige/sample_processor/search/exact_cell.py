"""Compute the exact value of a cell of the exhaustive search in complex128, and the peak of the signal in the cell.

A sum over chips n = 165 p + q at many frequencies is computed in two steps. The first step sums over q within each
piece p of 165 chips, as a matrix product. The second step sums over the pieces. So no large table of exponentials is
needed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex128, Float64

from vestige.records import ChipSequence, Handover, SampleSource
from vestige.sample_processor.search.engines.engine import CHIP_RATE_HZ
from vestige.sample_processor.search.half_chip_kernel import chip_sums, half_chip_sums
from vestige.sample_processor.search.peak import Peak, peak_at
from vestige.signals.definitions import CARRIER_HZ
from vestige.time import GalileoTime

_PIECE = 165  # number of chips in a piece; 1 ms has 5115 chips, which are 31 pieces
_FINE_BINS = np.linspace(-1.0, 1.0, 33)  # Doppler offsets in units of 1/(2 T), where T is the duration of the code


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """Cell of the exhaustive search: a code offset at the Doppler of a pass.

    Attributes
    ----------
    code
        Chips that are correlated.
    start_time
        Receiver-clock time at which the first chip arrives.
    middle_hz
        Doppler in Hz that is removed from carrier and code, the middle of the pass.
    """

    code: ChipSequence
    start_time: GalileoTime
    middle_hz: float


def exact_peak(
    source: SampleSource, cell: Cell, bins_hz: Float64[np.ndarray, " bins"], threshold: float
) -> Peak | None:
    """Return the peak at a cell, refined in Doppler and code phase; None if there is no peak.

    The result is None if no bin is above the threshold, or if the samples do not contain all chips.

    Parameters
    ----------
    bins_hz
        Doppler bins relative to `cell.middle_hz`, in Hz.
    threshold
        Threshold on the magnitude, in standard deviations of the noise per dimension.
    """
    wiped, noise = wiped_chips(source, cell)
    if noise == 0:
        return None
    magnitudes = np.abs(doppler_spectrum(wiped, bins_hz)) / np.sqrt(noise / 2)
    best = int(np.argmax(magnitudes))
    if magnitudes[best] <= threshold:
        return None
    fine_hz = bins_hz[best] + _FINE_BINS * CHIP_RATE_HZ / (2 * cell.code.n_chips)
    doppler_hz = cell.middle_hz + float(fine_hz[np.argmax(np.abs(doppler_spectrum(wiped, fine_hz)))])
    handover = Handover(
        svid=cell.code.svid,
        chips=cell.code,
        start_time=cell.start_time,
        doppler_hz=doppler_hz,
        doppler_rate_hz_per_s=0.0,
    )
    return peak_at(source, handover, threshold)


def wiped_chips(source: SampleSource, cell: Cell) -> tuple[Complex128[np.ndarray, " chips"], float]:
    """Return the sum of the samples in each chip, times the chip (±1), and the noise power of the sum of all chips."""
    n = cell.code.n_chips
    head = source.read(source.first_sample, 1)
    rate, carrier_hz = head.sample_rate_hz, CARRIER_HZ[head.band]
    code_rate = CHIP_RATE_HZ * (1 + cell.middle_hz / carrier_hz)
    low = max(int((cell.start_time - head.start) * rate) - 1, 0) + source.first_sample
    high = min(low + int((n + 1) / code_rate * rate) + 4, source.end_sample)
    batch = source.read(low, high - low)
    halves = np.empty((2, 2 * n + 1), np.float32)
    half_chip_sums(
        batch.samples.view(np.float32),
        batch.start - cell.start_time,
        1.0 / rate,
        code_rate,
        0.0,
        carrier_hz - batch.center_frequency_hz + cell.middle_hz,
        0.0,
        0,
        *halves,
    )
    even, odd = np.empty((2, n), np.float32), np.empty(n, np.float32)
    noise = sum(chip_sums(halves[part], even[part], odd) for part in (0, 1))
    return (even[0] + 1j * even[1].astype(np.float64)) * cell.code.chips, float(noise)


def doppler_spectrum(
    wiped: Complex128[np.ndarray, " chips"], frequencies_hz: Float64[np.ndarray, " bins"]
) -> Complex128[np.ndarray, " bins"]:
    """Return Σ_n wiped_n e^{−j2π f n / R_c} at the given frequencies f, where R_c is the chip rate."""
    pieces = wiped.reshape(-1, _PIECE)
    turn = -2j * np.pi / CHIP_RATE_HZ
    inner = pieces @ np.exp(turn * np.outer(np.arange(_PIECE), frequencies_hz))
    outer = np.exp(turn * np.outer(_PIECE * np.arange(pieces.shape[0]), frequencies_hz))
    return np.sum(inner * outer, axis=0)
