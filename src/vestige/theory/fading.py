"""Compute the probability that a signal that fades by multipath is missed, averaged over the fading.

Theory of operation
-------------------
Reflections with random phases add a complex Gaussian g of mean power P to a direct signal of amplitude 1. In units of
the noise per dimension, a correlator output is z = A (1 + g) + w, with A² = 2 (C/N0) T_I. The noise w has variance 1
per dimension, as in `vestige.theory.thresholds`. The terms A g and w are complex Gaussian. So |z| is Rician with the
amplitude A and the variance s² = 1 + A² P/2 per dimension:

    miss = P(|z| < γ) = 1 − Q₁(A/s, γ/s)

γ is the detection threshold, and Q₁ is the Marcum Q function of order 1. C/N0 refers to the direct signal. A real
reflection is delayed, so only a part of its power reaches the correlator of the direct signal. For a direct signal well
above the threshold and weak reflections, the average is therefore an upper limit of the probability of a miss. With P =
0 the formula gives `miss_probability` of `thresholds`.
"""

from __future__ import annotations

import numpy as np

from vestige.theory.marcum_q import Reals, marcum_p
from vestige.theory.thresholds import correlator_amplitude, threshold


def faded_miss_probability(cn0_dbhz: Reals, integration_s: float, pfa: float, ray_power_db: float) -> Reals:
    """Return 1 − P_d, the probability of a miss averaged over the fading by reflections.

    Parameters
    ----------
    cn0_dbhz
        C/N0 of the direct signal in dBHz.
    integration_s
        Coherent integration time T_I in s.
    pfa
        P_fa of a single test.
    ray_power_db
        P in dB, the mean power of all reflections over the power of the direct signal; −inf without reflections.

    Examples
    --------
    For a satellite at 33 dBHz and a RECS of 16 ms, reflections of −15.8 dB multiply the probability of a miss by about
    four:

    >>> f"{faded_miss_probability(33.0, 0.016, 1e-7, -15.8):.3f}"
    '0.035'
    >>> f"{faded_miss_probability(33.0, 0.016, 1e-7, -float('inf')):.4f}"
    '0.0085'
    """
    amplitude = correlator_amplitude(cn0_dbhz, integration_s)
    spread = np.sqrt(1 + np.square(amplitude) * 10 ** (ray_power_db / 10) / 2)
    return marcum_p(amplitude / spread, threshold(pfa) / spread)
