"""Level 1 in A0 harsh of the threat table keeps the alarms a day that are set, and each check its own budget.

`benchmarks/alarms_per_day.py` measures the same over 1000 hours. Here are thirty hours of eight satellites, with a RECS
each 30 s and other seeds. Each statement errs with a probability below 0.001 if it is true.
"""

from __future__ import annotations

import numpy as np
import pytest

from vestige.acas_processor.levels import is_alarm
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import LevelVerdicts, level_verdicts
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.records.checks import CheckName
from vestige.scenario.campaign import CampaignScenario
from vestige.threats.scene_outcome import poisson_tail
from vestige.threats.scenes import read_threats, scene_scenario

HOURS, ALARMS_A_DAY = 30, 48.0
RARE = 1e-3
JAMMED_S = 600.0
JAMMER = {"kind": "jamming", "start_s": JAMMED_S, "j_over_n_db": 10.0, "bands": ["E6"]}

pytestmark = pytest.mark.slow


def _hour(seed: int, *attacks: dict[str, object]) -> CampaignScenario:
    scene = next(one for one in read_threats()[0].scene if one.name == "harsh")
    often = ("interval_s=30.0", "epochs=120", "recs.every=1")
    return scene_scenario(read_threats()[0], scene, seed, settings=often, attacks=attacks)


def _judged(scenario: CampaignScenario) -> tuple[LevelVerdicts, LevelVerdicts]:
    results = direct_results(ScenarioPlan(scenario=scenario), judge=False)
    without, with_setting = (level_verdicts(results, (1,), alarms_per_day=one)[0] for one in (None, ALARMS_A_DAY))
    return without, with_setting


@pytest.fixture(scope="module")
def hours() -> list[tuple[LevelVerdicts, LevelVerdicts]]:
    """Return thirty hours, judged without and with the setting."""
    return [_judged(_hour(5000 + seed)) for seed in range(HOURS)]


def _counted(found: list[LevelVerdicts], name: CheckName) -> tuple[int, float]:
    failed = sum(int(np.count_nonzero(one.failed[name])) for one in found)
    return failed, sum(np.count_nonzero(one.tests[name]) * one.budget[name].confirmed_p_fa for one in found)


@pytest.mark.judged(by="theory", what="alarms a day of a level", figure="48.0 a day, Poisson test at 0.001")
def test_a_level_keeps_the_alarms_a_day_that_are_set(hours: list[tuple[LevelVerdicts, LevelVerdicts]]) -> None:
    """Two an hour are allowed; without the setting there are four or five."""
    alarms = [sum(int(np.count_nonzero(pair[place].begins)) for pair in hours) for place in (0, 1)]
    allowed = ALARMS_A_DAY * HOURS / 24
    assert poisson_tail(alarms[1], allowed) > RARE
    assert alarms[1] > 0  # a level without any test would keep it too
    assert poisson_tail(alarms[0], allowed) < RARE


@pytest.mark.parametrize("place", [0, 1], ids=["without the setting", "with the setting"])
def test_each_check_keeps_its_own_budget(place: int, hours: list[tuple[LevelVerdicts, LevelVerdicts]]) -> None:
    found = [pair[place] for pair in hours]
    for name in (CheckName.E6_POWER, CheckName.E1_E6_RANGE):
        failed, budget = _counted(found, name)
        assert poisson_tail(failed, budget) > RARE, name
    failed, budget = _counted(found, CheckName.E6_POWER)
    assert place == 1 or failed > 0.5 * budget  # the bound of single misses is near the truth


def test_expecting_too_strong_a_signal_exceeds_the_budget_of_e6_power() -> None:
    """A receiver that expects E6 2 dB above E1, where both are equal, misses more than its C/N0 explains."""
    found = []
    for seed in range(10):
        scenario = _hour(6000 + seed)
        wrong = scenario.processor.model_copy(update={"e6_over_e1_db": 2.0})
        found += level_verdicts(
            direct_results(ScenarioPlan(scenario=scenario.replaced(processor=wrong)), judge=False), (1,)
        )
    failed, budget = _counted(found, CheckName.E6_POWER)
    assert poisson_tail(failed, budget) < RARE


def test_a_jammed_e6_is_an_alarm_within_three_recs() -> None:
    """At once without the setting. With it, the strongest satellites need one miss or two."""
    for seed in range(3):
        for found, limit_s in zip(_judged(_hour(7000 + seed, JAMMER)), (0.0, 60.0), strict=True):
            time_s = 30.0 * np.arange(found.status.shape[0])
            alarm = is_alarm(found.status).any(axis=1) & (time_s >= JAMMED_S)
            assert time_s[np.argmax(alarm)] - JAMMED_S <= limit_s
            assert alarm.any()
