"""Attacks against their checks over several seeds: strong attacks are detected in every run, weak attacks in none."""

from __future__ import annotations

from functools import partial

from campaign_checks import checks_of
from check_detection import check_detection
from sky_builder import CLEAN, sky_scenario
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.records.checks import CheckName
from vestige.scenario.campaign import CampaignScenario


def jammed(j_over_n_db: float, seed: int) -> CampaignScenario:
    attack = f'attack=[{{kind="jamming", bands=["E1"], start_s=20, j_over_n_db={j_over_n_db}}}]'
    return sky_scenario(*CLEAN, f"seed={seed}", "epochs=30", "recs.every=10", attack)


def test_a_strong_attack_is_seen_while_it_acts_and_a_weak_one_is_not() -> None:
    checks = ("E1 received power", "C/N0", "RAIM")
    strong = check_detection(partial(jammed, 10.0), range(3), checks=checks, window_s=(20.0, 30.0))
    assert {name: (one.successes, one.trials) for name, one in strong.items()} == {
        "E1 received power": (3, 3),
        "C/N0": (3, 3),
        "RAIM": (0, 3),
    }
    before = check_detection(partial(jammed, 10.0), range(3), checks=checks, window_s=(0.0, 20.0))
    weak = check_detection(partial(jammed, -40.0), range(3), checks=checks, window_s=(20.0, 30.0))
    for found in (before, weak):
        assert all(one.successes == 0 for one in found.values())


def test_a_front_end_that_drifts_hides_a_jammer_from_the_power() -> None:
    """10 % more power is 0.41 dB: far above the 0.03 dB of the measurement, and below 4.4 times a drift of 0.3 dB."""
    jammer = partial(jammed, -10.0)
    found = check_detection(jammer, range(2), checks=("E1 received power",), window_s=(20.0, 30.0))
    assert found["E1 received power"].successes == 0
    for seed in range(2):
        results = direct_results(ScenarioPlan(scenario=jammer(seed)))
        for drift_db, seen in ((0.0, True), (0.3, False)):
            check = checks_of(results, drift_db=drift_db)[CheckName.E1_RECEIVED_POWER]
            assert bool(check.failed[20:].any()) is seen
