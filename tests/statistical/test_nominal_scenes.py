"""False alarms of every check in the five nominal scenes: an hour of a sky each, against its budget.

Two-sided where the budget is exact, one-sided where it is a bound; a hundred tests at 10⁻⁵: all of them together err
once in a thousand seeds. `benchmarks/false_alarms.py` makes the longer table of docs/checks/README.md.
"""

from __future__ import annotations

import pytest
from tests.sky_builder import sky_scenario
from vestige.acas_processor.monitors.cn0_expectation import Cn0Monitor

from vestige.campaign.direct import direct_results
from vestige.campaign.monitoring import tracks
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import binomial_test

NO_RAYS = ("receiver.multipath=none", "receiver.e1_multipath=false", "position.multipath_sigma_m=0.0")
NO_IONOSPHERE = ("receiver.ionosphere=none", "position.ionosphere_sigma_m=0.0")
STRONG_IONOSPHERE = ('receiver.ionosphere.preset="2014"', "position.ionosphere_sigma_m=2.7")
P_FA = 3e-3


@pytest.mark.parametrize(
    ("settings", "rays"),
    [
        ((*NO_RAYS, *NO_IONOSPHERE, "position.floor_sigma_m=0.001"), False),
        (STRONG_IONOSPHERE, True),
        ((*NO_RAYS, *STRONG_IONOSPHERE), False),
        (NO_RAYS, False),
        (NO_IONOSPHERE, True),
    ],
    ids=["clean", "harsh", "iono 2014", "iono 2017", "multipath"],
)
def test_false_alarms_meet_their_budget(settings: tuple[str, ...], rays: bool) -> None:
    scenario = sky_scenario("epochs=3600", "recs.every=10", "seed=77", *settings)
    slack_db = Cn0Monitor().sigma_model_db if rays else 0.0
    found = tracks(direct_results(ScenarioPlan(scenario=scenario)), p_fa=P_FA, cn0_model_sigma_db=slack_db)
    assert len(found) == 20
    for track in found:
        alarms = track.alarms
        if track.name == "inertial range rate":  # its satellites share an oscillator, all epochs the sensors' bias
            assert alarms.value < 5 * track.p_fa
            continue
        assert alarms.trials > 100, track.name
        share = 2 if track.name.startswith("clock") else 1  # neighbouring epochs share a drift
        chance = binomial_test(alarms.successes // share, alarms.trials // share, track.p_fa)
        assert chance > 1e-5 or (not track.exact and alarms.value < track.p_fa), track.name
