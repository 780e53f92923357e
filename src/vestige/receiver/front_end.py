"""The antenna to the samples: all satellites of a band, noise, sampling.

Noise is complex white Gaussian of variance 1 a sample, so N0 = 1/f_s and a component of C/N0 has amplitude
√(C/N0 / f_s).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex64

from vestige.records import Band
from vestige.signal_generator.range_model import RangeModel
from vestige.signal_generator.waveform import Component
from vestige.signals.definitions import CARRIER_HZ
from vestige.streams import stream

_BLOCK = 1 << 18


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivedComponent:
    """A component as it reaches the antenna: waveform, strength, pseudorange in its own band."""

    component: Component
    cn0_dbhz: float
    pseudorange: RangeModel


def sample_band(
    band: Band, received: tuple[ReceivedComponent, ...], *, sample_rate_hz: float, n_samples: int, seed: int
) -> Iterator[Complex64[np.ndarray, " block"]]:
    """Yield the samples of one band, block by block, starting at the reference second.

    Parameters
    ----------
    received
        All that is in the band.
    sample_rate_hz
        Complex sampling rate in Hz; the band's carrier stands at 0 Hz.
    n_samples
        Length in samples.
    seed
        Seed of the noise.
    """
    for number, first in enumerate(range(0, n_samples, _BLOCK)):
        t = (first + np.arange(min(_BLOCK, n_samples - first))) / sample_rate_hz
        noise = stream(seed, "noise", band.value, number).standard_normal((t.size, 2)) * np.sqrt(0.5)
        samples = noise[:, 0] + 1j * noise[:, 1]
        for one in received:
            amplitude = np.sqrt(10 ** (one.cn0_dbhz / 10) / sample_rate_hz)
            samples += amplitude * one.component.received(t, one.pseudorange.range_m(t), CARRIER_HZ[band])
        yield samples.astype(np.complex64)
