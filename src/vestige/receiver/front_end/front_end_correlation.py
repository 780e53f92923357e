"""Compute correlation functions of signal and noise behind a front end, for correlators without samples.

Theory of operation
-------------------
h are the filter's taps at the input rate f_i. f_s is the output rate, and Λ is the triangle of rectangular chips. R_h
is a correlator's output at distance x from a path of unit amplitude. R_n is the covariance of the noise in two
correlators δ apart:

    R_h(x) = Σ_k h_k Λ(k/f_i − x) / Σ h
    R_n(δ) = (f_i/f_s) Σ_m r[m] Λ(m/f_s − δ) / (Σ h)²,     r[m] = Σ_k h_k h_{k + m f_i/f_s}

Without a front end R_h(0) and R_n(0) are 1. The unit of R_h is the amplitude of the path. The unit of R_n is
1/(C/N0 · T), the noise variance of a correlator without a front end. The replica is not filtered. f_s must not be
commensurate with the chip rate, because the samples must be spread over the chip. For a filter with steep edges and
high rates f_i and f_s, both functions approach the band-limited autocorrelation R_B. With a quantiser, Σ_k (c_k/c_1)²
r^k replaces r (`quantiser.py`). The formula is valid if the signals are weak against the noise in a sample.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.front_end.quantiser import QUANTISERS
from vestige.signals.definitions import E6C
from vestige.signals.pulse import BPSK, autocorrelation
from vestige.theory.range_offset import range_offset_m

LARGEST_SIGNAL_DB = -20.0  # C/N0 divided by the sampling rate, at which a signal adds 1 % to the quantised power


def signal_correlation(front_end: FrontEnd, delay_chips: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return R_h, the correlation of a signal with the replica."""
    taps = front_end.filter_taps().astype(np.float64)
    lags = (np.arange(taps.size) - taps.size // 2) * (E6C.chip_rate_hz / front_end.input_rate_hz)
    return _smoothed(delay_chips, taps, lags) / np.sum(taps)


def noise_correlation(front_end: FrontEnd, delay_chips: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return R_n, the covariance of the noise in two correlators.

    The loss of the front end is R_n(0)/R_h(0)².
    """
    taps = front_end.filter_taps().astype(np.float64)
    every = np.correlate(taps, taps, mode="full")[(taps.size - 1) % front_end.oversampling :: front_end.oversampling]
    lags = (np.arange(every.size) - every.size // 2) * (E6C.chip_rate_hz / front_end.sample_rate_hz)
    if front_end.bits is not None:
        every = QUANTISERS[front_end.bits].noise_correlation(every / every[every.size // 2])
    return front_end.oversampling * _smoothed(delay_chips, every, lags) / np.sum(taps) ** 2


@lru_cache(maxsize=4)
def code_noise_density_s(front_end: FrontEnd) -> float:
    """Return κ in s, the factor in the noise density κ c N0 that another code with the C/N0 c adds.

    r[m] is the autocorrelation of the filter at the input rate. The sum takes every f_i/f_s-th lag:

        κ = 1/f_s Σ_m (Λ ∗ r)[m] Λ(m/f_s) / ((Σ h)² R_n(0))

    In continuous time without a front end, κ is 2/(3 R_c), 0.13 µs, where R_c is the chip rate. Sampling folds side
    lobes into the band. A filter passes a larger share of the code's power than of the power of white noise.
    """
    taps = front_end.filter_taps().astype(np.float64)
    chips_a_sample = E6C.chip_rate_hz / front_end.input_rate_hz
    within = int(np.ceil(1 / chips_a_sample))
    triangle = autocorrelation(BPSK, np.arange(-within, within + 1) * chips_a_sample)
    received = np.convolve(np.correlate(taps, taps, mode="full"), triangle)
    middle, every = received.size // 2, front_end.oversampling
    lags = np.arange(-(within // every), within // every + 1) * every
    behind = received[middle + lags] @ autocorrelation(BPSK, lags * chips_a_sample)
    noise = float(noise_correlation(front_end, np.zeros(1))[0])
    return float(behind / (front_end.sample_rate_hz * np.sum(taps) ** 2 * noise))


def range_offset_scale(front_end: FrontEnd, spacing_m: float) -> float:
    """Return the growth of a range offset in m for each metre of delay; 1 without a filter.

    The range offset assumes that three taps lie on a triangle [WFO, Sec. III-C], but behind a filter the peak is round.
    The result is the slope of the least-squares line over delays up to a quarter of the spacing. Without an attack most
    range offsets lie in this interval.
    """
    delay_m = np.linspace(-spacing_m / 4, spacing_m / 4, 41)
    offsets_m = spacing_m * np.array([-1.0, 0.0, 1.0])
    chips = np.subtract.outer(-delay_m, -offsets_m) * (E6C.chip_rate_hz / SPEED_OF_LIGHT_MPS)
    taps = signal_correlation(front_end, chips.ravel()).reshape(chips.shape)
    found_m = range_offset_m(taps, np.ones(delay_m.size, int), 1, offsets_m)
    return float(delay_m @ found_m / (delay_m @ delay_m))


@lru_cache(maxsize=4)
def spread(front_end: FrontEnd, n_lags: int, steps_per_chip: int) -> Float[np.ndarray, "n_lags n_grid"]:
    """Return the contribution of each whole-chip lag ±d of a code's autocorrelation to the output at |x|."""
    last = (n_lags - 1) * steps_per_chip
    table = signal_correlation(front_end, np.arange(-last, 2 * last + 1) / steps_per_chip)
    rows = [table[last - lag * steps_per_chip :][: last + 1] for lag in range(n_lags)]  # R_h(x − lag)
    for lag in range(1, n_lags):
        rows[lag] = rows[lag] + table[last + lag * steps_per_chip :][: last + 1]
    return np.array(rows)


def _smoothed(
    delay_chips: Float[np.ndarray, " n"], weights: Float[np.ndarray, " m"], lags_chips: Float[np.ndarray, " m"]
) -> Float[np.ndarray, " n"]:
    """Return Σ_m weights[m] Λ(lags[m] − delay) for each delay."""
    distance = np.subtract.outer(delay_chips, lags_chips)
    return autocorrelation(BPSK, distance.ravel()).reshape(distance.shape) @ weights
