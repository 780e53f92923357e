"""Compute the threshold of a variance test in which some degrees of freedom have a larger variance than the rest.

Theory of operation
-------------------
The sum of squares T of n independent Gaussian residuals of variance 1 has the distribution χ²(n). If d of the n degrees
of freedom have the variance k ≥ 1, then

    T = χ²(n − d) + k χ²(d)        P(T > t) = ∫₀^∞ e^{−v} P(χ²(n − d) > t − k q(v)) dv,    P(χ²(d) > q(v)) = e^{−v}

For d = n, T is k χ²(n). The integral is computed as a sum over the values `_TAILS` of v. The variance k is rounded up
to a step of 2 %. The threshold is therefore an upper limit, which is too high by at most 2 % of the part k χ²(d).
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int
from scipy.special import chdtrc, chdtri

_STEP = 0.02  # step of ln k
_TAILS = (np.arange(600) + 0.5) / 10  # values of v in the sum


def variance_threshold(
    freedom: int, wide: Int[np.ndarray, "*n"], ratio: Float[np.ndarray, "*n"], p_fa: float
) -> Float[np.ndarray, "*n"]:
    """Return the threshold t that the sum of squares T exceeds with a probability of at most p_fa.

    Parameters
    ----------
    freedom
        n, number of all degrees of freedom.
    wide
        d of each test, from 0 to n: the number of degrees of freedom with the larger variance.
    ratio
        k of each test, the larger variance, 1 or more; a test whose k is NaN or infinite gets the threshold NaN.
    p_fa
        False-alarm probability of one test.

    Examples
    --------
    >>> float(variance_threshold(10, np.array([0]), np.array([1.0]), 0.01)[0])  # as for χ²(10)
    23.209...
    """
    found = np.full(np.shape(ratio), np.nan)
    known = np.isfinite(ratio)
    steps = np.ceil(np.log(np.maximum(ratio[known], 1.0)) / _STEP - 1e-9).astype(np.int64)
    pairs, place = np.unique(np.stack([np.asarray(wide)[known], steps]), axis=1, return_inverse=True)
    limits = [_threshold(freedom, d, k, p_fa) for d, k in pairs.T.tolist()]
    found[known] = np.array(limits, np.float64)[place.ravel()]
    return found


@lru_cache(maxsize=10_000)
def _threshold(freedom: int, wide: int, steps: int, p_fa: float) -> float:
    ratio, alone = math.exp(_STEP * steps), float(chdtri(freedom, p_fa))
    if wide in (0, freedom) or steps == 0:
        return alone * (ratio if wide else 1.0)
    quantile = ratio * chdtri(wide, np.exp(-_TAILS))
    weight = np.exp(-_TAILS) * (_TAILS[1] - _TAILS[0])

    def excess(t: float) -> float:
        return float(np.sum(weight * chdtrc(freedom - wide, np.maximum(t - quantile, 0.0)))) - p_fa

    from scipy.optimize import brentq  # noqa: PLC0415  (loads for 0.2 s, and most runs never come here)

    return float(brentq(excess, alone, ratio * alone, rtol=1e-6))
