"""Compute the true position and clock error of the receiver at each epoch of a test case, to assess position fixes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from vestige.navigation.earth import geodetic_from_ecef
from vestige.navigation.line_of_sight import ReceiverMotion
from vestige.receiver.samples.continuous import ContinuousTruth
from vestige.scenario.campaign import CampaignScenario


@dataclass(frozen=True, kw_only=True)
class ExportedReceiver:
    """True position, motion and clock error of the receiver at the time tags of its E1 observations."""

    scenario: CampaignScenario  # scenario with a constellation
    path: ContinuousTruth  # truth of any satellite, because the truth of every satellite has the receiver's clock
    first: int  # number of the first epoch
    tag_s: Float[np.ndarray, " n"]  # time tags in s after the scenario's start, on the receiver's clock

    @cached_property
    def motion(self) -> ReceiverMotion:
        """Position, velocity and acceleration of the receiver's antenna at the time tags."""
        return self.scenario.receiver_motion(self.tag_s, self.path.clock_m(self.tag_s))

    @property
    def first_place_m(self) -> tuple[float, float, float]:
        """ECEF position of the receiver at the first epoch in m."""
        x_m, y_m, z_m = self.motion.position_m[0]
        return float(x_m), float(y_m), float(z_m)

    def table(self) -> dict[str, list[str]]:
        """Return the columns of `receiver_truth.csv` as text, by name of the column."""
        tags = [self.scenario.start_time + float(tag_s) for tag_s in self.tag_s]
        latitude_rad, longitude_rad, height_m = geodetic_from_ecef(self.motion.position_m)
        numbers = {
            **dict(zip(("x_m", "y_m", "z_m"), self.motion.position_m.T, strict=True)),
            **dict(zip(("vx_mps", "vy_mps", "vz_mps"), self.motion.velocity_mps.T, strict=True)),
            "latitude_deg": np.degrees(latitude_rad),
            "longitude_deg": np.degrees(longitude_rad),
            "height_m": height_m,
            "clock_m": self.path.clock_m(self.tag_s),
            "clock_drift_mps": self.path.clock_drift_mps(self.tag_s),
        }
        return {
            "epoch": [str(self.first + row) for row in range(len(tags))],
            "gst_week": [str(tag.week) for tag in tags],
            "gst_second": [f"{tag.second + tag.fraction:.3f}" for tag in tags],
            **{name: [repr(float(value)) for value in values] for name, values in numbers.items()},
        }
