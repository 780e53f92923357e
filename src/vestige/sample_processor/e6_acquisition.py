"""Acquire E6-B and unencrypted E6-C and measure the C/N0, for the inspection of a recording.

Theory of operation
-------------------
The method is the same as in `vestige.sample_processor.acquisition` on E1. Stretches have two code periods (2 ms) and
start every period (1 ms). Each stretch is correlated with one period of code, so a symbol change between two periods
has no effect. The bins are 1/(2 ms) = 500 Hz apart. The powers of K stretches are added non-coherently, each shifted by
the code Doppler. The sum of noise alone is chi-squared with 2K degrees of freedom, which gives the threshold.

E6-C without encryption repeats its primary code every millisecond, with the signs of the secondary code CS100. An
encrypted E6-C has no repetition. So the primary code of E6-C, found over several periods, shows that E6-C is open. The
secondary code on these periods shows that no other signal was mistaken for E6-C.

The grid of the acquisition is coarse. The nearest point of the grid can be half a sample (0.47 chip at 5.5 MHz) and 250
Hz away from the peak. The power at this point is 6 dB lower than on the peak. So the C/N0 is measured on the peak, as
on E1 (`e1_snapshot`). A symbol of E6-B lasts one period, so the powers of the periods are added. First the Doppler is
refined. Let T be the period and δ the distance of the signal from the acquired Doppler. The signal has the amplitudes
A₊ and A₋ at ±1/2T around this Doppler. The amplitude follows sin(x)/x, so A₋/A₊ = (1/2T − δ)/(1/2T + δ) and δ = (A₊ −
A₋)/(A₊ + A₋)/2T. Then the code phase is refined, so that early and late amplitude are equal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Complex64, Complex128, Float32
from scipy import fft, special

from vestige.records import SampleBatch
from vestige.sample_processor.period_taps import peak_chips, period_taps
from vestige.signals.codes import primary_code, secondary_code
from vestige.signals.definitions import E6C, SignalDefinition

OPEN_SHARE = 0.3  # smallest share of the power that the secondary code of open E6-C explains; 100 ms of noise: 0.1
_PFA = 1e-6  # probability that noise alone gives an acquisition
# number of periods of 1 ms that are needed to distinguish the 100 phases of the secondary code; noise exceeds
# `OPEN_SHARE` in 79 % of the cases with 25 periods, and in less than 1 % with 50 periods
_MIN_PERIODS = 50
_TRANSFORM = 1024  # number of points of the FFT over the periods, which gives the residual Doppler
# number of iterations that measure the code phase; at 5 MHz the first iteration may end at the last tap, 0.45 chip away
_CODE_STEPS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class E6Acquisition:
    """Code phase and Doppler of a signal that was found on E6."""

    svid: int
    code_start_s: float  # time from the first sample to the start of the first full code period, [0, 1 ms)
    doppler_hz: float  # Doppler of the bin on E6, up to 250 Hz from the Doppler of the signal
    statistic: float  # non-coherent sum of powers, in units of the noise variance per dimension
    threshold: float  # threshold of the statistic, in units of the noise variance per dimension


def acquire_e6(
    batch: SampleBatch,
    signal: SignalDefinition,
    svid: int,
    *,
    doppler_hz: float = 0.0,
    doppler_span_hz: float = 500.0,
    max_stretches: int = 20,
) -> E6Acquisition | None:
    """Return the acquisition of a satellite's `signal` (E6-B or E6-C), or None if no power exceeds the threshold.

    Parameters
    ----------
    batch
        E6 samples of at least 2 ms.
    doppler_hz, doppler_span_hz
        Middle and half width of the searched Dopplers on E6, in Hz.
    max_stretches
        K, largest number of code periods that are added.
    """
    fs, period_s = batch.sample_rate_hz, signal.period_s
    n, phases = round(2 * period_s * fs), int(period_s * fs)
    starts = [start for m in range(max_stretches) if (start := round(m * period_s * fs)) + n <= batch.samples.size]
    if not starts:
        return None
    spacing = fs / n
    spectra = np.array([fft.fft(batch.samples[start : start + n]) for start in starts], np.complex64)
    code = _code_spectrum(signal, svid, n, fs)
    carrier_hz = signal.carrier_hz - batch.center_frequency_hz
    first, last = (round((carrier_hz + doppler_hz + side * doppler_span_hz) / spacing) for side in (-1, 1))
    powers = np.zeros((last - first + 1, phases), np.float32)
    for row, shift in zip(powers, range(first, last + 1), strict=True):
        _add(row, np.roll(spectra, -shift, axis=1) * code, shift * spacing - carrier_hz, starts, fs, signal)
    noise = np.mean(powers, axis=1, keepdims=True) / (2 * len(starts))
    powers /= np.maximum(noise, np.finfo(np.float32).tiny)
    threshold = 2.0 * float(special.gammainccinv(len(starts), _PFA / powers.size))
    best, column = np.unravel_index(int(np.argmax(powers)), powers.shape)
    statistic = float(powers[best, column])
    if statistic <= threshold:
        return None
    return E6Acquisition(
        svid=svid,
        code_start_s=int(column) / fs % period_s,
        doppler_hz=(first + int(best)) * spacing - carrier_hz,
        statistic=statistic,
        threshold=threshold,
    )


def cn0_on_the_peak_dbhz(batch: SampleBatch, signal: SignalDefinition, found: E6Acquisition) -> float:
    """Return the C/N0 of an acquired signal in dBHz at the refined code phase and Doppler; NaN without a whole period.

    The replica has the same pulse as in the correlation of the RECS, and the noise floor is estimated in the same way.
    So the C/N0 includes the loss of a filter in the front end.

    Parameters
    ----------
    batch
        E6 samples in which the signal was acquired. All complete periods in the batch are used.
    signal
        E6-B or E6-C.
    found
        Acquisition of `signal` in `batch`.

    Examples
    --------
    Without noise, wrong codes correlate only with the code itself. The C/N0 is then 10 log₁₀ of the chip rate in Hz.

    >>> from vestige.records import Band
    >>> from vestige.signals.definitions import E6B
    >>> from vestige.time import GalileoTime
    >>> chips = primary_code(E6B, 11)[np.arange(50_000) // 2 % 5115]
    >>> batch = SampleBatch(
    ...     band=Band.E6, samples=chips.astype(np.complex64), sample_rate_hz=2 * E6B.chip_rate_hz,
    ...     center_frequency_hz=E6B.carrier_hz, first_sample=0, start=GalileoTime(1372, 0),
    ... )
    >>> round(cn0_on_the_peak_dbhz(batch, E6B, acquire_e6(batch, E6B, 11)), 1)
    67.1
    """
    doppler_hz = found.doppler_hz + _doppler_error_hz(batch, signal, found)
    start_s = found.code_start_s
    for _ in range(_CODE_STEPS):
        taps, _ = period_taps(batch, signal, found.svid, start_s, doppler_hz)
        if not taps.size:
            return float("nan")
        late_chips = peak_chips(np.sqrt(np.sum(np.abs(taps) ** 2, axis=0)))
        start_s = (start_s + late_chips / signal.chip_rate_hz) % signal.period_s
    prompts, noise = period_taps(batch, signal, found.svid, start_s, doppler_hz, np.zeros(1))
    snr = _power(prompts, noise) / max(noise, np.finfo(np.float64).tiny)
    return float(10 * np.log10(max(snr, 1e-12) / signal.period_s))


def _doppler_error_hz(batch: SampleBatch, signal: SignalDefinition, found: E6Acquisition) -> float:
    """Return how far the signal's Doppler is above the acquired Doppler, in Hz."""
    side_hz = 0.5 / signal.period_s
    amplitudes = []
    for by_hz in (-side_hz, side_hz):  # only the carrier is shifted, not the code
        shifted = replace(batch, center_frequency_hz=batch.center_frequency_hz - by_hz)
        prompts, noise = period_taps(shifted, signal, found.svid, found.code_start_s, found.doppler_hz, np.zeros(1))
        amplitudes.append(_power(prompts, noise) ** 0.5)
    below, above = amplitudes
    return side_hz * (above - below) / max(above + below, np.finfo(np.float64).tiny)


def _power(prompts: Complex128[np.ndarray, "periods 1"], noise: float) -> float:
    """Return the mean power of the prompts minus the noise power, but at least 0."""
    return max(float(np.mean(np.abs(prompts) ** 2)) - noise, 0.0) if prompts.size else 0.0


def secondary_share(batch: SampleBatch, found: E6Acquisition, doppler_hz: float) -> tuple[float, int] | None:
    """Return the share of E6-C's power that its secondary code explains, and the code's index in the first period.

    The share is 1 for open E6-C without noise. For noise or another secondary code the share is about 0.1 with 100
    periods and 0.2 with 50 periods, below `OPEN_SHARE`. The result is None if the batch has fewer than 50 periods.

    Parameters
    ----------
    found
        Acquisition of E6-C in `batch`.
    doppler_hz
        Doppler of the signal on E6, with an error of at most ±250 Hz.
    """
    taps, _ = period_taps(batch, E6C, found.svid, found.code_start_s, doppler_hz, np.zeros(1))
    prompts = taps[: E6C.secondary_length, 0]
    if prompts.size < _MIN_PERIODS:
        return None
    code = secondary_code(E6C, found.svid).astype(np.float64)
    phases = (np.arange(code.size)[:, None] + np.arange(prompts.size)[None, :]) % code.size
    power = np.max(np.abs(fft.fft(code[phases] * prompts, _TRANSFORM, axis=1)) ** 2, axis=1)
    best = int(np.argmax(power))
    whole = prompts.size * float(np.sum(np.abs(prompts) ** 2))
    return float(power[best]) / max(whole, np.finfo(np.float64).tiny), best


def _code_spectrum(signal: SignalDefinition, svid: int, n: int, fs: float) -> Complex64[np.ndarray, " n"]:
    chips = primary_code(signal, svid)
    replica = np.zeros(n, np.float32)
    t = np.arange(int(signal.period_s * fs)) / fs
    replica[: t.size] = chips[np.minimum((t * signal.chip_rate_hz).astype(np.int64), chips.size - 1)]
    return np.conj(fft.fft(replica)).astype(np.complex64)


def _add(
    total: Float32[np.ndarray, " phases"],
    products: Complex64[np.ndarray, "stretches n"],
    doppler_hz: float,
    starts: list[int],
    fs: float,
    signal: SignalDefinition,
) -> None:
    """Add the powers of all stretches to `total`, each moved back to the code phase of the first stretch."""
    y = fft.ifft(products, axis=1, overwrite_x=True)[:, : total.size]
    for m, (row, start) in enumerate(zip(y, starts, strict=True)):
        drift = (-start * doppler_hz / signal.carrier_hz) + m * signal.period_s * fs - start
        total += np.roll(row.real**2 + row.imag**2, -round(drift))
