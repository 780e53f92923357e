"""Acquisition of E1-C: which satellites are in the samples, at which code phase and Doppler.

Theory of operation
-------------------
The samples are cut into stretches of two code periods (8 ms), one stretch
every period (4 ms). Correlating a stretch with one period of code gives all code phases of 4 ms without wrap-around,
so a secondary-code flip between two periods does not hurt. One FFT serves every Doppler bin: its bins are 1/(8 ms) =
125 Hz = 1/(2T) apart, and a shift by one bin is the next Doppler. Only the bins around the carrier are kept, which
mixes, filters and decimates in one step.

The powers of K stretches are added non-coherently, each shifted by the code Doppler. Against noise of variance 1 per
dimension the sum is chi-squared with 2K degrees of freedom; the threshold follows from the overall false-alarm
probability over all cells (code phases × Doppler bins × satellites) [WFO, Sec. III-D].

Cross-correlation with a much stronger satellite is not noise: it stands still for the whole 100 ms. Between two
memory codes at a Doppler difference it reaches −20 dB; the rough C/N0 of the strong one is low by up to 3 dB (its own
self-noise, half a bin off), and noise adds to the weak one. So a cell is only accepted within `CROSS_CORRELATION_DB`
of the strongest.

The replica is BOC(1,1), the part of CBOC that a 2 to 4 MHz front end passes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex64, Float32
from scipy import fft, special

from vestige.constants import E1_CARRIER_HZ, E1_CODE_PERIOD_S
from vestige.records import SampleBatch
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1C

CROSS_CORRELATION_DB = 16.0  # below the strongest satellite; see above
MAX_STRETCHES = 24  # 100 ms: one secondary-code period; longer batches are searched in their first 100 ms
_SEARCH_BANDWIDTH_HZ = 4.0e6  # both main lobes of BOC(1,1), 86 % of its power; code phases 0.26 chip apart


@dataclass(frozen=True, slots=True, kw_only=True)
class Acquisition:
    """A satellite found on E1-C.

    Attributes
    ----------
    code_start_s
        Time from the first sample to the start of the first full code period, [0, 4 ms).
    doppler_hz
        Doppler to ±62.5 Hz.
    statistic, threshold
        Non-coherent sum and its threshold, in units of the noise variance per dimension.
    cn0_dbhz
        Rough C/N0 of E1-C, low by up to 4 dB (half a code step, half a Doppler bin, self-noise).
    """

    svid: int
    code_start_s: float
    doppler_hz: float
    statistic: float
    threshold: float
    cn0_dbhz: float


def acquire(
    batch: SampleBatch,
    svids: Iterable[int],
    *,
    overall_pfa: float = 1e-3,
    doppler_span_hz: float = 5000.0,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Acquisition, ...]:
    """Return the satellites of `svids` that are on E1-C in `batch`.

    Parameters
    ----------
    batch
        E1 samples, at least 8 ms; up to 100 ms are used.
    overall_pfa
        Probability that noise alone gives any acquisition.
    doppler_span_hz
        Searched from −span to +span.
    progress
        Called with the number of satellites that are done, and of all, as the search goes on.
    """
    svids = tuple(svids)
    spectra, rate_hz, starts_s, band = _stretch_spectra(batch, doppler_span_hz)
    if spectra.shape[0] == 0 or not svids:
        return ()
    n_phases = int(E1_CODE_PERIOD_S * rate_hz)
    bins = np.arange(-int(doppler_span_hz / band.spacing_hz), int(doppler_span_hz / band.spacing_hz) + 1)
    cells = len(svids) * bins.size * n_phases
    pfa = -np.expm1(np.log1p(-overall_pfa) / cells)
    threshold = 2.0 * float(special.gammainccinv(spectra.shape[0], pfa))

    def search(svid: int) -> Acquisition:
        return _search_one(svid, spectra, rate_hz, starts_s, band, bins, n_phases, threshold)

    best = []
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        for done, cell in enumerate(pool.map(search, svids), start=1):
            if progress is not None:
                progress(done, len(svids))
            if cell.statistic > threshold:
                best.append(cell)
    floor = max((cell.cn0_dbhz for cell in best), default=0.0) - CROSS_CORRELATION_DB
    return tuple(cell for cell in best if cell.cn0_dbhz > floor)


@dataclass(frozen=True, slots=True)
class _Band:
    """The FFT bins kept around the E1 carrier."""

    spacing_hz: float
    carrier_bin: int  # the kept bin next to the carrier
    carrier_rest_hz: float  # carrier minus that bin
    guard: int  # bins kept on each side for the Doppler shift


def _stretch_spectra(
    batch: SampleBatch, doppler_span_hz: float
) -> tuple[Complex64[np.ndarray, "stretches bins"], float, list[float], _Band]:
    """Return the spectra of all stretches around the carrier, the decimated rate, the start times and the band."""
    fs = batch.sample_rate_hz
    n = round(2 * E1_CODE_PERIOD_S * fs)
    starts = (round(m * E1_CODE_PERIOD_S * fs) for m in range(MAX_STRETCHES))
    first = [start for start in starts if start + n <= batch.samples.size]
    spacing = fs / n
    kept = min(fft.next_fast_len(int(_SEARCH_BANDWIDTH_HZ / spacing)), n)
    guard = int(doppler_span_hz / spacing) + 1
    carrier_hz = E1_CARRIER_HZ - batch.center_frequency_hz
    carrier_bin = round(carrier_hz / spacing)
    indices = (np.arange(kept + 2 * guard) - kept // 2 - guard + carrier_bin) % n
    spectra = np.empty((len(first), indices.size), np.complex64)
    for row, start in enumerate(first):
        spectra[row] = fft.fft(batch.samples[start : start + n])[indices]
    band = _Band(spacing, carrier_bin, carrier_hz - carrier_bin * spacing, guard)
    return spectra, kept * spacing, [start / fs for start in first], band


def _search_one(
    svid: int,
    spectra: Complex64[np.ndarray, "stretches bins"],
    rate_hz: float,
    starts_s: list[float],
    band: _Band,
    bins: np.ndarray,
    n_phases: int,
    threshold: float,
) -> Acquisition:
    """Return the strongest cell of one satellite."""
    kept = spectra.shape[1] - 2 * band.guard
    code = _code_spectrum(svid, kept, rate_hz)
    best = (-1.0, 0, 0.0)
    for shift in bins:
        doppler_hz = float(shift) * band.spacing_hz - band.carrier_rest_hz
        product = spectra[:, band.guard + shift : band.guard + shift + kept] * code
        y = fft.ifft(product, axis=1, overwrite_x=True)[:, :n_phases]
        total = _add_with_code_doppler(y, doppler_hz, starts_s, rate_hz)
        peak = int(np.argmax(total))
        noise = float(np.mean(total)) / (2 * spectra.shape[0])  # variance per dimension; the peak is 1 of 12,000 cells
        if total[peak] / noise > best[0]:
            best = (float(total[peak]) / noise, peak, doppler_hz)
    statistic, peak, doppler_hz = best
    k = spectra.shape[0]
    snr = max(statistic / (2 * k) - 1.0, 1e-3)
    return Acquisition(
        svid=svid,
        code_start_s=(peak / rate_hz) % E1_CODE_PERIOD_S,
        doppler_hz=doppler_hz,
        statistic=statistic,
        threshold=threshold,
        cn0_dbhz=float(10 * np.log10(snr / E1_CODE_PERIOD_S)),
    )


def _add_with_code_doppler(
    y: Complex64[np.ndarray, "stretches phases"], doppler_hz: float, starts_s: list[float], rate_hz: float
) -> Float32[np.ndarray, " phases"]:
    """Return Σ|y|² with every stretch moved back to the code phase of the first."""
    total = np.zeros(y.shape[1], np.float32)
    for row, start_s in zip(y, starts_s, strict=True):
        power = row.real**2 + row.imag**2
        nominal = start_s / E1_CODE_PERIOD_S
        drift_s = -start_s * doppler_hz / E1_CARRIER_HZ + (round(nominal) * E1_CODE_PERIOD_S - start_s)
        total += np.roll(power, -round(drift_s * rate_hz))
    return total


def _code_spectrum(svid: int, kept: int, rate_hz: float) -> Complex64[np.ndarray, " bins"]:
    """Return the conjugate spectrum of one period of BOC(1,1) code, in the order of the kept bins."""
    t = np.arange(int(E1_CODE_PERIOD_S * rate_hz)) / rate_hz
    half_chips = (t * 2 * E1C.chip_rate_hz).astype(np.int64)
    replica = np.zeros(kept, np.float32)
    replica[: t.size] = primary_code(E1C, svid)[half_chips // 2] * (1 - 2 * (half_chips % 2))
    return np.conj(fft.fftshift(fft.fft(replica)))
