"""Compute the share of detections that a search loses because a screen first correlates a part of the chips.

Theory of operation
-------------------
A cell is a code offset and a Doppler bin of the search. A cell has the correlator output z = A e^{jφ} + w, in units of
the noise of z per dimension. A screen decides quickly which cells are tested. The screen correlates a share f of the
chips. The screen then adds the outputs of two cells half a chip apart, because half of the noise of the two cells is
common. The screen's sum z₁, in units of the noise of z₁, and z have the correlation ρ = √(f (1 + ½)/2). If |z₁| > t,
the two cells pass the screen, and z is compared with the threshold g. If the signal in z₁ has the amplitude ρ A, the
distribution of z₁ for a given z is

    z₁ = ρ z + √(1−ρ²) v,    v complex Gaussian of unit variance per dimension, whatever A is:
    P(miss | |z| = S) = P₁(ρ S/√(1−ρ²), t/√(1−ρ²))

A cell far above the threshold is thus almost never lost. The probability of a miss depends only on S, and not on the
C/N0. For a cell just at the threshold, the mean of z₁ has the magnitude ρ g, and z₁ has the standard deviation √(1−ρ²)
per dimension. With t = ρ g − k √(1−ρ²), this magnitude is k standard deviations above t. The choice of k and f is a
compromise between the loss and the computing time. The share e^{−t²/2} of the screen's sums without a signal exceeds t.
The search uses f = ¾ and k = 2, so ρ is ¾. A screen with f = 9/16 that does not add two outputs also has ρ = ¾, but
needs 50 % more additions.

The loss at a C/N0 is the mean of the probability of a miss over all S > g. The mean is computed for the strongest cell,
over all positions of the signal between the points of the grid. Three effects change the amplitude of the signal in z₁:

* The second output of the sum is half a chip earlier or later than the strongest cell. So the second output contains
  another share of the signal.
* The Doppler bins of the screen are 1/(2 f T_I) apart, and the Doppler bins of the cells are 1/(2 T_I) apart. So the
  nearest bin of the screen may have another frequency than the cell.
* The screen first adds the chips of short segments. Within a segment, the carrier is not removed.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from scipy.special import i0e

from vestige.theory.marcum_q import Reals, marcum_p
from vestige.theory.thresholds import threshold

SCREEN_SHARE = 0.75  # f, share of the chips that the screen correlates
_CORRELATION = float(np.sqrt(SCREEN_SHARE * 0.75))  # ρ
_REST = float(np.sqrt(1 - _CORRELATION**2))
_SCREEN_SIGMAS = 2.0  # k
_STRONGEST = 9.0  # distance in σ from the larger of amplitude and threshold to the end of the integral


def pass_threshold(threshold: Reals) -> Reals:
    """Return the threshold t on the magnitude of the screen's sum in σ per dimension; 0 if every cell must pass.

    Parameters
    ----------
    threshold
        g, the threshold on the magnitude of the correlator output z, in standard deviations of the noise per dimension.

    Examples
    --------
    >>> round(float(pass_threshold(7.85)), 2)
    4.56
    """
    edge = _CORRELATION * threshold - _SCREEN_SIGMAS * _REST
    return np.maximum(edge, 0.0)[()]


def screen_loss(cn0_dbhz: float, integration_s: float, pfa: float, segment_cycles: float = 0.0) -> float:
    """Return the share of the detections of a search that the screen loses, 0 to 1.

    Parameters
    ----------
    cn0_dbhz
        C/N0 of E6-C in dBHz.
    integration_s
        T_I, integration time in s.
    pfa
        False-alarm probability of a single test of the search.
    segment_cycles
        Number of carrier cycles in a segment of the screen at the largest Doppler. The Doppler is uniformly
        distributed between zero and the largest Doppler.

    Examples
    --------
    >>> screen_loss(42.0, 4e-3, 4.2e-14) < 0.006
    True
    """
    g = float(threshold(pfa))
    share, of_share = _unit_interval(5)
    amplitude = np.sqrt(2 * 10 ** (cn0_dbhz / 10) * integration_s)
    # The signal is at most ¼ chip and ¼ cycle from the strongest cell. The positions of the screen's bins repeat after
    # four cells.
    chip, cycle = (share / 4).reshape(-1, 1, 1, 1, 1), (share / 4).reshape(-1, 1, 1, 1)
    second = np.stack([1 / (1 - chip), (1 - chip * 4 / 3) / (1 - chip)], axis=2)[:, :, :, 0]
    step = 0.5 / SCREEN_SHARE
    off = cycle + np.arange(4)[:, None] / 2
    off -= step * np.rint(off / step)
    ratio = second * np.sinc(SCREEN_SHARE * off) / np.sinc(SCREEN_SHARE * cycle) * np.sinc(segment_cycles * share)
    mean = (amplitude * (1 - chip) * np.sinc(cycle))[..., None]
    low, high = g, max(g, amplitude) + _STRONGEST
    nodes, weights = _unit_interval(24)
    s = low + (high - low) * nodes
    density = s * np.exp(-((s - mean) ** 2) / 2) * i0e(s * mean)
    missed = marcum_p(_CORRELATION / _REST * ratio[..., None] * s, pass_threshold(g) / _REST)
    of_place = of_share.reshape(-1, 1, 1, 1, 1) * of_share.reshape(-1, 1, 1, 1) * of_share
    of_cell = np.broadcast_to(of_place[..., None] * density * weights, missed.shape)
    return float(np.sum(of_cell * missed) / np.sum(of_cell))


def _unit_interval(n: int) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]]:
    """Return nodes and weights of a Gauss-Legendre quadrature from 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    return (nodes + 1) / 2, weights / 2
