"""Compute statistics of the first samples of a recording, which show a wrong format or frequency, or no signal.

The amplitudes are in the unit of the file. The rms, the outermost values and the number of distinct values describe the
stored components: the real samples, or I and Q together. A 2-bit front end has 4 distinct values and about a third of
its samples at the outermost values. An 8-bit front end has many values and hardly any sample at the outermost values,
unless the front end clips. The spectral centre is the centre of the front end's pass band, as a radio frequency. The
spectral centre is the mean frequency, weighted with the power above twice the flat floor. Outside the pass band, the
noise of quantisation causes the flat floor. For real samples only the half of the spectrum with the band's carrier is
used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from jaxtyping import Complex64

from vestige.recording.samples.sample_file import SampleReader
from vestige.signals.definitions import CARRIER_HZ

LOOKED_AT = 1 << 20  # number of samples for the statistics
SEGMENT = 1024  # number of samples of one spectrum


@dataclass(frozen=True, slots=True, kw_only=True)
class AdcStatistics:
    """Statistics of the first samples of a recording."""

    deviation: float  # standard deviation of the samples (both components together)
    rms: float  # root mean square of the components
    mean: complex  # mean of the samples; the imaginary part is 0 for real samples
    n_distinct: int  # number of distinct values of the components
    outermost: float  # largest magnitude of a component
    # fraction of the components with the magnitude `outermost`; with many distinct values, these components are clipped
    outermost_fraction: float
    # centre of the pass band as a radio frequency in Hz; None if there are too few samples, or if no part of the
    # spectrum exceeds twice the flat floor
    spectral_center_hz: float | None


def adc_statistics(reader: SampleReader) -> AdcStatistics:
    """Return the statistics of the first `LOOKED_AT` samples, or of all samples of a shorter file.

    The function raises `InputFileError` if the samples cannot be read, or are not finite numbers.
    """
    samples = reader.samples(reader.first_sample, min(LOOKED_AT, reader.n_samples))
    components = samples.view(np.float32) if reader.file.form.is_complex else samples.real
    magnitudes = np.abs(components)
    return AdcStatistics(
        rms=float(np.sqrt(np.mean(components.astype(np.float64) ** 2))),
        mean=complex(np.mean(samples, dtype=np.complex128)),
        deviation=float(np.std(samples.astype(np.complex128))),
        n_distinct=len(np.unique(components)),
        outermost=float(magnitudes.max()),
        outermost_fraction=float(np.mean(magnitudes == magnitudes.max())),
        spectral_center_hz=_spectral_center(reader, samples),
    )


def _spectral_center(reader: SampleReader, samples: Complex64[np.ndarray, " n_samples"]) -> float | None:
    file = reader.file
    if len(samples) < SEGMENT:
        return None
    segments = samples[: len(samples) // SEGMENT * SEGMENT].reshape(-1, SEGMENT)
    window = np.hanning(SEGMENT).astype(np.float32)
    power = np.mean(np.abs(scipy.fft.fft((segments - np.mean(samples)) * window, axis=1)) ** 2, axis=0)
    frequency = file.center_frequency_hz + scipy.fft.fftfreq(SEGMENT, 1 / file.sample_rate_hz)
    if not file.form.is_complex:
        upper = CARRIER_HZ[file.band] >= file.center_frequency_hz
        half = (frequency >= file.center_frequency_hz) == upper
        power, frequency = power[half], frequency[half]
    above = np.maximum(power - 2 * np.quantile(power, 0.1), 0.0)  # the floor stays below twice its level
    total = float(above.sum())
    return float((above * frequency).sum() / total) if total > 0 else None
