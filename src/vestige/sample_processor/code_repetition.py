"""Estimate the sampling rate of samples without a description, from the repetition of the codes.

Theory of operation
-------------------
A satellite's signal repeats after one code period, except for a sign and a phase. So every sample is multiplied by the
conjugate of the sample one lag earlier. Blocks of products are summed coherently, and the squared magnitudes of the
blocks are added. At the lag of a code period, and at multiples of this lag, the sum is larger than at other lags. The
method needs neither the centre frequency nor the satellites in view, and the spectrum may be inverted. The sums are
computed without a filter, and again after a filter around the assumed carrier, which reduces the noise at high rates.
The score of a rate tells how far the sums at the multiples of the code period exceed the median of all sums. An
acquisition has to confirm the rate, because divisors and multiples of the true rate have a high score, too.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Complex64, Float64
from scipy import fft

# usual rates of recorders in Hz; a test compares the rates with the recommendation in docs/recorder_to_verdict.md
USUAL_RATES_HZ = tuple(
    1e6 * rate
    for rate in (
        12.5, 12.0, 10.0, 25.0, 20.0, 4.0, 5.0, 5.5, 6.0, 6.2, 6.25, 8.0, 11.0, 16.0, 24.0, 30.0, 40.0, 50.0, 3.1,
        4.092, 8.184, 16.368, 10.23, 20.46, 30.69, 40.92, 15.36, 30.72, 61.44, 2.048, 2.4, 2.5, 3.2, 6.5, 6.144, 7.68,
        12.288, 15.0, 18.0, 23.04, 26.0, 32.0, 48.0, 56.0,
    )
)  # fmt: skip
_LONGEST_LAG = 250_000  # longest lag in samples: 4 ms at 62.5 MHz
_USED = 1 << 20  # largest number of samples that are used
_BLOCKS = (1 << 15, 1 << 17)  # numbers of samples that are summed coherently, for low and for high rates
_TOLERANCE = 20e-6  # largest error of a lag as a share of the lag, for a free-running oscillator
_MULTIPLES = 8  # largest number of multiples of a lag that are evaluated, for every rate
_NARROW = 1 / 3  # share of the sampled band around the carrier that has most of the signal if the rate is high
_HIGHEST = 1e3  # largest sum in standard deviations, which limits the weight of interference that repeats at some lag


def rates_by_repetition_hz(
    samples: Complex64[np.ndarray, " n_samples"], code_period_s: float, *, carrier: float = 0.0
) -> tuple[float, ...]:
    """Return `USUAL_RATES_HZ`, sorted from the best to the worst agreement with the repetition of codes in `samples`.

    Parameters
    ----------
    samples
        Samples of unknown rate. Up to 2²⁰ samples are used, which takes about 2 s of computing time.
    code_period_s
        Period of the codes in s: 4 ms on E1, 1 ms on E6.
    carrier
        Assumed position of the carrier in the sampled spectrum, as a share of the sampling rate, −½ to ½.

    Examples
    --------
    >>> import numpy as np
    >>> code = np.random.default_rng(1).normal(size=20_000)
    >>> rates_by_repetition_hz(np.tile(code, 10).astype(np.complex64), 4e-3)[0]
    5000000.0
    """
    used = samples[:_USED] - np.mean(samples[:_USED])
    bands = (used, _middle(used, carrier))
    profiles = [one for band in bands for block in _BLOCKS for one in _profile(band, block)]
    scores = {
        rate: max((_score(profile, rate * code_period_s) for profile in profiles), default=0.0)
        for rate in USUAL_RATES_HZ
    }
    return tuple(sorted(USUAL_RATES_HZ, key=lambda rate: -scores[rate]))


def _profile(samples: Complex64[np.ndarray, " n_samples"], block: int) -> Iterator[Float64[np.ndarray, " lags"]]:
    """Yield the sums at all lags in standard deviations from the median sum, at most `_HIGHEST`.

    The generator yields nothing if there are too few samples, or if the sums do not vary.
    """
    longest = min(_LONGEST_LAG, samples.size - 2 * block)
    if longest <= 1:
        return
    size = fft.next_fast_len(block + longest)
    total = np.zeros(longest, np.float64)
    for start in range(0, samples.size - block - longest + 1, block):
        short = fft.fft(samples[start : start + block], size)
        long = fft.fft(samples[start : start + block + longest], size)
        total += np.abs(fft.ifft(long * np.conj(short), overwrite_x=True)[:longest]) ** 2
    middle = np.median(total)
    # standard deviation of the Gaussian distribution that has the same median absolute deviation
    deviation = float(np.median(np.abs(total - middle))) / 0.6745
    if deviation > 0:
        yield np.minimum((total - middle) / deviation, _HIGHEST)


def _score(profile: Float64[np.ndarray, " lags"], lag: float) -> float:
    """Return the largest values of a profile near the multiples of a lag, added and divided by √(number of values)."""
    count = min(int((profile.size - 1) / (lag * (1 + _TOLERANCE))), _MULTIPLES)
    if count < 1:
        return 0.0
    highest = []
    for m in range(1, count + 1):
        near = 1 + int(_TOLERANCE * m * lag)
        at = round(m * lag)
        highest.append(float(np.max(profile[max(at - near, 0) : at + near + 1])))
    return float(np.sum(highest)) / float(np.sqrt(count))


def _middle(samples: Complex64[np.ndarray, " n_samples"], carrier: float) -> Complex64[np.ndarray, " n_samples"]:
    """Return the samples after a filter that keeps the third of the spectrum around the carrier."""
    spectrum = fft.fft(samples)
    n = samples.size
    away = (np.arange(n) - round(carrier * n) + n // 2) % n - n // 2
    spectrum[np.abs(away) > _NARROW * n / 2] = 0.0
    return fft.ifft(spectrum, overwrite_x=True)
