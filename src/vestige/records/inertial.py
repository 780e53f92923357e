"""Integrate the antenna's accelerations from inertial sensors between two epochs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from vestige.records.snapshot_block import VelocityIncrements
from vestige.records.times import GalileoTimes
from vestige.time import GalileoTime
from vestige.valid_numbers import require_finite

LONGEST_STEP_S = 1.5  # longest step in s between two samples over which linear interpolation is allowed


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Accelerations:
    """Kinematic acceleration of the antenna relative to the Earth, as samples from inertial sensors."""

    # the samples are at the ascending times `start` + `elapsed_s` (in s) on the receiver's clock
    start: GalileoTime
    elapsed_s: Float[np.ndarray, " n"]
    # acceleration to the east, north and up at the receiver's position, without gravity
    acceleration_mps2: Float[np.ndarray, "n 3"]

    def __post_init__(self) -> None:
        for name, values in (("elapsed_s", self.elapsed_s), ("acceleration_mps2", self.acceleration_mps2)):
            require_finite("accelerations", **{name: float(np.abs(values).sum())})

    def increments(self, first: GalileoTime | None, last: GalileoTime) -> VelocityIncrements:
        """Return the velocity increments between two epochs, one for each step between samples.

        An increment is the integral of the acceleration, which is interpolated linearly between samples. The result has
        no increments if `first` is None, if `last` is not later than `first`, or if samples are missing.
        """
        found = None if first is None or not last - first > 0 else self._between(first, last)
        if found is None:
            return VelocityIncrements(
                epoch=np.zeros(0, np.int64),
                time=GalileoTimes.of(()),
                delta_velocity_mps=np.zeros((0, 3)),
                covered=np.zeros(1, np.bool_),
            )
        knots_s, delta_mps = found
        return VelocityIncrements(
            epoch=np.zeros(len(delta_mps), np.int64),
            time=GalileoTimes.after(self.start, knots_s),
            delta_velocity_mps=delta_mps,
            covered=np.ones(1, np.bool_),
        )

    def _between(
        self, first: GalileoTime, last: GalileoTime
    ) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, "k 3"]] | None:
        """Return the end of each increment in s after `start`, and the increments; None if samples are missing."""
        begin, end = first - self.start, last - self.start
        low = int(np.searchsorted(self.elapsed_s, begin, side="right")) - 1
        high = int(np.searchsorted(self.elapsed_s, end)) + 1
        time_s = self.elapsed_s[max(low, 0) : high]
        if low < 0 or high > self.elapsed_s.size or np.max(np.diff(time_s)) > LONGEST_STEP_S:
            return None
        knots = np.clip(time_s, begin, end)
        values = np.stack([np.interp(knots, time_s, axis) for axis in self.acceleration_mps2[low:high].T], axis=1)
        return knots[1:], (values[1:] + values[:-1]) / 2 * np.diff(knots)[:, None]
