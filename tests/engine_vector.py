"""Chips with a signal in them, and the powers that an engine must find there, summed up directly."""

from __future__ import annotations

import numpy as np

from vestige.sample_processor.search.engines.engine import CHIP_RATE_HZ, CHIP_SIGMA, CLIP, GRIDS

MILLISECONDS = (1, 2, 4, 8, 16)
N_OFFSETS = 600  # more than one vector block, and not a multiple of it
CHECKED = (0, 1, 17, 333, 511, 512, 599)


def engine_vector(ms: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return two codes, and noise with the second code near an edge of the band at offset 333 of grid 1."""
    rng = np.random.default_rng(seed)
    n = 5115 * ms
    codes = (1 - 2 * rng.integers(0, 2, (2, n))).astype(np.int8)
    x = CHIP_SIGMA * rng.standard_normal((2, 2, n + N_OFFSETS))
    f = GRIDS[n].bins_hz[1] + 0.1 / (n / CHIP_RATE_HZ)
    signal = 12 * CHIP_SIGMA * np.sqrt(2 / n) * codes[1] * np.exp(2j * np.pi * f * np.arange(n) / CHIP_RATE_HZ + 1j)
    x[1, 0, 333 : 333 + n] += signal.real
    x[1, 1, 333 : 333 + n] += signal.imag
    return codes, np.clip(np.rint(x), -CLIP, CLIP).astype(np.int16)


def direct_powers(codes: np.ndarray, x: np.ndarray, phases: np.ndarray) -> np.ndarray:
    """Return the largest power at the checked offsets; `phases` is bins by chips, in cycles."""
    table = np.exp(-2j * np.pi * phases)
    z = x[:, 0] + 1j * x[:, 1]
    n = codes.shape[1]
    wiped = np.array([[[grid[o : o + n] * code for o in CHECKED] for grid in z] for code in codes])
    return np.max(np.abs(wiped.reshape(-1, n) @ table.T) ** 2, axis=1).reshape(2, 2, len(CHECKED))
