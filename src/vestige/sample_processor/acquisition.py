"""Acquire E1-C: find which satellites are in the samples, at which code phase and Doppler.

Theory of operation
-------------------
The samples are cut into stretches of two code periods (8 ms). A stretch starts every period (4 ms). Correlating a
stretch with one period of code gives all code phases of 4 ms without wrap-around. So a sign change of the secondary
code between two periods has no effect. One FFT of a stretch is enough for all Dopplers. The bins of the FFT are 1/(8
ms) = 125 Hz apart, and a shift by one bin gives the next Doppler. Only the bins around the carrier are kept. This
selection mixes, filters and decimates the samples in one step.

The powers of K stretches are added non-coherently, each shifted by the code Doppler. For noise alone with variance 1
per dimension, the sum is chi-squared with 2K degrees of freedom. The threshold follows from the overall false-alarm
probability over all cells (code phases × Doppler bins × satellites) [WFO, Sec. III-D].

Cross-correlation with a much stronger satellite does not average out like noise, because the codes of both satellites
repeat in every period. The cross-correlation of two memory codes with different Dopplers reaches −20 dB. The rough C/N0
of the strong satellite is up to 3 dB too low, because of self-noise and a Doppler up to half a bin away. Noise adds to
the power of the weak satellite. So a signal is accepted only if its C/N0 is less than `CROSS_CORRELATION_DB` below the
C/N0 of the strongest signal.

`acquire` takes the strongest cell of each satellite on E1-C. `vestige.sample_processor.search.e1_search` takes every
signal from the powers of E1-B and E1-C.

The replica is BOC(1,1), the part of CBOC that a front end with a bandwidth of 2 to 4 MHz passes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex64, Float32, Float64, Int64
from scipy import fft, special

from vestige.constants import E1_CARRIER_HZ, E1_CODE_PERIOD_S
from vestige.records import SampleBatch
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1C, SignalDefinition

CROSS_CORRELATION_DB = 16.0  # largest difference of C/N0 between the strongest signal and an accepted signal
MAX_STRETCHES = 24  # number of stretches in 100 ms, one secondary-code period; later samples are not searched
_TRANSFORMS_AT_ONCE = 4  # number of FFTs of one length that scipy computes in the lanes of a vector
_SEARCH_BANDWIDTH_HZ = 4.0e6  # both main lobes of BOC(1,1), with 86 % of the power; code phases are 0.26 chip apart


@dataclass(frozen=True, slots=True, kw_only=True)
class Acquisition:
    """Code phase, Doppler and C/N0 of a signal that was found on E1."""

    svid: int
    code_start_s: float  # time from the first sample to the start of the first full code period, [0, 4 ms)
    doppler_hz: float  # Doppler of the bin, up to 62.5 Hz from the Doppler of the signal
    statistic: float  # non-coherent sum of powers, in units of the noise variance per dimension
    threshold: float  # threshold of the statistic, in units of the noise variance per dimension
    cn0_dbhz: float  # rough C/N0 of E1-C, up to 4 dB too low (half a code step, half a Doppler bin, self-noise)


def acquire(
    batch: SampleBatch,
    svids: Iterable[int],
    *,
    overall_pfa: float = 1e-3,
    doppler_span_hz: float = 5000.0,
    doppler_center_hz: float = 0.0,
    max_stretches: int = MAX_STRETCHES,
    bin_step: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Acquisition, ...]:
    """Return an acquisition of each satellite of `svids` whose E1-C was found in `batch`.

    The batch must have at least 8 ms of samples. At most `max_stretches` stretches are added; 24 stretches last 100 ms.
    The searched Dopplers are every `bin_step`-th bin of 125 Hz within `doppler_span_hz` of `doppler_center_hz`.
    `overall_pfa` is the probability that noise alone gives any acquisition. `progress` is called with the number of
    finished satellites and the number of all satellites.
    """

    def strongest(powers: CellPowers) -> tuple[Acquisition, ...]:
        cell = np.unravel_index(int(np.argmax(powers.powers)), powers.powers.shape)
        best = powers.acquisition(int(cell[0]), int(cell[1]))
        return (best,) if best.statistic > powers.threshold else ()

    return search_cells(
        batch,
        tuple(svids),
        strongest,
        max_stretches=max_stretches,
        overall_pfa=overall_pfa,
        doppler_span_hz=doppler_span_hz,
        doppler_center_hz=doppler_center_hz,
        bin_step=bin_step,
        progress=progress,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CellPowers:
    """Powers of one satellite over Doppler and code phase, in units of the noise variance per dimension."""

    svid: int
    # non-coherent sums; a sum of noise alone is chi-squared with `2 · n_added` degrees of freedom
    powers: Float32[np.ndarray, "bins phases"]
    doppler_hz: Float64[np.ndarray, " bins"]
    rate_hz: float  # number of code phases per second
    n_added: int  # number of squared magnitudes in each sum
    # Threshold of a cell. The overall false-alarm probability is the probability that noise alone exceeds the threshold
    # in any cell of the search.
    threshold: float

    def acquisition(self, row: int, column: int) -> Acquisition:
        """Return the acquisition that one cell gives."""
        statistic = float(self.powers[row, column])
        snr = max(statistic / (2 * self.n_added) - 1.0, 1e-3)
        return Acquisition(
            svid=self.svid,
            code_start_s=(column / self.rate_hz) % E1_CODE_PERIOD_S,
            doppler_hz=float(self.doppler_hz[row]),
            statistic=statistic,
            threshold=self.threshold,
            cn0_dbhz=float(10 * np.log10(snr / E1_CODE_PERIOD_S)),
        )


def search_cells(
    batch: SampleBatch,
    svids: tuple[int, ...],
    choose: Callable[[CellPowers], tuple[Acquisition, ...]],
    *,
    signals: tuple[SignalDefinition, ...] = (E1C,),
    max_stretches: int = MAX_STRETCHES,
    overall_pfa: float,
    doppler_span_hz: float,
    doppler_center_hz: float = 0.0,
    bin_step: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Acquisition, ...]:
    """Return the results of `choose` for every satellite, without signals that may be cross-correlation.

    `choose` returns the signals in the powers of one satellite. The powers of the components `signals` are added over
    at most `max_stretches` stretches. `overall_pfa` is the probability that noise alone exceeds the threshold in any
    cell of any satellite.
    """
    stretches = _stretches(batch, abs(doppler_center_hz) + doppler_span_hz, max_stretches)
    n_added = len(stretches.starts_s) * len(signals)
    if n_added == 0 or not svids:
        return ()
    reach = int(doppler_span_hz / stretches.spacing_hz)
    shifts = np.arange(-reach, reach + 1, bin_step) + round(doppler_center_hz / stretches.spacing_hz)
    cells = len(svids) * shifts.size * stretches.n_phases
    threshold = 2.0 * float(special.gammainccinv(n_added, -np.expm1(np.log1p(-overall_pfa) / cells)))

    def search(svid: int) -> tuple[Acquisition, ...]:
        powers = CellPowers(
            svid=svid,
            powers=_cell_powers(svid, signals, stretches, shifts),
            doppler_hz=shifts * stretches.spacing_hz - stretches.carrier_rest_hz,
            rate_hz=stretches.rate_hz,
            n_added=n_added,
            threshold=threshold,
        )
        return choose(powers)

    found: list[Acquisition] = []
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        for done, signals_of_one in enumerate(pool.map(search, svids), start=1):
            if progress is not None:
                progress(done, len(svids))
            found.extend(signals_of_one)
    floor = max((one.cn0_dbhz for one in found), default=0.0) - CROSS_CORRELATION_DB
    return tuple(one for one in found if one.cn0_dbhz > floor)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stretches:
    """Spectra of all stretches around the E1 carrier."""

    spectra: Complex64[np.ndarray, "stretches bins"]
    starts_s: list[float]
    spacing_hz: float
    carrier_rest_hz: float  # carrier frequency minus the frequency of the nearest bin
    guard: int  # number of additional bins on each side for the Doppler shift

    @property
    def kept(self) -> int:
        """Number of bins of the decimated signal."""
        return self.spectra.shape[1] - 2 * self.guard

    @property
    def rate_hz(self) -> float:
        """Sampling rate of the decimated signal in Hz."""
        return self.kept * self.spacing_hz

    @property
    def n_phases(self) -> int:
        """Number of code phases in a code period."""
        return int(E1_CODE_PERIOD_S * self.rate_hz)


def _stretches(batch: SampleBatch, doppler_span_hz: float, max_stretches: int) -> _Stretches:
    """Return the spectra of the first `max_stretches` stretches, without stretches that end after the batch."""
    fs = batch.sample_rate_hz
    n = round(2 * E1_CODE_PERIOD_S * fs)
    starts = (round(m * E1_CODE_PERIOD_S * fs) for m in range(max_stretches))
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
    return _Stretches(
        spectra=spectra,
        starts_s=[start / fs for start in first],
        spacing_hz=spacing,
        carrier_rest_hz=carrier_hz - carrier_bin * spacing,
        guard=guard,
    )


def _cell_powers(
    svid: int, signals: tuple[SignalDefinition, ...], stretches: _Stretches, shifts: Int64[np.ndarray, " bins"]
) -> Float32[np.ndarray, "bins phases"]:
    """Return the powers of one satellite in units of the noise variance per dimension."""
    codes = [_code_spectrum(signal, svid, stretches.kept, stretches.rate_hz) for signal in signals]
    rows = len(stretches.starts_s)
    n_added = rows * len(signals)
    powers = np.zeros((shifts.size, stretches.n_phases), np.float32)
    together = -(-_TRANSFORMS_AT_ONCE // rows)
    products = np.empty((together, rows, stretches.kept), np.complex64)
    for begin in range(0, shifts.size, together):
        group = shifts[begin : begin + together]
        for code in codes:
            for product, low in zip(products, (stretches.guard + group).tolist(), strict=False):
                np.multiply(stretches.spectra[:, low : low + stretches.kept], code, out=product)
            y = fft.ifft(products[: group.size], axis=2, overwrite_x=True)[..., : stretches.n_phases]
            for total, shift, of_shift in zip(powers[begin : begin + together], group.tolist(), y, strict=True):
                doppler_hz = shift * stretches.spacing_hz - stretches.carrier_rest_hz
                _add_with_code_doppler(total, of_shift, doppler_hz, stretches.starts_s, stretches.rate_hz)
    noise = np.mean(powers, axis=1, keepdims=True) / (2 * n_added)  # a signal fills few of 16,000 code phases
    powers /= np.maximum(noise, np.finfo(np.float32).tiny)  # the noise is 0 if all samples are 0
    return powers


def _add_with_code_doppler(
    total: Float32[np.ndarray, " phases"],
    y: Complex64[np.ndarray, "stretches phases"],
    doppler_hz: float,
    starts_s: list[float],
    rate_hz: float,
) -> None:
    """Add the powers |y|² of all stretches to `total`, each moved back to the code phase of the first stretch."""
    for row, start_s in zip(y, starts_s, strict=True):
        squares = np.square(row.view(np.float32))
        power = squares[::2] + squares[1::2]
        nominal = start_s / E1_CODE_PERIOD_S
        drift_s = -start_s * doppler_hz / E1_CARRIER_HZ + (round(nominal) * E1_CODE_PERIOD_S - start_s)
        shift = round(drift_s * rate_hz) % power.size
        total[: power.size - shift] += power[shift:]
        total[power.size - shift :] += power[:shift]


def _code_spectrum(signal: SignalDefinition, svid: int, kept: int, rate_hz: float) -> Complex64[np.ndarray, " bins"]:
    """Return the conjugate spectrum of one code period with BOC(1,1), in the order of the kept bins."""
    t = np.arange(int(E1_CODE_PERIOD_S * rate_hz)) / rate_hz
    half_chips = (t * 2 * signal.chip_rate_hz).astype(np.int64)
    replica = np.zeros(kept, np.float32)
    replica[: t.size] = primary_code(signal, svid)[half_chips // 2] * (1 - 2 * (half_chips % 2))
    return np.conj(fft.fftshift(fft.fft(replica)))
