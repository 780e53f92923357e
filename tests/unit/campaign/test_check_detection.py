from __future__ import annotations

from functools import partial

from check_detection import check_detection
from sky_builder import CLEAN, sky_scenario
from vestige.scenario.campaign import CampaignScenario


def jammed(j_over_n_db: float, seed: int) -> CampaignScenario:
    attack = f'attack=[{{kind="jamming", bands=["E1"], start_s=20, j_over_n_db={j_over_n_db}}}]'
    return sky_scenario(*CLEAN, f"seed={seed}", "epochs=30", "recs.every=10", attack)


def test_an_attack_is_seen_by_a_check_that_fails_once() -> None:
    """The jammer takes ten of 30 s, which the window holds, holds among others, or does not hold."""
    for window_s, seen in (((20.0, 30.0), 1), ((0.0, 30.0), 1), ((0.0, 20.0), 0)):
        found = check_detection(
            partial(jammed, 10.0), range(1), checks=("E1 received power", "C/N0"), window_s=window_s
        )
        assert [(one.successes, one.trials) for one in found.values()] == [(seen, 1)] * 2
