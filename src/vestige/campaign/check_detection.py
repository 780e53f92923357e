"""How often each check of a sky sees an attack, run by run."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np

from vestige.campaign.direct import direct_results
from vestige.campaign.monitoring import P_FA, tracks
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import Proportion, proportion
from vestige.scenario.campaign import CampaignScenario


def check_detection(
    scenario: Callable[[int], CampaignScenario],
    seeds: Sequence[int],
    *,
    checks: Collection[str],
    window_s: tuple[float, float],
    p_fa: float = P_FA,
    sigma_system_db: float = 0.0,
) -> dict[str, Proportion]:
    """Return for each check in how many runs it fails, for any satellite, at any time of a window.

    Parameters
    ----------
    scenario
        Gives the campaign of a seed; one of a sky.
    seeds
        Of the runs.
    checks
        Names of tracks.
    window_s
        Times that count, the end not included.
    p_fa
        Budget of one test of each check whose budget is free.
    sigma_system_db
        Drift of a real front end that the thresholds of power and floor allow for, 1σ.

    Raises
    ------
    VestigeError
        If the campaign has no sky.
    """
    seen = dict.fromkeys(checks, 0)
    for seed in seeds:
        results = direct_results(ScenarioPlan(scenario=scenario(seed)))
        time_s = results["time_s"].values
        counts = (time_s >= window_s[0]) & (time_s < window_s[1])
        for track in tracks(results, p_fa=p_fa, sigma_system_db=sigma_system_db):
            if track.name in seen:
                seen[track.name] += bool(np.any(track.failed[counts]))
    return {name: proportion(count, len(seeds)) for name, count in seen.items()}
