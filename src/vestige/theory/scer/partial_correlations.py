"""Detect a replay by partial correlations of E1-B symbols: five metrics, their thresholds and detection probabilities.

The detectors of [SECO-GRANADOS20] compare partial correlations over predictable and unpredictable parts of the signal.
The attacker knows a predictable symbol from its beginning on and has to estimate an unpredictable symbol. The text of
the publication was not available, so the formulas are derived here from the idea in its abstract.

Theory of operation
-------------------
The receiver correlates the first w seconds of each symbol and multiplies the correlation by the symbol. B_u is the mean
over n_u unpredictable symbols, and B_p is the mean over n_p predictable symbols. B_u and B_p are complex. With an
authentic signal, the amplitude A of the signal is the expected value of B_u and of B_p. The front end's filter has
equal effects on B_u and B_p. The noise of one symbol has the variance s² = A²/(2 c w) per dimension, with c = C/N0. The
receiver estimates this variance from the real parts of the correlations, with ν = n_u + n_p − 2 degrees of freedom.
With e² = s² (1/n_u + 1/n_p) the metrics are

    real         Re(B_p − B_u) / e             Student's t, ν degrees of freedom
    distance     |B_p − B_u|² / (2 e²)         F with 2 and ν degrees of freedom
    magnitudes   (|B_p| − |B_u|) / e           difference of two Rice variables
    ratio        |B_p| / |B_u|                 ratio of two Rice variables
    paired       √n_u mean(d) / std(d)         Student's t, n_u − 1 degrees of freedom

The metric `paired` needs no predictable symbols. In this metric, d is the correlation of the later part of an
unpredictable symbol minus the correlation of its first part. A metric above its threshold raises an alarm. The
thresholds of `real`, `distance` and `paired` are exact. The thresholds of `magnitudes` and `ratio` assume that A and s
are known. The receiver estimates A from the later parts of the symbols. The estimate of s is multiplied by t/z, where t
and z are the quantiles of Student's t and of the normal distribution. With this factor, the thresholds are exact in the
limit of A far above s/√n_u and s/√n_p.

**The ratio of Rice variables.** Let X and Y be independent and complex Gaussian, with the means x and y and the
variances σ² and τ² per dimension. With S = σ² + τ², the probability that |X| exceeds |Y| is [PROAKIS08, app. B]:

    P(|X| > |Y|) = Q₁(α, β) − τ²/S e^{−(α² + β²)/2} I₀(αβ)        α = |x|/√S, β = |y|/√S

**Under attack** the first part of an unpredictable symbol has the mean A m and the additional variance A² V in phase.
`replayed_mean` and `replayed_covariance` give m and V. For `magnitudes` and `ratio`, V is used in both dimensions,
because the quadrature part changes a magnitude in second order only. For `distance`, `magnitudes` and `ratio`, the
estimate of s is replaced by its mean, so n_u + n_p should be 50 or more.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

import numpy as np
from scipy.optimize import brentq
from scipy.special import erfc, i0e, nctdtr, ndtri, stdtrit

from vestige.signals.definitions import E1B
from vestige.theory.marcum_q import marcum_p, marcum_q
from vestige.theory.scer.code_estimation import Decision, replayed_covariance, replayed_mean

# number of chips in the first part of a symbol, near the best number against an attacker with G = 10 dB at 42 dBHz
FIRST_CHIPS = 4
PREDICTABLE_EACH = 468 / 32  # number of predictable symbols per unpredictable symbol of an I/NAV page

ReferenceMetric = Literal["real", "distance", "magnitudes", "ratio"]
Metric = Literal["paired"] | ReferenceMetric

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(100)
_REACH = 9.0  # half width of the integrals in standard deviations


def metric_value(
    unpredictable: complex,
    predictable: complex,
    noise: float,
    n_unpredictable: int,
    n_predictable: int,
    metric: ReferenceMetric,
) -> float:
    """Return the metric of two partial correlations; a replay makes the metric large.

    Parameters
    ----------
    unpredictable, predictable
        B_u and B_p, the mean correlations of the first parts of unpredictable and of predictable symbols.
    noise
        s, standard deviation of the noise in the first part of one symbol, per dimension, in the unit of the
        correlations.
    n_unpredictable, n_predictable
        n_u and n_p, the numbers of symbols in the means B_u and B_p.
    metric
        Name of the metric.

    Raises
    ------
    ValueError
        If `metric` is unknown.

    Examples
    --------
    >>> [round(metric_value(0.7, 1.0, 2.0, 480, 7020, metric), 2) for metric in ("real", "distance", "ratio")]
    [3.18, 5.05, 1.43]
    """
    spread = noise * np.sqrt(1 / n_unpredictable + 1 / n_predictable)
    if metric == "real":
        return float((predictable - unpredictable).real / spread)
    if metric == "distance":
        return float(abs(predictable - unpredictable) ** 2 / (2 * spread**2))
    if metric == "magnitudes":
        return float((abs(predictable) - abs(unpredictable)) / spread)
    if metric == "ratio":
        return float(abs(predictable) / abs(unpredictable))
    raise ValueError(f"no metric {metric!r}: expected one of {', '.join(get_args(ReferenceMetric))}")


def metric_threshold(
    n_unpredictable: int, n_predictable: int, p_fa: float, amplitude: float, metric: ReferenceMetric
) -> float:
    """Return the threshold that the metric of an authentic signal exceeds with a probability of p_fa.

    Parameters
    ----------
    n_unpredictable, n_predictable
        n_u and n_p, the numbers of unpredictable and predictable symbols.
    p_fa
        False-alarm probability, below 0.5.
    amplitude
        A/s, the amplitude of the signal over the standard deviation of the noise in the first part of one symbol. The
        metrics `real` and `distance` do not use A/s.
    metric
        Name of the metric.

    Raises
    ------
    ValueError
        If p_fa is not between 0 and 0.5.

    Examples
    --------
    >>> [round(metric_threshold(480, 7020, 1e-3, 0.35, metric), 2) for metric in ("real", "distance", "ratio")]
    [3.09, 6.91, 1.66]
    """
    if not 0 < p_fa < 0.5:
        raise ValueError(f"a false-alarm probability must lie between 0 and 0.5, found {p_fa:g}")
    freedom = n_unpredictable + n_predictable - 2
    student = -float(stdtrit(freedom, p_fa))
    if metric == "real":
        return student
    if metric == "distance":
        return float(freedom / 2 * np.expm1(-2 / freedom * np.log(p_fa)))
    wide = student / -float(ndtri(p_fa))
    both = amplitude, wide / np.sqrt(n_unpredictable), amplitude, wide / np.sqrt(n_predictable)
    if metric == "magnitudes":
        spread = np.sqrt(1 / n_unpredictable + 1 / n_predictable)
        return _solved(lambda t: _magnitudes_exceed(t * spread, *both), -10.0, p_fa)
    return _solved(lambda t: _ratio_exceeds(t, *both), 0.0, p_fa)


def replay_detection_probability(
    cn0_dbhz: float,
    reception_gain_db: float,
    n_symbols: int,
    p_fa: float,
    *,
    metric: Metric = "paired",
    n_predictable: int | None = None,
    head_start_s: float = 0.0,
    first_chips: int = FIRST_CHIPS,
    decision: Decision = "hard",
) -> float:
    """Return the probability P_d that a test detects an attacker who estimates the unpredictable symbols.

    The correlators receive only white noise and the spoofing signal, which is as strong as the authentic signal would
    be.

    Parameters
    ----------
    cn0_dbhz
        C/N0 of E1-B at the victim in dBHz.
    reception_gain_db
        G in dB, the C/N0 of the attacker's reception over the C/N0 of the victim.
    n_symbols
        Number of unpredictable symbols in the test.
    p_fa
        False-alarm probability; below 0.5 except for `paired`.
    metric
        Name of the metric of the partial correlations.
    n_predictable
        Number of predictable symbols in the test. None means all predictable symbols in the pages of the unpredictable
        symbols.
    head_start_s
        Duration in s of the part of a symbol that the attacker has received when transmission of the symbol begins. The
        duration is negative if transmission begins before reception.
    first_chips
        Number of chips in the first part of a symbol.
    decision
        Whether the attacker transmits hard or soft decisions.

    Examples
    --------
    The tests use the 480 unpredictable symbols of a subframe at 42 dBHz, with a P_fa of 1e-3. For the first value, the
    attacker's antenna is like the victim's antenna. For the second value, the attacker's antenna has 10 dB more gain.
    For the third value, the attacker also delays the spoofing signal by 3 µs.

    >>> f"{replay_detection_probability(42.0, 0.0, 480, 1e-3):.3f}"
    '0.999'
    >>> f"{replay_detection_probability(42.0, 10.0, 480, 1e-3):.3f}"
    '0.906'
    >>> f"{replay_detection_probability(42.0, 10.0, 480, 1e-3, head_start_s=3e-6):.3f}"
    '0.104'

    The next value is for the metric `real`, which compares the first parts of unpredictable and predictable symbols.
    The last value is for the metric `distance`, which does not use the sign of the difference:

    >>> f"{replay_detection_probability(42.0, 10.0, 480, 1e-3, metric='real'):.3f}"
    '0.895'
    >>> f"{replay_detection_probability(42.0, 10.0, 480, 1e-3, metric='distance'):.3f}"
    '0.777'
    """
    attacker = cn0_dbhz + reception_gain_db, head_start_s
    mean = replayed_mean(*attacker, E1B.code_length, decision)
    first, own = (
        float(np.mean(mean[:first_chips])),
        float(np.mean(replayed_covariance(*attacker, first_chips, decision))),
    )
    first_s, later_s = (n / E1B.chip_rate_hz for n in (first_chips, E1B.code_length - first_chips))
    cn0 = 10 ** (cn0_dbhz / 10)
    if metric == "paired":
        noise = (1 / first_s + 1 / later_s) / (2 * cn0)
        shift = np.sqrt(n_symbols) * (float(np.mean(mean[first_chips:])) - first) / np.sqrt(noise + own)
        return float(1 - nctdtr(n_symbols - 1, shift, -stdtrit(n_symbols - 1, p_fa)))
    n_p = round(n_symbols * PREDICTABLE_EACH) if n_predictable is None else n_predictable
    one, freedom = 1 / (2 * cn0 * first_s), n_symbols + n_p - 2  # s² and ν
    estimated = float(np.sqrt(one + own * (n_symbols - 1) / freedom))  # root of the mean estimate of s²
    threshold = metric_threshold(n_symbols, n_p, p_fa, 1 / estimated, metric)
    spread = estimated * float(np.sqrt(1 / n_symbols + 1 / n_p))
    noise_u, noise_p = float(np.sqrt((one + own) / n_symbols)), float(np.sqrt(one / n_p))
    if metric == "ratio":
        return _ratio_exceeds(threshold, first, noise_u, 1.0, noise_p)
    if metric == "magnitudes":
        return _magnitudes_exceed(threshold * spread, first, noise_u, 1.0, noise_p)
    in_phase = float(np.hypot(noise_u, noise_p))
    if metric == "real":
        return float(1 - nctdtr(freedom, (1 - first) / in_phase, threshold * spread / in_phase))
    quadrature = float(np.sqrt(one / n_symbols + one / n_p))
    x = np.linspace(-_REACH, _REACH, 2001)
    rest = np.maximum(2 * threshold * spread**2 - np.square(1 - first + in_phase * x), 0.0)
    density = np.exp(-np.square(x) / 2) / np.sqrt(2 * np.pi) * (x[1] - x[0])
    return float(erfc(np.sqrt(rest / 2) / quadrature) @ density)


def _ratio_exceeds(ratio: float, mean_u: float, noise_u: float, mean_p: float, noise_p: float) -> float:
    """Return the probability P(|B_p| > ratio |B_u|)."""
    total = float(np.hypot(ratio * noise_u, noise_p))
    alpha, beta = mean_p / total, ratio * mean_u / total
    share = (ratio * noise_u / total) ** 2
    return float(marcum_q(alpha, beta) - share * np.exp(-((alpha - beta) ** 2) / 2) * i0e(alpha * beta))


def _magnitudes_exceed(difference: float, mean_u: float, noise_u: float, mean_p: float, noise_p: float) -> float:
    """Return the probability P(|B_p| − |B_u| > difference), as an integral over the magnitude with less noise."""
    mean, noise = (mean_p, noise_p) if noise_p <= noise_u else (mean_u, noise_u)
    low, high = max(mean / noise - _REACH, 0.0), mean / noise + _REACH
    x = (low + high) / 2 + (high - low) / 2 * _NODES
    density = (high - low) / 2 * _WEIGHTS * x * np.exp(-np.square(x - mean / noise) / 2) * i0e(x * mean / noise)
    if noise_p <= noise_u:
        beyond = marcum_p(np.full(x.size, mean_u / noise_u), np.maximum(noise * x - difference, 0.0) / noise_u)
    else:
        beyond = marcum_q(np.full(x.size, mean_p / noise_p), np.maximum(noise * x + difference, 0.0) / noise_p)
    return float(beyond @ density)


def _solved(tail: Callable[[float], float], low: float, p_fa: float) -> float:
    """Return the threshold t above `low` with tail(t) = p_fa, for a function `tail` that decreases."""
    high = low + 10.0
    while tail(high) > p_fa:
        high = low + 2 * (high - low)
    return float(brentq(lambda t: np.log(max(tail(t), 1e-300) / p_fa), low, high, xtol=1e-6))
