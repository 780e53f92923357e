"""The position that a level has of a campaign of a sky: the fix of all satellites of which a range is in use.

Where that range is the earliest of several signals, it stands in the place of E1's: what E1 would say of the true
signal, with the error that the search made.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from vestige.campaign.levels import LevelVerdicts
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.position_fix import position_fix, transmission
from vestige.scenario.campaign import CampaignScenario

if TYPE_CHECKING:
    import xarray


def position_error_m(
    scenario: CampaignScenario, results: xarray.Dataset, found: LevelVerdicts
) -> Float[np.ndarray, " n"]:
    """Return how far the position of a level is from the true one, in m; NaN where there is none.

    Parameters
    ----------
    scenario
        Of a sky.
    results
        Of that scenario.
    found
        What the level makes of them.
    """
    used = np.isfinite(found.range_error_m)
    rows = np.flatnonzero(np.count_nonzero(used, axis=1) >= 4)
    error_m = np.full(used.shape[0], np.nan)
    if not rows.size:
        return error_m

    def seen(name: str) -> np.ndarray:
        return results[name].transpose("epoch", ...).values[rows].astype(np.float64)

    time_s, clock_m = seen("time_s"), seen("truth_clock_m")
    true_m = seen("truth_range_m") + clock_m[:, None]
    range_m = np.where(found.earlier[rows], true_m + found.range_error_m[rows], seen("e1_pseudorange_m"))
    paths = [one.elevation.path for one in scenario.simulations if one.elevation is not None]
    typical_m = np.where(used[rows], range_m, 0.0)
    sent = transmission([path.ephemeris for path in paths], scenario.start_time, time_s, typical_m)
    fix = position_fix(sent, np.where(used[rows], range_m, np.nan), seen("e1_sigma_m"))
    place_m = paths[0].trajectory.motion(time_s - clock_m / SPEED_OF_LIGHT_MPS).position_m
    error_m[rows] = np.linalg.norm(fix.position_m - place_m, axis=1)
    return error_m
