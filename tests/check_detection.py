"""Share of runs in which each check of a sky detects an attack."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from vestige.acas_processor.levels import LEVELS
from vestige.acas_processor.processor import AcasProcessor
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import judged_by
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import Proportion, proportion
from vestige.scenario.campaign import CampaignScenario

P_FA = 1e-5  # false-alarm probability of one test


def check_detection(
    scenario: Callable[[int], CampaignScenario],
    seeds: Sequence[int],
    *,
    checks: Collection[str],
    window_s: tuple[float, float],
    p_fa: float = P_FA,
) -> dict[str, Proportion]:
    """Return for each check the share of runs in which it fails for any satellite within a time window.

    `scenario` returns the campaign of a seed; the campaign must have a sky. `window_s` is in s after the start, without
    its end. `p_fa` is the false-alarm probability of one test of every check except the user's checks.

    Raises `VestigeError` if the campaign has no sky.
    """
    seen = dict.fromkeys(checks, 0)
    for seed in seeds:
        results = direct_results(ScenarioPlan(scenario=scenario(seed), with_phases=False), judge=False)
        time_s = results["time_s"].values
        counts = (time_s >= window_s[0]) & (time_s < window_s[1])
        for name, check in judged_by(results, with_p_fa(p_fa)).checks.items():
            if name in seen:
                seen[name] += bool(np.any(check.failed[counts]))
    return {name: proportion(count, len(seeds)) for name, count in seen.items()}


def with_p_fa(p_fa: float) -> Callable[[AcasProcessor], AcasProcessor]:
    """Return a function that sets a processor to the highest level, with `p_fa` as the probability of each test."""
    return lambda processor: replace(
        processor, level=max(LEVELS), monitoring=replace(processor.monitoring, test_p_fa=p_fa)
    )
