"""Overlap-save correlation, as the engines `fft` and `cuda` use it: how samples are cut and bins become shifts.

A block of `length` samples is transformed once for all codes and bins: Doppler is a shift of the code's spectrum
against that of the samples, in steps of R_c / length, and every bin is rounded to the nearest step. The first
length − chips + 1 numbers of an inverse transform are correlator values, the rest is wrapped round. A length of about
6.4 times the code's is best on a processor; the textbook's 2 costs a third more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex64, Int8, Int64
from scipy import fft

from vestige.sample_processor.search.engines.engine import CHIP_RATE_HZ, GRIDS

_LENGTH_OVER_CODE = 4.2  # the next power of two above is 6.4


@dataclass(frozen=True, slots=True, kw_only=True)
class OverlapSave:
    """Division of samples into blocks, and the spectrum shift of each Doppler bin.

    Attributes
    ----------
    length
        Samples of a block, a power of two.
    offsets
        Code offsets that a block yields; the next block begins so many samples later.
    shifts
        Shifts of the code's spectrum in steps of R_c / `length`, one for each Doppler bin.
    loss_db
        The most that the power of a cell may be below its exact value, because its bin is rounded to a shift.
    """

    length: int
    offsets: int
    shifts: Int64[np.ndarray, " bins"]
    loss_db: float

    @classmethod
    def of(cls, n_chips: int) -> OverlapSave:
        """Return the blocks for codes of so many chips: 1, 2, 4, 8 or 16 ms."""
        length = 1 << int(np.ceil(np.log2(_LENGTH_OVER_CODE * n_chips)))
        shifts = np.rint(GRIDS[n_chips].bins_hz / CHIP_RATE_HZ * length).astype(int)
        # 1.5 bins' rounding at the most moves a cell's power by less than the loss half a step off the grid
        step_error = 0.5 * CHIP_RATE_HZ / length * n_chips / CHIP_RATE_HZ
        slope_db = 20 * np.log10(np.sinc(0.25) / np.sinc(0.25 + step_error))  # a quarter of a cycle: the grid's worst
        return cls(length=length, offsets=length - n_chips + 1, shifts=shifts, loss_db=float(slope_db) + 0.01)

    def spectra(self, codes: Int8[np.ndarray, "codes chips"]) -> Complex64[np.ndarray, "codes length"]:
        """Return the conjugate spectra of codes over `length`, so that an inverse transform needs no factor."""
        spectra = np.conj(fft.fft(codes.astype(np.complex64), self.length, axis=1)) / self.length
        return spectra.astype(np.complex64)
