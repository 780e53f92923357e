"""Compute the error that reflections cause in an E1 delay lock loop, from the root of the loop's discriminator.

Theory of operation
-------------------
R is the autocorrelation of the pulse. Reflections have the complex amplitudes a_i and excess delays τ_i. A correlator
that is x later than the line of sight gives S(x) = R(x) + Σ_i a_i R(x − τ_i). The loop settles where the early and the
late correlator, which are d apart, have the same power:

    D(x) = |S(x − d/2)|² − |S(x + d/2)|² = 0,    D rising through 0

The loop starts on the line of sight. If D(0) < 0, the late correlator is stronger, and the loop moves later until D
changes its sign. If D(0) > 0, the loop moves earlier. The loop moves by at most 0.5 chip. The first change of sign is
searched in steps of d/8 and then located by the Illinois variant of false position. R is piecewise linear, so D is
piecewise quadratic and a few steps are enough.

The result assumes a loop that follows the reflections at once. The assumption is right for reflections whose phase
changes slowly against the loop bandwidth. Front-end filtering is left out, as in the calibration of the multipath
model.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Complex128, Float, Int

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.signals.definitions import E1C
from vestige.signals.pulse import BOC11, Pulse, autocorrelation

LOOP_REACH_CHIPS = 0.5  # largest distance in chips from the line of sight at which a loop still tracks the peak
_STEPS_PER_SPACING = 8
_FALSE_POSITIONS = 40
_TOLERANCE_CHIPS = 1e-10  # 1e-10 chip is a delay of 30 nm
_KEPT_EPOCHS = 1000  # largest number of epochs whose result is cached


def e1_multipath_error_m(
    delay_m: Float[np.ndarray, "n n_rays"],
    amplitude: Complex128[np.ndarray, "n n_rays"],
    *,
    spacing_chips: float = 0.1,
    pulse: Pulse = BOC11,
) -> Float[np.ndarray, " n"]:
    """Return the error of the pseudorange in m, positive if the pseudorange is too long; 0 without reflections.

    `amplitude` is relative to the line of sight on E1. `spacing_chips` is the early-late spacing d.
    """
    if not 0 < spacing_chips < 1:
        raise ValueError(f"a spacing must lie between 0 and 1 chip, found {spacing_chips}")
    if delay_m.shape[0] > _KEPT_EPOCHS:
        return _settled_m(delay_m, amplitude, spacing_chips, pulse)
    return _kept_m(delay_m.tobytes(), amplitude.tobytes(), delay_m.shape, spacing_chips, pulse).copy()


@lru_cache(maxsize=128)
def _kept_m(
    delay_m: bytes, amplitude: bytes, shape: tuple[int, ...], spacing_chips: float, pulse: Pulse
) -> Float[np.ndarray, " n"]:
    """Return the error in m from a cache, because simulations with the same seed have the same reflections.

    The arrays are passed as bytes, which the cache can hash.
    """
    delays_m, amplitudes = np.frombuffer(delay_m).reshape(shape), np.frombuffer(amplitude, complex).reshape(shape)
    return _settled_m(delays_m, amplitudes, spacing_chips, pulse)


def _settled_m(
    delay_m: Float[np.ndarray, "n n_rays"],
    amplitude: Complex128[np.ndarray, "n n_rays"],
    spacing_chips: float,
    pulse: Pulse,
) -> Float[np.ndarray, " n"]:
    """Return the delay in m, relative to the line of sight, at which the loop settles."""
    rays = _Rays(delay_m.T * (E1C.chip_rate_hz / SPEED_OF_LIGHT_MPS), amplitude.T, spacing_chips / 2, pulse)
    error = np.zeros(delay_m.shape[0])
    at_zero = rays.discriminator(error)
    moving = np.flatnonzero(at_zero)
    error[moving] = _settle(rays.part(moving), at_zero[moving])
    return error * (SPEED_OF_LIGHT_MPS / E1C.chip_rate_hz)


@dataclass(frozen=True, slots=True)
class _Rays:
    """Reflections at some epochs, and the loop that receives the reflections; the first axis is the reflection."""

    delay: Float[np.ndarray, "n_rays n"]
    amplitude: Complex128[np.ndarray, "n_rays n"]
    half_spacing: float
    pulse: Pulse

    def part(self, chosen: Int[np.ndarray, " m"] | Bool[np.ndarray, " n"]) -> _Rays:
        """Return the reflections at the chosen epochs, with the same loop."""
        return _Rays(self.delay[:, chosen], self.amplitude[:, chosen], self.half_spacing, self.pulse)

    def discriminator(self, x: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return D(x), the early minus late power."""
        return self._power(x - self.half_spacing) - self._power(x + self.half_spacing)

    def _power(self, x: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return |S(x)|², with R evaluated at |x|, so that D(0) is exactly 0 without reflections."""
        total = autocorrelation(self.pulse, np.abs(x)) + 0j
        for delay, amplitude in zip(self.delay, self.amplitude, strict=True):
            total += amplitude * autocorrelation(self.pulse, np.abs(x - delay))
        return total.real**2 + total.imag**2


def _settle(rays: _Rays, at_zero: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the delay in chips at which the loop settles, for epochs with D(0) ≠ 0."""
    direction = -np.sign(at_zero)
    step = 2 * rays.half_spacing / _STEPS_PER_SPACING
    settled = direction * LOOP_REACH_CHIPS
    walking = np.arange(at_zero.size)
    here = at_zero
    for k in range(int(LOOP_REACH_CHIPS / step)):
        before, x = direction[walking] * k * step, direction[walking] * (k + 1) * step
        there = rays.discriminator(x)
        crossed = there * at_zero[walking] <= 0
        settled[walking[crossed]] = _false_position(
            rays.part(crossed), (before[crossed], here[crossed]), (x[crossed], there[crossed])
        )
        walking, here, rays = walking[~crossed], there[~crossed], rays.part(~crossed)
    return settled


_Point = tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]


def _false_position(rays: _Rays, before: _Point, after: _Point) -> Float[np.ndarray, " n"]:
    """Return the roots of D between two points (x, D) of opposite sign, by the Illinois method.

    The iteration of an epoch stops when D of this epoch is 0 or the estimate changes by at most 1e-10 chip, and after
    40 steps at the latest. So a root does not depend on other epochs.
    """
    (a, value_a), (b, value_b) = before, after
    root, open_ = b.copy(), np.arange(b.size)
    for _ in range(_FALSE_POSITIONS):
        if not open_.size:
            break
        x = b - value_b * (b - a) / (value_b - value_a)
        value = rays.discriminator(x)
        root[open_] = x
        turned = value * value_b < 0
        a, value_a = np.where(turned, b, a), np.where(turned, value_b, value_a / 2)
        go_on = (value != 0) & (np.abs(x - b) > _TOLERANCE_CHIPS)
        b, value_b = x, value
        a, value_a, b, value_b = a[go_on], value_a[go_on], b[go_on], value_b[go_on]
        open_, rays = open_[go_on], rays.part(go_on)
    return root
