"""Compute a table of the carrier over one block of samples, and the carrier's phasor at the middle of the block.

A table for a constant frequency rotates all samples of a block. The phase at the middle of the block, including the
effect of the Doppler rate, is computed in float64. Each entry of the table is the product of one of 32 coarse steps
and one of 32 fine steps. So a table needs 64 sines and cosines instead of 1024.

The phasor at the middle of a block is computed with polynomials [CEPHES, double precision]. The polynomials take about
half the time of the C library's functions, and give equal bits on machines with different C libraries.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np

from vestige.kernel_cache import njit

BLOCK = 1024  # number of samples in a block; the arrays of a block fit into the first-level cache
MIDDLE = BLOCK // 2
_FINE = 32
# coefficients of sine and cosine for angles within ±π/4 [CEPHES, sin and cos]
_S = (
    -1.66666666666666307295e-1, 8.33333333332211858878e-3, -1.98412698295895385996e-4, 2.75573136213857245213e-6,
    -2.50507477628578072866e-8, 1.58962301576546568060e-10,
)  # fmt: skip
_C = (
    4.16666666666665929218e-2, -1.38888888888730564116e-3, 2.48015872888517045348e-5, -2.75573141792967388112e-7,
    2.08757008419747316778e-9, -1.13585365213876817300e-11,
)  # fmt: skip


@njit(inline="always")
def _phasor(cycles):
    """Return exp(j2π cycles) with an error of at most 2e-16 beyond the rounding of the phase."""
    quarters = np.floor(4 * cycles + 0.5)
    a = 2 * np.pi * (cycles - 0.25 * quarters)
    z = a * a
    sin = a + a * z * (_S[0] + z * (_S[1] + z * (_S[2] + z * (_S[3] + z * (_S[4] + z * _S[5])))))
    cos = 1 - 0.5 * z + z * z * (_C[0] + z * (_C[1] + z * (_C[2] + z * (_C[3] + z * (_C[4] + z * _C[5])))))
    quarter = np.int64(quarters) & 3
    if quarter & 1:
        cos, sin = -sin, cos
    return complex(-cos, -sin) if quarter & 2 else complex(cos, sin)


@njit(cache=True, nogil=True)
def rotator_table(cycles_per_sample, cos, sin):
    """Fill float32[BLOCK] `cos` and `sin` of the phase relative to the block's middle, exact to float32 rounding."""
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
    return _phasor((cycles - np.floor(cycles)) + (more - np.floor(more)))
