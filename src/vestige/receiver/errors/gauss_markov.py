"""Make Gauss-Markov noise of unit variance, which models how ionosphere and tracking errors correlate in time.

The process of first order is

    z_k = ρ z_{k−1} + √(1 − ρ²) w_k,    ρ = e^{−(t_k − t_{k−1})/τ},    w_k ~ N(0, 1),    z_0 = w_0

The process is stationary, and exact for any sequence of steps: E[z(t) z(t + s)] = e^{−s/τ}. The process is not smooth,
because the change over a short step h has the standard deviation √(2h/τ).

The process of second order is critically damped and has the rate v of z as a second state:

    z'' + 2 z'/a + z/a² = white noise,    E[z(t) z(t + s)] = (1 + s/a) e^{−s/a},    E[v²] = 1/a²

The process of second order is also stationary and exact. The change over a short step h is v h, with the standard
deviation h/a.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float

from vestige.receiver.errors.error_process import steps_s

_SMOOTH_TAU = 2.146193  # u with (1 + u) e^{−u} = 1/e


class GaussMarkovProcess:
    """One realisation of the first-order process.

    `rng` gives one normal draw per epoch. With a correlation time of 0 all epochs are independent, even two epochs of
    the same time.
    """

    def __init__(self, rng: np.random.Generator, tau_s: float) -> None:
        if not tau_s >= 0:
            raise ValueError(f"a correlation time must not be negative, found {tau_s}")
        self._rng, self._tau_s = rng, tau_s
        self._last_s: float | None = None
        self._z = 0.0

    def advance(self, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the values of z, which has mean 0 and variance 1, at later times."""
        if times_s.size == 0:
            return np.zeros(0)
        drive = self._rng.standard_normal(times_s.size)
        first = self._last_s is None
        steps = steps_s(self._last_s, times_s)
        self._last_s = float(times_s[-1])
        if self._tau_s == 0:
            return drive
        keep, gain = np.exp(-steps / self._tau_s), np.sqrt(-np.expm1(-2 * steps / self._tau_s))
        if first:
            keep[0], gain[0] = 0.0, 1.0
        z = self._z
        values = []
        # Python floats are fast enough for this recursion, without a compiled loop (6 ms for 100,000 epochs).
        for rho, kick in zip(keep.tolist(), (gain * drive).tolist(), strict=True):
            z = rho * z + kick
            values.append(z)
        self._z = z
        return np.array(values)


class SmoothGaussMarkovProcess:
    """One realisation of the second-order process, for slow errors with a rate, such as the ionosphere's delay.

    `rng` gives two normal draws per epoch. After the correlation time τ the correlation is 1/e, as for the first-order
    process, so a = τ/2.146.
    """

    def __init__(self, rng: np.random.Generator, tau_s: float) -> None:
        if not tau_s > 0:
            raise ValueError(f"the correlation time of a smooth process must be positive, found {tau_s}")
        self._rng, self._a_s = rng, tau_s / _SMOOTH_TAU
        self._last_s: float | None = None
        self._z = self._rate = 0.0  # `_rate` is the rate times a

    def advance(self, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the values of z, which has mean 0 and variance 1, at later times."""
        if times_s.size == 0:
            return np.zeros(0)
        drive = self._rng.standard_normal((times_s.size, 2)).tolist()
        first = self._last_s is None
        steps = steps_s(self._last_s, times_s)
        self._last_s = float(times_s[-1])
        z, rate, values = self._z, self._rate, []
        for number, (step, (of_rate, of_z)) in enumerate(zip((steps / self._a_s).tolist(), drive, strict=True)):
            if first and number == 0:
                z, rate = of_z, of_rate
            else:
                kept = math.exp(-step)
                z, rate = kept * ((1 + step) * z + step * rate), kept * ((1 - step) * rate - step * z)
                squared = math.exp(-2 * step)
                rate_variance = -math.expm1(-2 * step) + squared * (2 * step - 2 * step**2)
                common = 2 * step**2 * squared
                z_variance = -math.expm1(-2 * step) - squared * (2 * step + 2 * step**2)
                if rate_variance > 0:
                    rate += math.sqrt(rate_variance) * of_rate
                    z += common / math.sqrt(rate_variance) * of_rate
                    z += math.sqrt(max(z_variance - common**2 / rate_variance, 0.0)) * of_z
            values.append(z)
        self._z, self._rate = z, rate
        return np.array(values)
