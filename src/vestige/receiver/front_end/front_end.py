"""Simulate the front end of one band, from the antenna to the samples: filter, gain control, quantisation.

Theory of operation
-------------------
**Strength.** The noise is complex, white and Gaussian, with variance 1 per sample. So N0 = 1/f, where f is the sampling
rate at the filter, and a component has the amplitude √(C/N0 / f).

**Filter.** The filter of the two-sided bandwidth B is a windowed sinc of odd length. The sinc is even, so its group
delay is a whole number of samples and is removed. The taps of the sinc have Σh² = 1, so the noise keeps variance 1 in a
narrower band. The amplitude of a signal in the pass band grows by about √(f/B). The C/N0 does not change. Sampling
folds sidelobes into the band, and a filter *behind* the sampler cannot undo the folding. So the samples can be made and
filtered at a multiple of the front end's rate, and are then decimated. Neither the higher rate nor the filter
removes the steps that sampling causes in the correlation function (`receiver/samples/staircase.py`).

**Gain and quantiser.** The gain control sets the rms over the processed samples, a snapshot or a stretch of a
recording, to the level with the smallest loss of the quantiser (`quantiser.py`). Without gain control the gain is right
for noise alone, and a strong jammer can saturate the quantiser.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import erfc, inf

import numpy as np
from jaxtyping import Complex64, Float32
from scipy import fft

from vestige.kernel_cache import njit
from vestige.receiver.front_end.quantiser import QUANTISERS
from vestige.records import FrontEndStatus

_CLIPPING = 2.0, 1e-3  # A snapshot is saturated if its clipped share is above twice the share of a Gaussian, plus 1e-3.
_STOP_BAND_DB = 60.0
_KAISER_BETA = 0.1102 * (_STOP_BAND_DB - 8.7)  # Kaiser 1974
_FFT_LENGTH = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontEnd:
    """Front end of one band; without bandwidth and bits the output equals the input.

    Attributes
    ----------
    sample_rate_hz
        Output sampling rate in Hz.
    bandwidth_hz
        Two-sided bandwidth between the −6 dB points in Hz; None for no filter.
    bits
        Bits per dimension, 1, 2, 3 or 8; None for no quantiser and no gain.
    agc
        Whether the gain follows the power of the processed samples. If `agc` is false, the front end has the gain for
        noise alone.
    oversampling
        Ratio of the input rate to `sample_rate_hz`.
    transition_hz
        Width of the filter's edge, from pass to stop band, in Hz; None for a tenth of the bandwidth.
    """

    sample_rate_hz: float
    bandwidth_hz: float | None = None
    bits: int | None = None
    agc: bool = True
    oversampling: int = 1
    transition_hz: float | None = None

    def __post_init__(self) -> None:
        if self.bits is not None and self.bits not in QUANTISERS:
            raise ValueError(f"a front end has {', '.join(map(str, QUANTISERS))} bits or None, not {self.bits}")
        if self.bandwidth_hz is not None and not 0 < self.bandwidth_hz < self.input_rate_hz:
            below = f"{self.input_rate_hz / 1e6:g} MHz, the rate at which samples reach the filter"
            raise ValueError(f"a bandwidth above 0 and below {below}")
        if self.oversampling < 1 or (self.oversampling > 1 and self.bandwidth_hz is None):
            raise ValueError("a receiver that decimates samples needs a filter before the decimation")
        if self.transition_hz is not None and not self.transition_hz > 0:
            raise ValueError(f"transition band {self.transition_hz} Hz is not positive")

    @property
    def input_rate_hz(self) -> float:
        """Rate of the input samples in Hz."""
        return self.sample_rate_hz * self.oversampling

    @property
    def power_bandwidth_hz(self) -> float:
        """Bandwidth in Hz in which the power is measured, which is the sampling rate if the front end has no filter."""
        return self.bandwidth_hz or self.sample_rate_hz

    @property
    def transparent(self) -> bool:
        """Whether the output equals the input."""
        return self.bandwidth_hz is None and self.bits is None

    @property
    def margin_samples(self) -> int:
        """Number of input samples needed before the first output sample, and after the last output sample."""
        if self.bandwidth_hz is None:
            return 0
        transition = (self.transition_hz or self.bandwidth_hz / 10) / self.input_rate_hz
        return int(np.ceil((_STOP_BAND_DB - 7.95) / (14.36 * transition) / 2))  # Kaiser 1974

    def input_samples(self, n_samples: int) -> int:
        """Return how many input samples give `n_samples` output samples, margins on both sides included."""
        return (n_samples - 1) * self.oversampling + 1 + 2 * self.margin_samples

    def filter_taps(self) -> Float32[np.ndarray, " n_taps"]:
        """Return the even impulse response of the filter, with unit energy."""
        if self.bandwidth_hz is None:
            return np.ones(1, np.float32)
        n = np.arange(-self.margin_samples, self.margin_samples + 1)
        taps = np.sinc(self.bandwidth_hz / self.input_rate_hz * n) * np.kaiser(n.size, _KAISER_BETA)
        return (taps / np.sqrt(np.sum(taps**2))).astype(np.float32)

    def process(
        self, samples: Complex64[np.ndarray, " n_input"]
    ) -> tuple[Complex64[np.ndarray, " n_samples"], FrontEndStatus]:
        """Return the output samples and the status of the front end.

        Sample k of the output is at the time of sample `margin_samples + k · oversampling` of the input. Behind a
        quantiser the output samples are the integer levels of the quantiser.

        Parameters
        ----------
        samples
            Samples at `input_rate_hz` whose noise has variance 1, with `margin_samples` more at each end. The power in
            the status is relative to this noise.
        """
        if self.bandwidth_hz is not None:
            samples = np.ascontiguousarray(_convolve(samples, self.filter_taps())[:: self.oversampling])
        power = _sum_of_squares(samples.view(np.float32)) / samples.size
        power_db = float(10 * np.log10(power)) if power > 0 else -inf
        if self.bits is None:
            return samples, FrontEndStatus(agc_gain_db=0.0, total_power_db=power_db, saturated=False)
        gain_db = -power_db if self.agc and power > 0 else 0.0
        quantiser = QUANTISERS[self.bits]
        steps = np.float32(10 ** (gain_db / 20) * np.sqrt(2) / quantiser.step_sigma) * samples.view(np.float32)
        clipped = np.mean(np.abs(steps) > quantiser.full_scale_sigma / quantiser.step_sigma)
        saturated = clipped > _CLIPPING[0] * erfc(quantiser.full_scale_sigma / np.sqrt(2)) + _CLIPPING[1]
        status = FrontEndStatus(agc_gain_db=gain_db, total_power_db=power_db, saturated=bool(saturated))
        return quantiser.quantise(steps).view(np.complex64), status


@njit(cache=True, nogil=True, fastmath=True)
def _sum_of_squares(x):  # type: ignore[no-untyped-def]
    """Return Σ x², summed in float32 within each group of 1024 numbers and in float64 over the groups."""
    total = 0.0
    for first in range(0, x.size, 1024):
        part = x[first : first + 1024]
        some = np.float32(0.0)
        for i in range(part.size):
            some += part[i] * part[i]
        total += float(some)
    return total


def _convolve(
    x: Complex64[np.ndarray, " n_input"], taps: Float32[np.ndarray, " n_taps"]
) -> Complex64[np.ndarray, " n_output"]:
    """Return the part of the convolution that needs no sample beyond the ends, by overlapping blocks."""
    n_output = x.size - taps.size + 1
    if n_output <= 0:
        raise ValueError(f"{x.size} samples are fewer than the filter's {taps.size} taps")
    length = max(_FFT_LENGTH, fft.next_fast_len(4 * taps.size))
    fresh = length - taps.size + 1
    n_blocks = -(-n_output // fresh)
    padded = np.zeros((n_blocks - 1) * fresh + length, np.complex64)
    padded[: x.size] = x
    blocks = np.lib.stride_tricks.sliding_window_view(padded, length)[::fresh]
    spectrum = fft.fft(taps.astype(np.complex64), length)
    return fft.ifft(fft.fft(blocks, axis=1) * spectrum, axis=1)[:, taps.size - 1 :].reshape(-1)[:n_output]
