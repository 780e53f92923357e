"""Compute the number of hypotheses N of a search, which relates P_fa of a single test to P_FA of the whole search.

Theory of operation
-------------------
The exhaustive search and the search with hand-over look for a signal within the time uncertainty ΔT [WFO, Sec. III-D
and III-E]. The two searches have these numbers of hypotheses:

    exhaustive   N = (ΔT / code step) · (Doppler span / Doppler step)      half a chip, 1/(2 T_I)
    hand-over    N = (ΔT / E1 code period) · taps                          one Doppler bin, known from E1

The paper counts 30 s / 4 ms = 7500 hypotheses for the hand-over, one code offset in each period of the E1 code. With a
bank of taps, this number is multiplied by the number of taps. The hand-over saves tests on E6 because a detection on E1
comes first. The detection on E1 has its own number of hypotheses. `exhaustive_hypotheses` computes this number if ΔT is
the period of the E1 code and `chip_s` is the duration of an E1 chip.

The numbers are not rounded to whole steps. Hypotheses less than a chip apart have correlated noise, so N of these
hypotheses have a smaller P_FA than N independent hypotheses. `effective_taps` computes the number of independent
hypotheses that have the same P_FA as a bank of taps.
"""

from __future__ import annotations

import numpy as np

from vestige.signals.definitions import E1C, E6C
from vestige.theory.marcum_q import Reals, marcum_q
from vestige.theory.thresholds import threshold

_NODES, _WEIGHTS = np.polynomial.laguerre.laggauss(48)


def code_offsets(time_uncertainty_s: float, chip_s: float = 1 / E6C.chip_rate_hz) -> float:
    """Return the number of code offsets, half a chip apart, within the time uncertainty.

    `time_uncertainty_s` is ΔT in s, the whole width of the uncertainty.
    """
    return time_uncertainty_s / chip_s * 2.0


def doppler_bins(doppler_span_hz: float, integration_s: float) -> float:
    """Return the number of Doppler bins 1/(2 T_I) wide within the whole Doppler span.

    `doppler_span_hz` is the whole width of the Doppler uncertainty, such as 10 kHz for ±5 kHz. `integration_s` is the
    integration time T_I.
    """
    return doppler_span_hz * 2.0 * integration_s


def exhaustive_hypotheses(
    time_uncertainty_s: float,
    integration_s: float,
    doppler_span_hz: float,
    chip_s: float = 1 / E6C.chip_rate_hz,
) -> float:
    """Return the number of hypotheses of a search over all code offsets and Doppler bins [WFO, Sec. III-D]."""
    return code_offsets(time_uncertainty_s, chip_s) * doppler_bins(doppler_span_hz, integration_s)


def handover_hypotheses(time_uncertainty_s: float, taps: int = 1) -> float:
    """Return the number of hypotheses of a search on E6 at the code phase and Doppler from E1 [WFO, Sec. III-E].

    The code phase of E1 gives a position in each period of the E1 code. `taps` code offsets are tested at each
    position.
    """
    return time_uncertainty_s / E1C.period_s * taps


def effective_taps(pfa: Reals, taps: int, correlation: float) -> Reals:
    """Return the number of independent tests that have the same P_FA as a bank of taps with correlated noise.

    The number is N_eff = n − (n−1) P₁₂/P_fa, where n is `taps`. P₁₂ is the probability that two neighbouring taps raise
    a false alarm together:

        P₁₂/P_fa = ∫_0^∞ e^{-t} Q₁(ρ√(g²+2t)/s, g/s) dt,    s = √(1−ρ²),  g the threshold

    N_eff is an upper limit, because the formula includes only coincidences of neighbouring taps. The error of N_eff
    vanishes for small P_fa, and is 1 % at P_fa = 1e-3 (11 taps, ρ = 0.74).

    `pfa` is the false-alarm probability of each tap. `correlation` is ρ, the correlation of the noise of neighbouring
    taps, at least 0 and below 1.
    """
    if not 0 <= correlation < 1:
        raise ValueError(f"the correlation of neighbours must be in [0, 1), found {correlation}")
    g = np.asarray(threshold(pfa))[..., None]
    independent = np.sqrt(1 - correlation**2)
    neighbour = np.sqrt(g**2 + 2 * _NODES)
    together = marcum_q(correlation * neighbour / independent, g / independent) @ _WEIGHTS
    return taps - (taps - 1) * together
