"""Compute Marcum's Q function and its complement, both accurate in their far tails.

Theory of operation
-------------------
K magnitudes |a_k + noise| are squared and added. The noise has unit variance per dimension, and Σ a_k² is a². The root
of the sum has the density f, whose tails are Q_K and P_K:

    f(x) = x (x/a)^{K-1} e^{-(x²+a²)/2} I_{K-1}(a x)
    Q_K(a, b) = ∫_b^∞ f(x) dx          P_K(a, b) = ∫_0^b f(x) dx = 1 − Q_K(a, b)

Authentication needs small tails, such as a false-alarm probability of 1e-14 or a miss probability of 1e-12. For small
tails `1 − cdf` has no correct digits, and `scipy.special` has the lower tail only. The integrand is positive and
smooth, with one maximum near μ = √(a² + 2K − 1) and a width of about 1. Away from μ the integrand decreases at least as
fast as a Gaussian. So the smaller tail is a Gauss-Legendre sum of positive terms over an interval that begins or ends
at b. The interval contains all but about e^{-45} of the tail. No terms cancel, and the larger tail is 1 minus the
smaller tail.

For tails above 1e-250, the relative error of a tail is below 1e-12 for K = 1, and below 1e-11 for K ≤ 100.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float
from scipy.special import gammaln, hyp0f1, i0e, ive, xlogy

Real = float | Float[np.ndarray, "..."]
Reals = TypeVar("Reals", float, Float[np.ndarray, "..."])  # the result has the type of the argument

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
_DEPTH = 45.0  # values of the integrand below e^-45 times the largest value are neglected
_CERTAIN = 60.0  # a − b is limited to this value, at which P_K is below e^-1800, which is 0 in float64
_MAX_ORDER = 1000  # largest order; at much higher orders `ive` underflows for z just above the order


def marcum_q(a: Reals, b: Real, order: int = 1) -> Reals:
    """Return Q_K(a, b): the probability that a signal of amplitude a with its noise exceeds the threshold b.

    Parameters
    ----------
    a
        Root of the sum of the squared signal amplitudes, in standard deviations of the noise per dimension; ≥ 0.
    b
        Threshold on the root of the sum of the squared magnitudes, in the unit of a; ≥ 0. A number, or an array with
        the shape of a.
    order
        K, number of magnitudes in the sum; 1 to 1000.
    """
    is_upper, tail = _smaller_tail(a, b, order)
    return np.where(is_upper, tail, 1.0 - tail)[()]


def marcum_p(a: Reals, b: Real, order: int = 1) -> Reals:
    """Return P_K(a, b) = 1 − Q_K(a, b): the probability that a signal of amplitude a with its noise stays below b.

    The parameters are the parameters of `marcum_q`.
    """
    is_upper, tail = _smaller_tail(a, b, order)
    return np.where(is_upper, 1.0 - tail, tail)[()]


def _smaller_tail(a: Real, b: Real, order: int) -> Any:
    """Return whether the smaller tail is the upper tail, and the value of the smaller tail."""
    a, b = np.broadcast_arrays(np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64))
    if np.any(a < 0) or np.any(b < 0) or not 1 <= order <= _MAX_ORDER:
        raise ValueError(f"amplitude and threshold must not be negative, the order from 1 to {_MAX_ORDER}")
    a = np.minimum(a, b + _CERTAIN)
    middle = np.sqrt(a**2 + (2 * order - 1))
    is_upper = b >= middle
    reach = np.sqrt((b - middle) ** 2 + 2 * _DEPTH) - np.abs(b - middle)
    end = np.where(is_upper, b + reach, np.maximum(b - reach, 0.0))
    half = np.abs(end - b)[..., None] / 2
    x = (np.minimum(end, b)[..., None] + half) + half * _NODES
    # `np.sum` is used because the rounding of a matrix product depends on the number of rows
    return is_upper, np.sum(half * _WEIGHTS * _density(x, a[..., None], order), axis=-1)


def _density(x: Float[np.ndarray, "..."], a: Float[np.ndarray, "..."], order: int) -> Float[np.ndarray, "..."]:
    if order == 1:
        return x * np.exp(-((x - a) ** 2) / 2) * i0e(a * x)
    # I_ν(z)/z^ν is computed with its power series where `ive` would underflow, and with `ive` elsewhere
    nu, z = order - 1, a * x
    series = np.log(hyp0f1(order, (np.minimum(z, order) / 2) ** 2)) - z - nu * np.log(2) - gammaln(order)
    large = np.maximum(z, order)
    bessel = np.where(z < order, series, np.log(ive(nu, large)) - nu * np.log(large))
    return np.exp(xlogy(2 * order - 1, x) - (x - a) ** 2 / 2 + bessel)
