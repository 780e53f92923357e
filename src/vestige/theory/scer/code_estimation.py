"""Compute how well an attacker estimates chips and symbols from the part of a signal that is already received.

Security code estimation and replay (SCER) is an attack [HUMPHREYS13]. The attacker receives an unpredictable signal
with a separate antenna. The attacker estimates the signs of this signal during reception, and transmits the estimates.
This module computes the quality of these estimates. The decisions on chips of E6-C are the hard and soft decisions of
[ANDERSON25].

Theory of operation
-------------------
The attacker receives a sign s = ±1 for the time t, and knows the carrier phase. The matched filter gives y = s + n. The
noise n is Gaussian of variance 1/(2γ), with γ = E/N0 = (C/N0) t. The attacker can transmit one of three functions x of
y:

    repeated     x = y                  in phase and in quadrature, as a repeater does
    hard         x = sign y             P(error) = P_e = Q(√(2γ)) = ½ erfc √γ
    soft         x = tanh(2γ y)         E[s|y], the estimate of least mean square error

The share of the power of x that correlates with the true signs is ρ² = E[x s]²/E[|x|²]:

    repeated     ρ² = γ/(1 + γ)
    hard         ρ² = (1 − 2 P_e)²
    soft         ρ² = E[tanh(2γ + √(2γ) z)]        z standard normal; for the estimate E[x s] = E[x²]

The rest of the power is noise, which has 1/ρ² − 1 times the power of the part that correlates.

**Chips of E6-C.** Each chip lasts 1/R_c = 195.5 ns, so Ec/N0 = C/N0 − 67.1 dB. Let the part of the spoofing signal that
correlates have η times the power of the true signal. The rest of the power is noise after the victim's correlator,
because the wrong chips do not correlate. The density of this noise is

    N/N0 = η (Ec/N0 of the victim) (1/ρ² − 1)

The ratio N/N0 is η/G for a repeater whose C/N0 is G times the C/N0 of the victim. An attacker who repeats only the
in-phase part halves the noise without any decision: 1/ρ² − 1 = 1/(2γ).

**Symbols of E1-B** last 4 ms, so an estimate gets better during the symbol. For a symbol of E1-B, t is the duration of
the part of the symbol that the attacker has received.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from jaxtyping import Float
from scipy.special import erf, erfc

from vestige.signals.definitions import E1B, E6C
from vestige.theory.marcum_q import Reals

Decision = Literal["hard", "soft"]
Estimation = Literal["repeated", "hard", "soft"]

# nodes and weights with which the mean over a standard normal variable is computed
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(201)
_WEIGHTS /= _WEIGHTS.sum()
_LINE = np.linspace(-9.0, 9.0, 1801)  # values of a standard normal variable, for integrals over functions with a step


def chip_energy_over_n0(cn0_dbhz: Reals) -> Reals:
    """Return γ = Ec/N0 of a chip of E6-C, as a ratio.

    Parameters
    ----------
    cn0_dbhz
        C/N0 of E6-C in dBHz.

    Examples
    --------
    >>> f"{10 * np.log10(chip_energy_over_n0(45.0)):.1f} dB"
    '-22.1 dB'
    """
    return 10 ** (cn0_dbhz / 10) / E6C.chip_rate_hz


def sign_error_probability(energy_over_n0: Reals) -> Reals:
    """Return P_e = Q(√(2γ)), the probability that a hard decision on a sign is wrong.

    Parameters
    ----------
    energy_over_n0
        γ = E/N0 of a sign as a ratio, 0 or more.

    Examples
    --------
    >>> f"{sign_error_probability(10 ** -0.0855):.3f}"  # −0.9 dB
    '0.100'
    """
    return 0.5 * erfc(np.sqrt(energy_over_n0))


def matching_share(energy_over_n0: Reals, estimation: Estimation) -> Reals:
    """Return ρ², the share of the transmitted power that correlates with the true signs.

    Parameters
    ----------
    energy_over_n0
        γ = E/N0 of a sign as a ratio, above 0.
    estimation
        Chips or symbols that the attacker transmits: repeated, or hard or soft decisions.

    Raises
    ------
    ValueError
        If `estimation` is unknown.

    Examples
    --------
    >>> shares = [matching_share(10 ** -0.0855, name) for name in ("repeated", "hard", "soft")]
    >>> [f"{10 * np.log10(share):.2f} dB" for share in shares]
    ['-3.46 dB', '-1.94 dB', '-1.49 dB']
    """
    if estimation == "repeated":
        return energy_over_n0 / (1 + energy_over_n0)
    if estimation == "hard":
        return np.square(erf(np.sqrt(energy_over_n0)))
    if estimation == "soft":
        return _mean_soft(energy_over_n0)
    raise ValueError(f"no estimation {estimation!r}: expected one of {', '.join(get_args(Estimation))}")


def estimation_noise(victim_cn0_dbhz: float, reception_gain_db: float, estimation: Estimation) -> float:
    """Return N/N0 of the noise in an E6-C spoofing signal whose correlating part is as strong as the true signal.

    Parameters
    ----------
    victim_cn0_dbhz
        C/N0 of E6-C with the victim's antenna in dBHz.
    reception_gain_db
        G in dB, the C/N0 of the attacker's reception over the C/N0 of the victim.
    estimation
        Chips that the attacker transmits: repeated, or hard or soft decisions.

    Examples
    --------
    With G = 25 dB from a dish antenna, the noise of hard decisions is about a fifth of a repeater's noise.

    >>> [f"{10 * np.log10(estimation_noise(45.0, 25.0, name)):.1f} dB" for name in ("repeated", "hard", "soft")]
    ['-25.0 dB', '-31.9 dB', '-33.2 dB']
    """
    received = chip_energy_over_n0(victim_cn0_dbhz + reception_gain_db)
    share = float(matching_share(received, estimation))
    return float(chip_energy_over_n0(victim_cn0_dbhz)) * (1 - share) / share


def replayed_mean(
    cn0_dbhz: float, head_start_s: float, n_chips: int, decision: Decision = "hard"
) -> Float[np.ndarray, " n_chips"]:
    """Return the mean of each of the first chips of a replayed E1-B symbol, for true chips of amplitude +1.

    The attacker updates the estimate for each transmitted chip. So the estimate of chip j, counted from 0, uses the
    signal that is received in j chips and in the head start. Without a received signal, the mean of the estimate is 0.

    Parameters
    ----------
    cn0_dbhz
        C/N0 of E1-B in dBHz with the attacker's antenna.
    head_start_s
        Duration in s of the part of a symbol that the attacker has received when transmission of the symbol begins.
        This duration is the delay of the spoofing signal minus the attacker's latency. If the duration is negative, the
        attacker guesses the symbol for the time −`head_start_s`.
    n_chips
        Number of chips of 0.98 µs from the beginning of the symbol, 1 to 4092.
    decision
        Decision of the attacker, `hard` (±1) or `soft` (E[s|y]).

    Examples
    --------
    With 45 dBHz at the victim and 10 dB more at the attacker, the mean of the fourth chip is 83 % of the true
    amplitude.

    >>> replayed_mean(55.0, 0.0, 4).round(2).tolist()
    [0.0, 0.57, 0.73, 0.83]
    """
    gamma = _received_over_n0(cn0_dbhz, head_start_s, n_chips)
    return _mean_soft(gamma) if decision == "soft" else np.asarray(erf(np.sqrt(gamma)))


def replayed_covariance(
    cn0_dbhz: float, head_start_s: float, n_chips: int, decision: Decision = "hard"
) -> Float[np.ndarray, "n_chips n_chips"]:
    """Return the covariance of the first chips of a replayed E1-B symbol, for true chips of amplitude +1.

    The parameters are the parameters of `replayed_mean`. The computing time grows with the square of `n_chips`.

    Examples
    --------
    The first chip is a random guess, so its variance is 1:

    >>> replayed_covariance(55.0, 0.0, 2).round(2).tolist()
    [[1.0, 0.0], [0.0, 0.68]]
    """
    gamma = _received_over_n0(cn0_dbhz, head_start_s, n_chips)
    if decision == "soft":  # soft decisions are a martingale: E[x_i x_j] = E[x_i²] = E[x_i] for i ≤ j
        mean = _mean_soft(gamma)
        place = np.arange(n_chips)
        return mean[np.minimum.outer(place, place)] - np.outer(mean, mean)
    mean = np.asarray(erf(np.sqrt(gamma)))
    return _sign_products(gamma) - np.outer(mean, mean)


def _received_over_n0(cn0_dbhz: float, head_start_s: float, n_chips: int) -> Float[np.ndarray, " n_chips"]:
    """Return γ of the part of a symbol that the attacker has received when each chip is transmitted."""
    known_s = np.maximum(np.arange(n_chips) / E1B.chip_rate_hz + head_start_s, 0.0)
    return np.asarray(10 ** (cn0_dbhz / 10) * known_s)


def _mean_soft(gamma: Reals) -> Reals:
    """Return the mean E[tanh(2γ + √(2γ) z)] of a soft decision on a sign of +1."""
    argument = np.multiply.outer(2 * gamma, np.ones(_NODES.size)) + np.multiply.outer(np.sqrt(2 * gamma), _NODES)
    return np.minimum(np.tanh(argument) @ _WEIGHTS, 1.0)


def _sign_products(gamma: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n n"]:
    """Return E[sign y_i sign y_j] for all chips i and j of one symbol; a later y contains the earlier signal."""
    density = np.exp(-np.square(_LINE) / 2) / np.sqrt(2 * np.pi) * (_LINE[1] - _LINE[0])
    product = np.eye(gamma.size)
    for i, earlier in enumerate(gamma):
        later = gamma[i + 1 :]
        total = 2 * earlier + np.sqrt(2 * earlier) * _LINE  # 2γ y_i
        since = np.maximum(later - earlier, 1e-300)[:, None]
        # a guess without a received signal is independent of the other signs
        sign = np.sign(total) if earlier > 0 else np.zeros(_LINE.size)
        found = erf((total + 2 * since) / np.sqrt(4 * since)) @ (sign * density)
        product[i, i + 1 :] = product[i + 1 :, i] = found
    return product
