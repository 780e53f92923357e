"""Check whether pseudoranges agree with each other by receiver autonomous integrity monitoring (RAIM).

Theory of operation
-------------------
H, W and y are defined in `position_fix`. The residuals of a weighted least-squares fix are r = (I − H(HᵀWH)⁻¹HᵀW) y.
The tests use the matrices S = (HᵀWH)⁻¹HᵀW and P = I − HS. The diagonal element Pᵢᵢ is the share of an error of
measurement i that appears in the residual rᵢ. m is the number of measurements, wᵢ is the weight of measurement i, and Q
is the tail probability of the normal distribution.

    chi-square            T = Σ rᵢ²wᵢ ~ χ²(m − 4),    alarm if T > χ²⁻¹(1 − P_fa)
    bias b on satellite i T ~ χ²(m − 4, λ),  λ = b² wᵢ Pᵢᵢ
    leave one out         x₍ᵢ₎ − x = −S.ᵢ rᵢ / Pᵢᵢ                          a rank-one update, no second fit
    standard deviation    σ_ss,q = |S_qᵢ| / √(wᵢ Pᵢᵢ)
    solution separation   alarm if |x₍ᵢ₎ − x|_q > K σ_ss,q,   K = Q⁻¹(P_fa,q / 2m)
    exclusion             T₍ᵢ₎ = T − rᵢ²wᵢ/Pᵢᵢ                              the fault has the smallest T₍ᵢ₎

For single faults, exclusion and solution separation both use the statistic rᵢ√wᵢ/√Pᵢᵢ. So the satellite with the
smallest T₍ᵢ₎ also has the largest |x₍ᵢ₎ − x|_q / σ_ss,q.

RAIM does not detect errors that a position and a clock explain. A bias common to all satellites changes the clock error
of the fix, but no residual. Errors of all satellites that agree with a wrong position change the position, but no
residual.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.special import chdtrc, chdtri, chndtr, ndtri

from vestige.navigation.position_fix import UNKNOWNS, inverse_normal

NOT_EXCLUDED = -1
_UNSEEN = 1e-9  # smallest Pᵢᵢ with which a fault of satellite i is detectable


@dataclass(frozen=True, slots=True, kw_only=True)
class Redundancy:
    """Redundancy of n fixes: dependence of each fix on its m measurements.

    Attributes
    ----------
    gain
        Matrix S, which converts errors of the measurements to errors of (three coordinates, clock).
    unexplained
        Diagonal elements Pᵢᵢ, 0 to 1; 0 for unused satellites.
    inverse
        (HᵀWH)⁻¹, a factor of S.
    """

    gain: Float[np.ndarray, "n 4 m"]
    unexplained: Float[np.ndarray, "n m"]
    inverse: Float[np.ndarray, "n 4 4"]


def redundancy(geometry: Float[np.ndarray, "n m 4"], weight: Float[np.ndarray, "n m"]) -> Redundancy:
    """Return S, the diagonal of P and (HᵀWH)⁻¹; NaN where the geometry has no fix.

    Parameters
    ----------
    geometry
        Matrix H in any axes. S gives coordinates in the axes of H.
    weight
        Weights 1/σ² in 1/m²; 0 for unused satellites.
    """
    inverse = inverse_normal(geometry, weight)
    gain = np.einsum("nij,nmj,nm->nim", inverse, geometry, weight)
    unexplained = 1 - np.einsum("nmi,nim->nm", geometry, gain)
    return Redundancy(gain=gain, unexplained=np.where(weight > 0, unexplained, 0.0), inverse=inverse)


def chi_square_statistic(
    residual_m: Float[np.ndarray, "n m"], weight: Float[np.ndarray, "n m"]
) -> Float[np.ndarray, " n"]:
    """Return the chi-square statistic T = Σ r²w. NaN residuals of unused measurements do not count."""
    return np.sum(np.where(weight > 0, residual_m, 0.0) ** 2 * weight, axis=1)


def degrees_of_freedom(weight: Float[np.ndarray, "n m"]) -> Int[np.ndarray, " n"]:
    """Return m − 4, the number of measurements beyond the unknowns."""
    return np.count_nonzero(weight > 0, axis=1) - UNKNOWNS


def chi_square_threshold(freedom: Int[np.ndarray, " n"], p_fa: float) -> Float[np.ndarray, " n"]:
    """Return the threshold of the chi-square statistic T; NaN without degrees of freedom."""
    return np.where(freedom > 0, chdtri(np.maximum(freedom, 1), p_fa), np.nan)


def missed_detection(noncentrality: Float[np.ndarray, " n"], freedom: int, p_fa: float) -> Float[np.ndarray, " n"]:
    """Return the probability that T stays below its threshold although a fault has the noncentrality λ."""
    threshold = chdtri(freedom, p_fa)
    fault = chndtr(threshold, freedom, np.maximum(noncentrality, 1e-300))
    return np.where(noncentrality > 0, fault, 1 - chdtrc(freedom, threshold))


@dataclass(frozen=True, slots=True, kw_only=True)
class Separation:
    """Fix without a satellite minus fix with all satellites, for each satellite in turn.

    The differences are in the axes of the matrix H. A difference is NaN if a fault of the satellite is not detectable.

    Attributes
    ----------
    difference_m
        Difference x₍ᵢ₎ − x of (three coordinates, clock).
    sigma_m
        Standard deviation of the difference without a fault.
    """

    difference_m: Float[np.ndarray, "n 4 m"]
    sigma_m: Float[np.ndarray, "n 4 m"]


def solution_separation(
    parts: Redundancy, residual_m: Float[np.ndarray, "n m"], weight: Float[np.ndarray, "n m"]
) -> Separation:
    """Return how the fix changes if each satellite in turn is left out, and the standard deviation of each change."""
    seen = (weight > 0) & (parts.unexplained > _UNSEEN)
    share, known_weight = np.where(seen, parts.unexplained, np.nan), np.where(seen, weight, np.nan)
    return Separation(
        difference_m=-parts.gain * (residual_m / share)[:, None],
        sigma_m=np.abs(parts.gain) / np.sqrt(known_weight * share)[:, None],
    )


def separation_factor(p_fa: float, n_modes: int) -> float:
    """Return K, the threshold in standard deviations of each of `n_modes` two-sided tests that share `p_fa`."""
    return float(-ndtri(p_fa / (2 * n_modes)))


def exclude_one(
    parts: Redundancy, residual_m: Float[np.ndarray, "n m"], weight: Float[np.ndarray, "n m"], p_fa: float
) -> Int[np.ndarray, " n"]:
    """Return for each fix the column of the satellite whose exclusion makes a failed test pass, or `NOT_EXCLUDED`.

    An exclusion needs at least six satellites, because any four of five satellites fit exactly.

    Parameters
    ----------
    parts, residual_m, weight
        Redundancy, residuals in m and weights of the fixes.
    p_fa
        False-alarm probability of the chi-square test, with and without the satellite.
    """
    statistic, freedom = chi_square_statistic(residual_m, weight), degrees_of_freedom(weight)
    passed = statistic <= chi_square_threshold(freedom, p_fa)
    seen = (weight > 0) & (parts.unexplained > _UNSEEN)
    gained = np.where(seen, residual_m**2 * weight / np.where(seen, parts.unexplained, 1.0), -np.inf)
    best = np.argmax(gained, axis=1)
    reduced = statistic - np.take_along_axis(gained, best[:, None], axis=1)[:, 0]
    helps = ~passed & (reduced <= chi_square_threshold(freedom - 1, p_fa))
    return np.where(helps, best, NOT_EXCLUDED)
