"""The price of a screen that first looks at half of the chips: the share of detections that a search loses.

Theory of operation
-------------------
A correlator output is z = A e^{jφ} + w over all of its chips, and z₁ = √f A e^{jφ} + w₁ over a share f of them. Both
are in units of their own noise per dimension. If |z₁| > t, the cell is kept and z is compared with the threshold g. The
correlation of the two is √f, so for a given z

    z₁ = √f z + √(1−f) v,    v complex Gaussian of unit variance per dimension, whatever A is:
    P(miss | |z| = S) = P₁(√(f/(1−f)) S, t/√(1−f))

A cell far above the threshold is thus almost never lost, and the loss depends only on S, not on the C/N0. With t = √f g
− k √(1−f), a cell just at the threshold is k standard deviations above t. The choice of k and f balances the loss
against the time: noise passes e^{−t²/2} of the cells. Here f = ½ and k = 1.5.

The loss at a C/N0 is the mean of this probability over all S > g. The mean is computed for the strongest cell, with the
signal anywhere between the points of the grid. The screen's bins are 1/T_I apart, so a bin may be 1/(2 T_I) off the
frequency of that cell.
"""

from __future__ import annotations

import numpy as np
from scipy.special import i0e

from vestige.theory.marcum_q import Reals, marcum_p
from vestige.theory.thresholds import threshold

SCREEN_SHARE = 0.5  # f, share of the chips
_SCREEN_SIGMAS = 1.5  # k
_STRONGEST = 9.0  # integration limit above the larger of amplitude and threshold; the rest is negligible


def pass_threshold(threshold: Reals) -> Reals:
    """Return t, the threshold on the magnitude of the screen's sum in σ per dimension; 0 if every cell must pass.

    Parameters
    ----------
    threshold
        g, threshold on the magnitude of the whole sum, in standard deviations of its noise per dimension.

    Examples
    --------
    >>> round(pass_threshold(7.85), 2)
    4.49
    """
    edge = np.sqrt(SCREEN_SHARE) * threshold - _SCREEN_SIGMAS * np.sqrt(1 - SCREEN_SHARE)
    return np.maximum(edge, 0.0)[()]


def screen_loss(cn0_dbhz: float, integration_s: float, pfa: float) -> float:
    """Return the share of the detections that the screen loses.

    Parameters
    ----------
    cn0_dbhz
        C/N0 of E6-C.
    C/N0 of E6-C in dBHz.
        T_I in s.
    T_I, integration time in s.
        Single-event false-alarm probability of the search.

    Examples
    --------
    >>> screen_loss(42.0, 4e-3, 4.2e-14) < 0.006
    True
    """
    g = float(threshold(pfa))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    share, weights = (nodes + 1) / 2, weights / 2
    amplitude = np.sqrt(2 * 10 ** (cn0_dbhz / 10) * integration_s)
    # code at most ¼ chip and Doppler at most ¼ cycle off; in half of the cases the screen has no bin at the cell's
    # frequency
    between = (1 - 0.25 * share)[:, None, None] * np.sinc(share / 4)[:, None]
    apart = np.sinc((0.5 - share / 4) / 2) / np.sinc(share / 8)
    same = np.stack([np.ones_like(apart), apart], axis=1)
    mean = (amplitude * between)[..., None]
    low, high = g, max(g, amplitude) + _STRONGEST
    s = low + (high - low) * share
    density = s * np.exp(-((s - mean) ** 2) / 2) * i0e(s * mean)
    ratio = np.sqrt(SCREEN_SHARE / (1 - SCREEN_SHARE))
    missed = marcum_p(ratio * same[..., None] * s, pass_threshold(g) / np.sqrt(1 - SCREEN_SHARE))
    of_place = weights[:, None, None] * weights[:, None] * np.full(2, 0.5)
    detected = np.sum(of_place[..., None] * density * weights)
    return float(np.sum(of_place[..., None] * density * missed * weights) / detected)
