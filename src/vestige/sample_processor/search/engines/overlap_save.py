"""Plan the overlap-save correlation of the engines `fft` and `cuda`: the blocks of samples, and the shift of each bin.

A block of `length` samples is transformed once for all codes and bins. Doppler is a shift of the code's spectrum
against the spectrum of the samples, in steps of the chip rate over `length`. Every bin is rounded to the nearest step.
For a code of n chips, the first `length` − n + 1 numbers of an inverse transform are correlator values. The other
numbers wrap around and are not used. On a processor a length of about 6.4 times the length of the code is the fastest.
A length of twice the code, which is usual, takes a third more time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex64, Int8, Int64
from scipy import fft

from vestige.sample_processor.search.engines.engine import CHIP_RATE_HZ, GRIDS

_LENGTH_OVER_CODE = 4.2  # smallest length over code length; rounding the length up to a power of two gives 6.4


@dataclass(frozen=True, slots=True, kw_only=True)
class OverlapSave:
    """Division of samples into blocks, and the spectrum shift of each Doppler bin.

    Attributes
    ----------
    length
        Number of samples of a block, a power of two.
    offsets
        Number of code offsets that a block gives; the next block begins later by the same number of samples.
    shifts
        Shifts of the code's spectrum in steps of the chip rate over `length`, one for each Doppler bin.
    loss_db
        Largest loss in dB of the power of a cell against its exact value, by the rounding of its bin to a shift.
    """

    length: int
    offsets: int
    shifts: Int64[np.ndarray, " bins"]
    loss_db: float

    @classmethod
    def of(cls, n_chips: int) -> OverlapSave:
        """Return the division of samples for codes of `n_chips` chips, which last 1, 2, 4, 8 or 16 ms."""
        length = 1 << int(np.ceil(np.log2(_LENGTH_OVER_CODE * n_chips)))
        shifts = np.rint(GRIDS[n_chips].bins_hz / CHIP_RATE_HZ * length).astype(int)
        # The loss is largest for a signal midway between two bins (¼ cycle) if the bins are rounded by half a step.
        step_error = 0.5 * CHIP_RATE_HZ / length * n_chips / CHIP_RATE_HZ
        slope_db = 20 * np.log10(np.sinc(0.25) / np.sinc(0.25 + step_error))
        return cls(length=length, offsets=length - n_chips + 1, shifts=shifts, loss_db=float(slope_db) + 0.01)

    def spectra(self, codes: Int8[np.ndarray, "codes chips"]) -> Complex64[np.ndarray, "codes length"]:
        """Return the conjugate spectra of codes, divided by `length` so that an inverse transform needs no factor."""
        spectra = np.conj(fft.fft(codes.astype(np.complex64), self.length, axis=1)) / self.length
        return spectra.astype(np.complex64)
