"""How far the position that a level authenticates is from the true one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from vestige.campaign.levels import LevelVerdicts
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.scenario.campaign import CampaignScenario

if TYPE_CHECKING:
    import xarray


def position_error_m(
    scenario: CampaignScenario, results: xarray.Dataset, found: LevelVerdicts
) -> Float[np.ndarray, " n"]:
    """Return how far the position of a level is from the true one, in m; NaN where there is none."""
    position = found.block.position
    if position is None:
        return np.full(results.sizes["epoch"], np.nan)
    trajectory = next(one.elevation.path.trajectory for one in scenario.simulations if one.elevation is not None)
    time_s, clock_m = results["time_s"].values, results["truth_clock_m"].values
    place_m = trajectory.motion(time_s - clock_m / SPEED_OF_LIGHT_MPS).position_m
    return np.linalg.norm(position.position_m - place_m, axis=1)
