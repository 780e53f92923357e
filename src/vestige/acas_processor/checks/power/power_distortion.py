"""Compute power and distortion, which separate clean, multipath, spoofed and jammed signals [WESSON18].

Theory of operation
-------------------
A second signal of relative power η, offset Δτ and phase Δθ distorts the correlation function ξ of the tracked signal
and adds power:

    D  = |ξ(−τ_d) − ξ(+τ_d)|     symmetric difference of two taps about the prompt, in σ of the noise per dimension
                                 without interference
    ΔP = 10 log₁₀[(1 + r (1 + η) + J/N)/(1 + r)],   r = Σ C/N0 / W      rise of the power in the band W

The tracked signal has the amplitude s = √(2 C/N0 T) for the integration time T, and its own contribution to D cancels.
R is the autocorrelation of the replica:

    no second signal    D² / v ~ χ²(2),   v = 2 (1 − R(2τ_d))      so  D ≤ √(−2 v ln P_fa)
    a second signal     D Rician about s √η |R(τ_d + Δτ) − R(τ_d − Δτ)|

The gain control keeps the total power constant, so the measured D is smaller by the factor 10^(ΔP/20). A jammer makes
ΔP large and leaves D small. Multipath makes D large and leaves ΔP small. A spoofer makes ΔP and D large.
`simulated_decision_map` divides the (ΔP, D) plane into regions.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from vestige.signals.pulse import BPSK, Pulse, autocorrelation


def distortion_variance(half_spacing_chips: float, pulse: Pulse = BPSK) -> float:
    """Return v = 2 (1 − R(2τ_d)), the variance per dimension of ξ(−τ_d) − ξ(τ_d) over the variance of a tap.

    `half_spacing_chips` is τ_d, and `pulse` is the pulse of the replica.
    """
    return 2 * (1 - float(autocorrelation(pulse, np.array([2 * half_spacing_chips]))[0]))


def mean_distortion(
    offset_chips: Float[np.ndarray, "*n"], half_spacing_chips: float, pulse: Pulse = BPSK
) -> Float[np.ndarray, "*n"]:
    """Return |R(τ_d + Δτ) − R(τ_d − Δτ)|, which is D/s without noise for a second signal of equal amplitude."""
    early = autocorrelation(pulse, np.ravel(half_spacing_chips + offset_chips))
    late = autocorrelation(pulse, np.ravel(half_spacing_chips - offset_chips))
    return np.reshape(np.abs(early - late), np.shape(offset_chips))


def power_rise_db(
    eta: Float[np.ndarray, "*#n"], jam_to_noise: Float[np.ndarray, "*#n"], *, signals_to_noise: float
) -> Float[np.ndarray, "*#n"]:
    """Return ΔP, the rise of the power in the band, in dB.

    Each satellite has two signals. η is the power of the second signal divided by the power of the true signal, and is
    equal for all satellites. All arguments are linear ratios. An argument of length 1 is valid for all elements of the
    result.
    """
    return 10 * np.log10((1 + signals_to_noise * (1 + eta) + jam_to_noise) / (1 + signals_to_noise))
