"""Compute the detection budget of a search of many hypotheses: threshold, required C/N0, P_d on a grid, and ROC.

In the paper's theory the signal is on a grid point. In a real search the signal lies anywhere between the points of the
grid. A step of half a chip loses up to 2.5 dB, and 1.1 dB on average. Bins 1/(2 T_I) apart lose up to 0.9 dB, and 0.3
dB on average (`losses`). So P_d at a given C/N0 is an average over code offset and Doppler. This average is below the
P_d that the paper's theory gives for the same C/N0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vestige.theory.hypotheses import effective_taps
from vestige.theory.losses import code_grid_loss, doppler_grid_loss
from vestige.theory.thresholds import probability_of_detection, required_cn0_dbhz, single_event_pfa, threshold

# P_FA of one search for one satellite. The value keeps the budget of false alarms even if there is a search with each
# RECS.
SEARCH_P_FA = 1e-6
_DOPPLER_CORRELATION = 2 / np.pi  # correlation of the noise of two bins 1/(2 T_I) apart, sinc(1/2)


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchBudget:
    """Detection budget of a search: false-alarm probabilities, threshold, required C/N0 and loss by the grid."""

    hypotheses: float
    independent: float  # number of independent tests with the same P_FA as the N hypotheses
    pfa_overall: float  # false-alarm probability of the whole search
    pfa: float  # false-alarm probability of a single test
    threshold: float  # threshold on the magnitude, in standard deviations of the noise per dimension
    required_cn0_dbhz: float  # C/N0 of E6-C in dBHz at which a signal on a grid point has P_d = 0.9
    grid_loss_db: float  # mean loss in dB by the grids of code offset and Doppler


def search_budget(
    hypotheses: float,
    integration_s: float,
    *,
    overall_pfa: float = 1e-3,
    correlated_neighbours: bool = False,
    doppler_step_hz: float | None = None,
) -> SearchBudget:
    """Return the detection budget of a search of N hypotheses half a chip apart.

    `overall_pfa` is the probability that noise alone exceeds the threshold in any test. The noise of neighbouring tests
    has the correlation ½ in code offset, and 2/π in Doppler. `correlated_neighbours` reduces N to the number of
    independent tests with the same P_FA. In an exhaustive search with a time uncertainty of 30 s, the threshold without
    this reduction is too high by less than 0.0001 dB. `doppler_step_hz` is the distance of the Doppler bins, by default
    1/(2 T_I). The distance 0 means a known Doppler.
    """
    pfa = float(single_event_pfa(overall_pfa, max(hypotheses, 1.0)))
    independent = max(hypotheses, 1.0)
    step_hz = 0.5 / integration_s if doppler_step_hz is None else doppler_step_hz
    if correlated_neighbours:
        share = (float(effective_taps(pfa, 2, 0.5)) - 1) * (
            float(effective_taps(pfa, 2, _DOPPLER_CORRELATION)) - 1 if step_hz else 1.0
        )
        independent = max(independent * share, 1.0)
        pfa = float(single_event_pfa(overall_pfa, independent))
    doppler_loss_db = doppler_grid_loss(step_hz, integration_s).mean_db if step_hz else 0.0
    return SearchBudget(
        hypotheses=hypotheses,
        independent=independent,
        pfa_overall=overall_pfa,
        pfa=pfa,
        threshold=float(threshold(pfa)),
        required_cn0_dbhz=float(required_cn0_dbhz(0.9, integration_s, pfa)),
        grid_loss_db=code_grid_loss(0.5).mean_db + doppler_loss_db,
    )


def grid_probability_of_detection(
    cn0_dbhz: float, integration_s: float, pfa: float, *, bins: bool = True, half_step_chips: float = 0.25
) -> float:
    """Return P_d of the strongest cell, averaged over all positions of a signal between the points of the grid.

    `pfa` is the false-alarm probability of a cell. `half_step_chips` is half the distance of the code offsets in chips.
    If `bins` is true, the Doppler is also on a grid, with steps of 1/(2 T_I). If `bins` is false, the Doppler is known.
    """
    nodes, weights = np.polynomial.legendre.leggauss(24)
    share = (nodes + 1) / 2
    code_db = -20 * np.log10(1 - half_step_chips * share)
    doppler_db = -20 * np.log10(np.sinc(share / 4)) if bins else np.zeros(1)
    doppler_weights = weights / 2 if bins else np.ones(1)
    loss_db = code_db[:, None] + doppler_db
    pd = probability_of_detection(cn0_dbhz - loss_db, integration_s, pfa)
    return float((weights / 2) @ pd @ doppler_weights)


@dataclass(frozen=True, slots=True, kw_only=True)
class RocPoint:
    """Probability of a false alarm and probability of detection of a search, at one threshold."""

    overall_pfa: float
    probability_of_detection: float


def roc(
    cn0_dbhz: float, integration_s: float, hypotheses: float, overall_pfa: Sequence[float], *, bins: bool = True
) -> tuple[RocPoint, ...]:
    """Return the receiver operating characteristic of a search of N hypotheses, including the losses by the grid.

    If `bins` is true, the Doppler is on a grid (exhaustive search). If `bins` is false, the Doppler is known (hand-over
    search).
    """
    return tuple(
        RocPoint(
            overall_pfa=pfa,
            probability_of_detection=grid_probability_of_detection(
                cn0_dbhz, integration_s, float(single_event_pfa(pfa, hypotheses)), bins=bins
            ),
        )
        for pfa in overall_pfa
    )
