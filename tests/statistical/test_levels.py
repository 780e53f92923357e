"""A level over an hour of a clean sky: its checks fail as often as the budget of false alarms allows."""

from __future__ import annotations

import numpy as np
import pytest

from sky_builder import CLEAN, sky_scenario
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import level_verdicts
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import binomial_test


@pytest.mark.judged(by="theory", what="false alarms of each check over an hour", figure="binomial test at 1e-4")
def test_a_level_keeps_its_budget_of_false_alarms() -> None:
    """Two-sided where a check is exact: the hour of a clean world, 6000 false alarms a day over fourteen checks."""
    scenario = sky_scenario(*CLEAN, "epochs=3600")
    (found,) = level_verdicts(direct_results(ScenarioPlan(scenario=scenario)), (2,), alarms_per_day=6000.0)
    share_a_day = (6000 - 86_400 / 30 * 8 * found.processor.bank_p_fa) / 14  # after noise in the correlators
    for name in ("clock innovation", "clock consistency", "clock slope", "RAIM"):
        share, tests = found.budget[name], int(np.count_nonzero(found.tests[name]))
        assert tests > 3500
        assert share.p_fa == pytest.approx(share_a_day / 86_400)
        failed = int(np.count_nonzero(found.failed[name]))
        # neighbouring epochs share a drift: half as many independent trials
        assert binomial_test(failed // 2, tests // 2, share.p_fa) > 1e-4, name
    for name, failed in found.failed.items():
        share = found.budget[name]
        bound = share.p_fa * np.count_nonzero(found.tests[name])
        assert np.count_nonzero(failed) <= bound + 5 * np.sqrt(bound) + 1, name
    separation = "solution separation"  # a bound that is nearly reached
    assert np.count_nonzero(found.failed[separation]) > 0.2 * found.budget[separation].p_fa * 3600
