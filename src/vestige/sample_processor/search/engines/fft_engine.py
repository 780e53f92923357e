"""Compute the powers of a search by overlap-save correlation, with an inverse FFT for every Doppler bin.

This engine is the reference for the other engines. `overlap_save` explains how blocks are cut and how a bin becomes a
shift. The spectrum of the code is stored three times in a row, so a shift is a slice.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Complex64, Float32, Int8, Int16
from scipy import fft

from vestige.kernel_cache import njit
from vestige.sample_processor.search.engines.overlap_save import OverlapSave

_TOGETHER = 4  # number of transforms at once: scipy computes 4 transforms in the time of a single transform


class FftEngine:
    """Engine that computes the powers of a search by FFT; all codes have equal length. The module explains the method.

    Parameters
    ----------
    codes
        Codes of ±1; each has 1, 2, 4, 8 or 16 ms of chips.
    """

    uses_cores = True

    def __init__(self, codes: Int8[np.ndarray, "codes chips"]) -> None:
        blocks = OverlapSave.of(codes.shape[1])
        self._length, self._shifts = blocks.length, blocks.shifts
        self.block = blocks.offsets
        self.loss_db = blocks.loss_db
        self._spectra = np.tile(blocks.spectra(codes), 3)

    def powers(
        self,
        chips: Int16[np.ndarray, "grids 2 n"],
        n_offsets: int,
        threshold: float = 0.0,  # noqa: ARG002  (this engine computes all cells)
    ) -> Float32[np.ndarray, "codes grids n_offsets"]:
        """Return the largest power over the Doppler bins, for every code, grid and code offset."""
        best = np.zeros((self._spectra.shape[0], chips.shape[0], n_offsets), np.float32)
        for grid in range(chips.shape[0]):
            samples = (chips[grid, 0] + 1j * chips[grid, 1]).astype(np.complex64)
            for first in range(0, n_offsets, self.block):
                spectrum = fft.fft(samples[first : first + self._length], self._length)
                for code, out in zip(self._spectra, best, strict=True):
                    self._raise(spectrum, code, out[grid, first : first + self.block])
        return best

    def _raise(
        self,
        spectrum: Complex64[np.ndarray, " length"],
        code: Complex64[np.ndarray, " three_lengths"],
        out: Float32[np.ndarray, " offsets"],
    ) -> None:
        product = np.empty((_TOGETHER, self._length), np.complex64)
        for first in range(0, self._shifts.size, _TOGETHER):
            rows = product[: self._shifts[first : first + _TOGETHER].size]
            for row, shift in zip(rows, self._shifts[first : first + _TOGETHER], strict=True):
                np.multiply(spectrum, code[self._length - shift : 2 * self._length - shift], out=row)
            for row in fft.ifft(rows, axis=1, norm="forward", overwrite_x=True):
                _raise_to_power(row.view(np.float32), out)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _raise_to_power(y, out):  # type: ignore[no-untyped-def]
    """Replace each element of `out` by the power of its complex number in `y` (interleaved) if the power is larger."""
    for i in range(out.size):
        power = y[2 * i] * y[2 * i] + y[2 * i + 1] * y[2 * i + 1]
        out[i] = power if power > out[i] else out[i]
