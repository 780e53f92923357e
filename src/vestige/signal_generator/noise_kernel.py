"""Make the noise of samples as a pure function of key and sample number, without the state of a random generator.

Theory of operation
-------------------
One 64-bit hash of key and sample number gives one pair of standard normal numbers by the method of Box and Muller. The
radius r = √(−2 ln U) of a uniform number U uses 31 bits, and an angle within ±π/4 uses 30 bits. Three bits swap sine
and cosine and set two signs, which extends the angle to the full circle. The loops have no look-ups and no branches, so
the compiler can use vector instructions. Logarithm, sine and cosine are polynomials, because vector instructions can
compute polynomials. A pair depends only on its key and number. So the bits of the noise do not depend on which worker
makes which part of an epoch.

Three loops run one after the other over a piece of 1024 pairs. The loops compute hash, logarithm and rotation. A single
loop for all three steps takes 1.1 times as long. The reason is the long chain of steps for a pair, which cannot overlap
with the chains of other pairs.

    z = mix(key + i · GOLD)                     splitmix64 [STEELE14]
    x = (31 bits of z) + ½                      ½ … 2³¹: the largest number is 6.66 σ
    ln(x / 2³¹) = ln(1 + m) + (e − 31) ln 2     x = (1 + m) 2^e, √½ ≤ 1 + m < √2

The polynomials are from Cephes in single precision [CEPHES]. The polynomials use fused multiply-add, so that all
machines get the same bits. Compared with float64 for the same x and angle in float32, the relative error of the radius
is at most 1.1e-7, and the errors of sine and cosine are at most 6e-8.

Two keys that differ by a small multiple of GOLD would give shifted copies of one sequence. `noise_key` makes each key
as a hash, so that two keys do not differ by a small multiple of GOLD.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np
from jaxtyping import Float32

from vestige.kernel_cache import njit
from vestige.signals.float_kernel import bits_of, float_of, fma

GOLD = 0x9E3779B97F4A7C15  # step of the counter, an odd number near 2^64 / golden ratio [STEELE14]
_MULTIPLIERS = (0xBF58476D1CE4E5B9, 0x94D049BB133111EB)  # multipliers of the last steps of splitmix64 [STEELE14]
_MASK = (1 << 64) - 1
_PIECE = 1024  # number of pairs in a piece; the intermediate arrays of a piece fit into the first-level cache

_GOLD, _M1, _M2 = np.uint64(GOLD), np.uint64(_MULTIPLIERS[0]), np.uint64(_MULTIPLIERS[1])
_SQRT_HALF = np.int32(0x3F3504F3)  # bits of the float32 √½
_LN2 = np.float32(np.log(2.0))
_TURN = np.float32(2 * np.pi / 2**32)
# ln(1 + m) = m + m² P(m) [CEPHES, logf]
_P = tuple(
    np.float32(c)
    for c in (
        7.0376836292e-2, -1.1514610310e-1, 1.1676998740e-1, -1.2420140846e-1, 1.4249322787e-1, -1.6668057665e-1,
        2.0000714765e-1, -2.4999993993e-1, 3.3333331174e-1, -0.5,
    )
)  # fmt: skip
# polynomials of sine and cosine for angles within ±π/4 [CEPHES, sinf and cosf]
_S = tuple(np.float32(c) for c in (-1.6666654611e-1, 8.3321608736e-3, -1.9515295891e-4))
_C = tuple(np.float32(c) for c in (-0.5, 4.166664568298827e-2, -1.388731625493765e-3, 2.443315711809948e-5))


def noise_key(seed: int, epoch: int, stream: int) -> np.uint64:
    """Return the key that determines the noise of one epoch.

    `stream` is a constant for each band and purpose, so that two bands or purposes have different noise.
    """
    return np.uint64(_mix_int(_mix_int(seed + epoch * GOLD) + stream))


def _mix_int(z: int) -> int:
    z &= _MASK
    z = (z ^ (z >> 30)) * _MULTIPLIERS[0] & _MASK
    z = (z ^ (z >> 27)) * _MULTIPLIERS[1] & _MASK
    return z ^ (z >> 31)


@njit(inline="always")
def _mix(z):
    z = np.uint64((z ^ (z >> np.uint64(30))) * _M1)
    z = np.uint64((z ^ (z >> np.uint64(27))) * _M2)
    return z ^ (z >> np.uint64(31))


@njit(cache=True, nogil=True)
def _hash(z, hi, lo):
    """Fill uint32[n] `hi` and `lo` with the upper and lower halves of the hashes of z, z + GOLD, …."""
    for i in range(hi.size):
        mixed = _mix(z)
        hi[i], lo[i] = np.uint32(mixed >> np.uint64(32)), np.uint32(mixed)
        z = np.uint64(z + _GOLD)


@njit(cache=True, nogil=True)
def _logarithm(hi, ln):
    """Fill float32[n] `ln` with ln(x / 2³¹), where x is the upper 31 bits of `hi` plus ½."""
    for i in range(hi.size):
        b = bits_of(np.float32(np.int32(np.uint32(hi[i] >> np.uint32(1)))) + np.float32(0.5))
        e = np.int32(np.int32(b - _SQRT_HALF) >> np.int32(23))
        m = float_of(np.int32(b - np.int32(e << np.int32(23)))) - np.float32(1.0)
        p = fma(_P[0], m, _P[1])
        p = fma(p, m, _P[2])
        p = fma(p, m, _P[3])
        p = fma(p, m, _P[4])
        p = fma(p, m, _P[5])
        p = fma(p, m, _P[6])
        p = fma(p, m, _P[7])
        p = fma(p, m, _P[8])
        p = fma(p, m, _P[9])
        ln[i] = fma(m * m, p, m) + np.float32(np.int32(e - np.int32(31))) * _LN2


@njit(cache=True, nogil=True)
def _turn(scale, hi, lo, ln, x):
    """Fill float32[2 n] `x` with pairs of radius scale × √(−2 `ln`), whose angles follow from bits of `lo` and `hi`."""
    factor = np.float32(-2.0) * scale * scale
    for i in range(hi.size):
        r = np.sqrt(factor * ln[i])
        a = np.float32(np.int32(np.int32(lo[i] & np.uint32(0x3FFFFFFF)) - np.int32(0x20000000))) * _TURN
        a2 = a * a
        sin = r * fma(a * a2, fma(a2, fma(a2, _S[2], _S[1]), _S[0]), a)
        cos = r * fma(a2, fma(a2, fma(a2, fma(a2, _C[3], _C[2]), _C[1]), _C[0]), np.float32(1.0))
        swap = np.int32(np.uint32(lo[i] << np.uint32(1))) < np.int32(0)
        u, v = (sin, cos) if swap else (cos, sin)
        x[2 * i] = float_of(np.int32(bits_of(u) ^ np.int32(np.uint32(lo[i] & np.uint32(0x80000000)))))
        x[2 * i + 1] = float_of(np.int32(bits_of(v) ^ np.int32(np.uint32(hi[i] << np.uint32(31)))))


@njit(cache=True, nogil=True)
def fill_normals(key, first, scale, x):
    """Fill float32[2 n] `x` with `scale` times the normal pairs from number `first` on, real before imaginary part."""
    hi, lo = np.empty(_PIECE, np.uint32), np.empty(_PIECE, np.uint32)
    ln = np.empty(_PIECE, np.float32)
    n_pairs = x.size // 2
    for b in range(0, n_pairs, _PIECE):
        n = min(_PIECE, n_pairs - b)
        _hash(np.uint64(key + np.uint64(first + b) * _GOLD), hi[:n], lo[:n])
        _logarithm(hi[:n], ln[:n])
        _turn(scale, hi[:n], lo[:n], ln[:n], x[2 * b : 2 * (b + n)])


def normal_pairs(key: np.uint64, first: int, n: int) -> Float32[np.ndarray, "{n} 2"]:
    """Return n pairs of independent standard normal numbers, from pair number `first` on."""
    pairs = np.empty((n, 2), np.float32)
    fill_normals(key, np.int64(first), np.float32(1.0), pairs.reshape(-1))
    return pairs
