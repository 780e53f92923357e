"""First-order Gauss-Markov noise of unit variance: the memory of the ionosphere and of tracking loops.

    z_k = ρ z_{k−1} + √(1 − ρ²) w_k,    ρ = e^{−(t_k − t_{k−1})/τ},    w_k ~ N(0, 1),    z_0 = w_0

It is stationary, and exact for any sequence of steps: E[z(t) z(t + s)] = e^{−s/τ}.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from vestige.receiver.errors.error_process import steps_s


class GaussMarkovProcess:
    """One realisation.

    `rng` gives one normal an epoch. A correlation time of 0 makes every epoch independent, even of one at the same
    time.
    """

    def __init__(self, rng: np.random.Generator, tau_s: float) -> None:
        if not tau_s >= 0:
            raise ValueError(f"a correlation time is not negative, found {tau_s}")
        self._rng, self._tau_s = rng, tau_s
        self._last_s: float | None = None
        self._z = 0.0

    def advance(self, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return z of mean 0 and variance 1 at later times."""
        if times_s.size == 0:
            return np.zeros(0)
        drive = self._rng.standard_normal(times_s.size)
        first = self._last_s is None
        steps = steps_s(float(times_s[0]) if self._last_s is None else self._last_s, times_s)
        self._last_s = float(times_s[-1])
        if self._tau_s == 0:
            return drive
        keep, gain = np.exp(-steps / self._tau_s), np.sqrt(-np.expm1(-2 * steps / self._tau_s))
        if first:
            keep[0], gain[0] = 0.0, 1.0
        z = self._z
        values = []
        # Python's floats: a recursion over numbers that are already there needs no compiled loop (6 ms for 100,000)
        for rho, kick in zip(keep.tolist(), (gain * drive).tolist(), strict=True):
            z = rho * z + kick
            values.append(z)
        self._z = z
        return np.array(values)
