"""A stand-in for a GPU in the tests of the CUDA engine: its arithmetic in numpy."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import numpy as np
from scipy import fft


class NumpyDevice:
    """A `Device` of the CUDA engine on the processor. A lane's rows are NaN until they are written."""

    xp = np

    def stream(self) -> Any:
        return nullcontext()

    def constant(self, values: np.ndarray) -> np.ndarray:
        return values.copy()

    def plan(self, rows: np.ndarray) -> tuple[int, ...]:
        rows[...] = np.nan
        return rows.shape

    def forward(self, blocks: np.ndarray) -> np.ndarray:
        return fft.fft(blocks, axis=-1)

    def multiply(self, spectra: np.ndarray, code: np.ndarray, shifts: np.ndarray, rows: np.ndarray) -> None:
        for bin_, shift in enumerate(shifts):
            rows[:, bin_] = spectra * np.roll(code, shift)

    def inverse(self, rows: np.ndarray, plan: tuple[int, ...]) -> None:
        assert rows.shape == plan
        assert rows.flags.c_contiguous
        rows[...] = fft.ifft(rows, axis=-1, norm="forward")

    def raise_to_powers(self, rows: np.ndarray, n_bins: int, best: np.ndarray) -> None:
        powers = np.abs(rows[:, :n_bins, : best.shape[-1]]) ** 2
        np.maximum(best, powers.max(axis=1), out=best)

    def download(self, values: np.ndarray) -> np.ndarray:
        assert values.dtype == np.float32
        return values
