"""Compute the carrier over one block of samples as a table.

A table for a constant frequency rotates all samples of a block. The phase of the block and the rate of change of the
frequency are computed in float64 at the block's middle. The table is the product of a few coarse and fine steps, so
that a table needs 64 sines instead of 1024.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np

from vestige.kernel_cache import njit

BLOCK = 1024  # number of samples in a block; the arrays of a block fit into the first-level cache
MIDDLE = BLOCK // 2
_FINE = 32


@njit(cache=True, nogil=True)
def rotator_table(cycles_per_sample, cos, sin):
    """Fill float32[BLOCK] with the cosine and sine of the angle from the block's middle, exact to float32 rounding."""
    fine = np.empty(_FINE, np.complex128)
    for b in range(_FINE):
        angle = 2 * np.pi * cycles_per_sample * b
        fine[b] = complex(np.cos(angle), np.sin(angle))
    for a in range(0, BLOCK, _FINE):
        angle = 2 * np.pi * cycles_per_sample * (a - MIDDLE)
        coarse = complex(np.cos(angle), np.sin(angle))
        for b in range(_FINE):
            z = coarse * fine[b]
            cos[a + b], sin[a + b] = z.real, z.imag


@njit(cache=True, nogil=True)
def from_middle():
    """Return the position of each sample relative to the middle of the block, in samples, as float32[BLOCK]."""
    return np.arange(-MIDDLE, BLOCK - MIDDLE).astype(np.float32)


@njit(cache=True, nogil=True)
def turn_at(frequency_hz, rate_hz_per_s, t):
    """Return exp(j2π(f t + ½ ḟ t²)); whole cycles are removed first."""
    cycles, more = frequency_hz * t, 0.5 * rate_hz_per_s * t * t
    phase = 2 * np.pi * ((cycles - np.floor(cycles)) + (more - np.floor(more)))
    return complex(np.cos(phase), np.sin(phase))
