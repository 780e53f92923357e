"""Compute the gains of a digital tracking loop that has exactly the requested noise bandwidth.

Theory of operation
-------------------
In integration k, of length T, the loop measures the phase error e_k of the code or the carrier. The loop then sets the
rate of its oscillator for the next integration:

    a_{k+1} = a_k + γ₃ e_k / T²        order 3
    f_{k+1} = f_k + a_{k+1} T + γ₂ e_k / T        order 2 and 3
    r_{k+1} = f_{k+1} + γ₁ e_k / T        rate of the oscillator

The correlator measures the oscillator's phase at the middle of an integration: φ_{k+1} = φ_k + T (r_k + r_{k+1})/2. The
noise n_k of the measured phase is independent from one integration to the next. With the impulse response h_j of the
loop, the noise of φ is Σ h_j n_{k−j}. The one-sided noise bandwidth is B = Σ h_j² / (2T), so that σ_φ² = 2 B T σ_n² is
exact.

The gains are γ₁ = b₁ x, γ₂ = b₂ x², γ₃ = b₃ x³ with x = ω T and the natural frequency ω. A loop of order 1 has (b₁, b₂,
b₃) = (1, 0, 0). A loop of order 2 has (√2, 1, 0), which gives the damping 1/√2. A loop of order 3 has (2.4, 1.1, 1)
[KAPLAN06, Table 5.6]. The textbook gives B as a function of ω for T → 0. This module chooses ω so that the digital loop
with its delay has the requested B.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy import optimize

from vestige.errors import VestigeError

# factors b₁, b₂ and b₃ of the gains γ₁, γ₂ and γ₃, by the order of the loop [KAPLAN06, Table 5.6]
_SHAPES = {1: (1.0, 0.0, 0.0), 2: (np.sqrt(2.0), 1.0, 0.0), 3: (2.4, 1.1, 1.0)}
_LARGEST = {1: 1.3, 2: 0.8, 3: 0.45}  # largest useful x; above this x the loop oscillates too much


def gains_of(order: int, x: float) -> tuple[float, float, float]:
    """Return the gains (γ₁, γ₂, γ₃) of a loop of the given order for x = ω T."""
    first, second, third = _SHAPES[order]
    return first * x, second * x**2, third * x**3


def noise_bandwidth_hz(gains: tuple[float, float, float], interval_s: float) -> float:
    """Return the one-sided noise bandwidth B of a loop; infinite if the loop is not stable.

    Parameters
    ----------
    gains
        Gains (γ₁, γ₂, γ₃).
    interval_s
        Integration time T in s.
    """
    g1, g2, g3 = gains
    # The state is (φ, r, f, a), with T as the unit of time. Each step is φ' = φ + (r + r')/2 with e = n − φ.
    e = np.array([-1.0, 0.0, 0.0, 0.0])
    rate_rate = np.array([0.0, 0.0, 0.0, 1.0]) + g3 * e
    frequency = np.array([0.0, 0.0, 1.0, 0.0]) + rate_rate + g2 * e
    rate = frequency + g1 * e
    phase = np.array([1.0, 0.5, 0.0, 0.0]) + rate / 2
    step = np.stack((phase, rate, frequency, rate_rate))
    kept = [0, 1] + [2] * (g2 > 0) + [3] * (g3 > 0)  # indices of the states that a loop of this order has
    noise = np.array([(g1 + g2 + g3) / 2, g1 + g2 + g3, g2 + g3, g3])[kept]
    step = step[np.ix_(kept, kept)]
    if np.max(np.abs(np.linalg.eigvals(step))) >= 1.0:
        return float("inf")
    # covariance of the state for white noise of variance 1: C = step C stepᵀ + noise noiseᵀ
    size = len(kept)
    covariance = np.linalg.solve(np.eye(size**2) - np.kron(step, step), np.outer(noise, noise).ravel())
    return float(covariance[0] / (2 * interval_s))


@lru_cache(maxsize=64)
def loop_gains(order: int, bandwidth_hz: float, interval_s: float) -> tuple[float, float, float]:
    """Return the gains (γ₁, γ₂, γ₃) of a loop.

    Parameters
    ----------
    order
        Order of the loop: 1, 2 or 3.
    bandwidth_hz
        One-sided noise bandwidth B in Hz.
    interval_s
        Integration time T in s.

    Raises
    ------
    VestigeError
        If B T is too large for a loop that updates once in T.

    Examples
    --------
    >>> gains = loop_gains(3, 15.0, 0.004)
    >>> round(noise_bandwidth_hz(gains, 0.004), 6)
    15.0
    """

    def misfit(x: float) -> float:
        return noise_bandwidth_hz(gains_of(order, x), interval_s) / bandwidth_hz - 1.0

    largest = _LARGEST[order]
    if not misfit(largest) > 0:
        raise VestigeError(
            f"tracking: a loop of order {order} with {bandwidth_hz:g} Hz cannot be updated every "
            f"{1e3 * interval_s:g} ms; take a smaller bandwidth or a shorter integration time"
        )
    smallest = 0.1 * bandwidth_hz * interval_s  # for small T, x is 1.3 to 4 times B T
    return gains_of(order, float(optimize.brentq(misfit, smallest, largest, xtol=1e-15)))
