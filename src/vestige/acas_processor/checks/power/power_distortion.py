"""Power and distortion: clean, multipath, spoofed or jammed, from two numbers of one satellite [WESSON18].

Theory of operation
-------------------
A second signal of power η, offset Δτ and phase Δθ beside the tracked one bends the correlation function, adds power:

    D  = |ξ(−τ_d) − ξ(+τ_d)|     symmetric difference of two taps about the prompt, in σ of the noise per dimension
                                 without interference and with the gain of then
    ΔP = 10 log₁₀[(1 + r (1 + η) + J/N)/(1 + r)],   r = Σ C/N0 / W      rise of the power in the band W

with the amplitude s = √(2 C/N0 T) of the tracked signal, whose own share of D cancels:

    no second signal    D² / v ~ χ²(2),   v = 2 (1 − R(2τ_d))      so  D ≤ √(−2 v ln P_fa)
    a second signal     D Rician about s √η |R(τ_d + Δτ) − R(τ_d − Δτ)|

The gain control holds the total power, so D as the taps have it is divided by 10^(ΔP/20): a jammer makes P large and D
small. Multipath makes D without P, a spoofer both. `simulated_decision_map` divides the (ΔP, D) plane into
regions.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from vestige.signals.pulse import BPSK, Pulse, autocorrelation


def distortion_variance(half_spacing_chips: float, pulse: Pulse = BPSK) -> float:
    """Return v = 2 (1 − R(2τ_d)), the variance per dimension of ξ(−τ_d) − ξ(τ_d), in that of one tap.

    `half_spacing_chips` is τ_d, `pulse` that of the replica.
    """
    return 2 * (1 - float(autocorrelation(pulse, np.array([2 * half_spacing_chips]))[0]))


def mean_distortion(
    offset_chips: Float[np.ndarray, "*n"], half_spacing_chips: float, pulse: Pulse = BPSK
) -> Float[np.ndarray, "*n"]:
    """Return |R(τ_d + Δτ) − R(τ_d − Δτ)|, what a second signal of the tracked one's amplitude makes of D/s."""
    early = autocorrelation(pulse, np.ravel(half_spacing_chips + offset_chips))
    late = autocorrelation(pulse, np.ravel(half_spacing_chips - offset_chips))
    return np.reshape(np.abs(early - late), np.shape(offset_chips))


def power_rise_db(
    eta: Float[np.ndarray, "*n"], jam_to_noise: Float[np.ndarray, "*n"], *, signals_to_noise: float
) -> Float[np.ndarray, "*n"]:
    """Return ΔP in dB.

    η is that of each second signal relative to its satellite, all satellites alike; all arguments are linear.
    """
    return 10 * np.log10((1 + signals_to_noise * (1 + eta) + jam_to_noise) / (1 + signals_to_noise))
