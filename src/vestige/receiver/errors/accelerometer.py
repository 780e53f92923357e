"""Simulate accelerometers of a receiver, which measure the gain of velocity between two epochs.

    Δv̂ = Δv + b Δt + N √Δt z,    z ~ N(0, 1) for each axis and interval

The axes point east, north and up, and gravity is removed. b is the bias of an axis that remains after the alignment. b
is drawn once for each axis. A tilt by the angle b/g has the same effect as the bias b of a horizontal axis, because
gravity then has a component along this axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from vestige.navigation.earth import local_axes_at
from vestige.receiver.draws import DRAW_BLOCK, drawn_rows
from vestige.receiver.sky.trajectory import Trajectory
from vestige.streams import stream


@dataclass(frozen=True, slots=True, kw_only=True)
class Accelerometers:
    """Three accelerometers with a constant bias and white noise; the default is a consumer-grade sensor.

    Attributes
    ----------
    sigma_bias_mps2
        Standard deviation of the bias of an axis in m/s²; the default is about a thousandth of gravity.
    walk_mps_per_sqrt_s
        N, the velocity random walk in m/s per √s.
    """

    sigma_bias_mps2: float = 0.01
    walk_mps_per_sqrt_s: float = 0.002
    kind: Literal["bias-and-walk"] = "bias-and-walk"

    def __post_init__(self) -> None:
        for name in ("sigma_bias_mps2", "walk_mps_per_sqrt_s"):
            if not 0 <= getattr(self, name) <= 10:
                raise ValueError(f"{name} from 0 to 10")

    def delta_velocity_mps(
        self, trajectory: Trajectory, time_s: Float[np.ndarray, " n"], interval_s: float, *, seed: int, first: int
    ) -> Float[np.ndarray, "n 3"]:
        """Return the measured gain of velocity (east, north, up) since the previous epoch in m/s.

        The values of the scenario's first epoch are NaN.
        """
        begun = time_s - interval_s
        started = first + np.arange(time_s.size) > 0
        now, before = trajectory.motion(time_s), trajectory.motion(np.where(started, begun, time_s))
        axes = local_axes_at(now.position_m)
        gained = np.einsum("nij,nj->ni", axes, now.velocity_mps - before.velocity_mps)
        bias = self.sigma_bias_mps2 * stream(seed, "accelerometer bias").standard_normal(3)
        noise = drawn_rows(
            first,
            time_s.size,
            lambda block: stream(seed, "accelerometer noise", block).standard_normal((DRAW_BLOCK, 3)),
        )
        found = gained + bias * interval_s + self.walk_mps_per_sqrt_s * np.sqrt(interval_s) * noise
        return np.where(started[:, None], found, np.nan)
