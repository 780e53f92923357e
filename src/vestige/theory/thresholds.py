"""Compute detection thresholds, probabilities of false alarm and detection, and the C/N0 that a detection requires.

Theory of operation
-------------------
In units of the noise per dimension, the output of a correlator over the integration time T_I is z = A e^{jφ} + w. A² is
2 (C/N0) T_I, and w is complex Gaussian noise of unit variance per dimension. The magnitude of z is compared with a
threshold g [WFO, Sec. III-A]:

    no signal    P_fa = e^{-g²/2}             so  g = √(−2 ln P_fa)
    signal       P_d  = Q₁(A, g)              miss = 1 − P_d = P₁(A, g)
    N tests      P_FA = 1 − (1 − P_fa)^N      [WFO, Sec. III-D]
    K squared magnitudes added (non-coherent sum), A² = 2 K (C/N0) T_I:
                 P_fa = Γ(K, g²/2) / Γ(K)     P_d = Q_K(A, g)

The paper's numbers assume a single dwell, exact alignment in time and frequency, a constant amplitude, and a known
noise power. The module `losses` computes the loss by misalignment. `swerling1_probability_of_detection` is for a
fluctuating amplitude.

The conversions between P_FA and P_fa use log1p and expm1. The printed formula 1 − (1 − P_FA)^{1/N} loses digits in
floating point and gives the paper's 4.16e-14 instead of 4.17e-14.

The first argument of every function is a number or an array. The result has the shape of the first argument. Other
arguments are numbers. Only `correlator_amplitude` also accepts an array of integration times.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from vestige.theory.marcum_q import Real, Reals, marcum_p, marcum_q

_BISECTIONS = 60  # number of bisections that reduce a bracket of about 20 to less than its rounding error
_SURE = 9.0  # A − g for which the probability of a miss is below 1e-18, less than any 1 − P_d in floating point


def single_event_pfa(overall: Reals, hypotheses: float) -> Reals:
    """Return P_fa, the false alarm probability that each of N tests may have: 1 − (1 − P_FA)^{1/N}.

    For correlated tests the false-alarm probability of all tests together is less than P_FA.

    The function raises `ValueError` if a probability is not between 0 and 1, or N is below 1.
    """
    _check(overall, hypotheses)
    return -np.expm1(np.log1p(-overall) / hypotheses)


def overall_pfa(single: Reals, hypotheses: float) -> Reals:
    """Return P_FA, the probability that at least one of N tests gives a false alarm: 1 − (1 − P_fa)^N."""
    _check(single, hypotheses)
    return -np.expm1(hypotheses * np.log1p(-single))


def threshold(pfa: Reals, n_noncoherent: int = 1) -> Reals:
    """Return the detection threshold g on the magnitude, in standard deviations of the noise per dimension.

    Parameters
    ----------
    pfa
        P_fa of a single test.
    n_noncoherent
        K, number of squared magnitudes in the sum; the threshold is on the root of the sum.

    Returns
    -------
    float or float array
        Threshold, with the shape of `pfa`.

    Raises
    ------
    ValueError
        If P_fa is not between 0 and 1.

    Examples
    --------
    >>> import vestige as vs
    >>> round(float(vs.threshold(1e-7)), 4)
    5.6777
    """
    _check(pfa)
    return np.sqrt(-2.0 * np.log(pfa)) if n_noncoherent == 1 else np.sqrt(chdtri(2 * n_noncoherent, pfa))


def correlator_amplitude(
    cn0_dbhz: Reals, integration_s: float | Float[np.ndarray, "*#k"], n_noncoherent: int = 1
) -> Reals:
    """Return A = √(2 K (C/N0) T_I), the magnitude without noise in standard deviations of the noise per dimension."""
    return np.sqrt(2.0 * n_noncoherent * integration_s * 10.0 ** (cn0_dbhz / 10.0))


def probability_of_detection(cn0_dbhz: Reals, integration_s: float, pfa: float, n_noncoherent: int = 1) -> Reals:
    """Return P_d = Q_K(A, g), the probability that the signal exceeds the threshold.

    For K = 1 the relative error is below 1e-12, also for weak signals, where P_d approaches P_fa.

    Parameters
    ----------
    cn0_dbhz
        C/N0 of the component in dBHz.
    integration_s
        Coherent integration time T_I in s.
    pfa
        P_fa of a single test.
    n_noncoherent
        K, number of squared magnitudes in the sum.

    Returns
    -------
    float or float array
        P_d, with the shape of `cn0_dbhz`.

    Raises
    ------
    ValueError
        If P_fa is not between 0 and 1.

    Examples
    --------
    >>> import vestige as vs
    >>> round(float(vs.probability_of_detection(35.0, integration_s=16e-3, pfa=1e-7)), 8)
    0.99999565
    """
    strength = correlator_amplitude(cn0_dbhz, integration_s, n_noncoherent)
    return marcum_q(strength, threshold(pfa, n_noncoherent), n_noncoherent)


def miss_probability(cn0_dbhz: Reals, integration_s: float, pfa: float, n_noncoherent: int = 1) -> Reals:
    """Return 1 − P_d, the probability that the signal stays below the threshold, with full precision for small values.

    The parameters are the parameters of `probability_of_detection`.
    """
    strength = correlator_amplitude(cn0_dbhz, integration_s, n_noncoherent)
    return marcum_p(strength, threshold(pfa, n_noncoherent), n_noncoherent)


def swerling1_probability_of_detection(cn0_dbhz: Reals, integration_s: float, pfa: float) -> Reals:
    """Return P_d = P_fa^{1/(1 + A²/2)} for an amplitude that is Rayleigh distributed from dwell to dwell.

    This P_d is a reference for the strongest fading, because a Rayleigh distributed signal has no direct path.
    `integration_s` and `pfa` are the parameters of `probability_of_detection`. `cn0_dbhz` is the mean C/N0 in dBHz.
    """
    _check(pfa)
    return pfa ** (1.0 / (1.0 + correlator_amplitude(cn0_dbhz, integration_s) ** 2 / 2.0))


def required_cn0_dbhz(pd: Reals, integration_s: float, pfa: float, n_noncoherent: int = 1) -> Reals:
    """Return the C/N0 in dBHz at which the signal is detected with probability P_d.

    The function is the inverse of `probability_of_detection`.

    Parameters
    ----------
    pd
        Requested P_d; above P_fa, below 1.
    integration_s
        Coherent integration time T_I in s.
    pfa
        P_fa of a single test.
    n_noncoherent
        K, number of squared magnitudes in the sum.

    Returns
    -------
    float or float array
        C/N0 in dBHz, with the shape of `pd`.

    Raises
    ------
    ValueError
        If P_d or P_fa is not between 0 and 1, or P_d does not exceed P_fa, which is the P_d without a signal.

    Examples
    --------
    >>> import vestige as vs
    >>> round(float(vs.required_cn0_dbhz(0.9, integration_s=4e-3, pfa=1.334e-7)), 3)
    37.654
    """
    _check(pd)
    if np.any(np.less_equal(pd, pfa)):
        raise ValueError("the wanted probability of detection must exceed the false-alarm probability")
    g = threshold(pfa, n_noncoherent)
    low, high = np.zeros_like(pd, dtype=np.float64), np.full_like(pd, g + _SURE, dtype=np.float64)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        too_weak = marcum_q(middle, g, n_noncoherent) < pd
        too_weak = np.where(np.greater(pd, 0.5), marcum_p(middle, g, n_noncoherent) > np.subtract(1.0, pd), too_weak)
        low, high = np.where(too_weak, middle, low), np.where(too_weak, high, middle)
    return (20.0 * np.log10(high) - 10.0 * np.log10(2.0 * n_noncoherent * integration_s))[()]


def _check(probability: Real, count: float = 1) -> None:
    if not np.all((np.asarray(probability) > 0) & (np.asarray(probability) < 1)):
        raise ValueError(f"a probability must be between 0 and 1, found {probability}")
    if count < 1:
        raise ValueError(f"a number of tests must be at least 1, found {count}")
