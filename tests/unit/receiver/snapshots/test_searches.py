"""The drawn searches have the false-alarm probability for which the processor asks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

import vestige as vs
from sky_builder import sky_scenario
from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import judged_by
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.errors import VestigeError
from vestige.records.checks import CheckName
from vestige.scenario.campaign import CampaignScenario

P_FA = 0.1
ERROR_BUDGET = 1e-9  # probability that a right draw fails the test


def asking(processor: AcasProcessor, p_fa: float) -> AcasProcessor:
    return replace(processor, monitoring=replace(processor.monitoring, search_p_fa=p_fa))


def clear_sky(level: int, epochs: int = 300) -> CampaignScenario:
    settings = (f"epochs={epochs}", "recs.every=1", f"processor.level={level}", "processor.search_s=1.0")
    return sky_scenario(*settings, "constellation.svids=[6, 7, 12, 13, 24]")


def judged(scenario: CampaignScenario, p_fa: float | None) -> VerdictBlock:
    source, processor = vs.simulate(scenario), vs.processor_of(scenario)
    (block,) = source
    asked = processor if p_fa is None else asking(processor, p_fa)
    return asked.step(None, block, source.assistance).block


def test_a_search_fails_as_often_as_its_false_alarm_probability_says() -> None:
    series = judged(clear_sky(2), P_FA).checks[CheckName.E1_VESTIGIAL_SEARCH]
    tests, failed = np.count_nonzero(series.run), np.count_nonzero(series.failed)
    assert tests >= 1000
    low, high = binom.ppf((ERROR_BUDGET / 2, 1 - ERROR_BUDGET / 2), tests, P_FA)
    assert low <= failed <= high
    assert series.p_fa == 2 * P_FA  # the search of E1, and that of E6 at the hand-over


def test_the_exhaustive_search_fails_as_often_too() -> None:
    series = judged(clear_sky(3), P_FA).checks[CheckName.E6_EXHAUSTIVE_SEARCH]
    tests, failed = np.count_nonzero(series.run), np.count_nonzero(series.failed)
    assert tests >= 1000
    low, high = binom.ppf((ERROR_BUDGET / 2, 1 - ERROR_BUDGET / 2), tests, P_FA)
    assert low <= failed <= high


def test_the_default_probability_is_that_of_the_stored_searches() -> None:
    scenario = clear_sky(3, epochs=12)
    block, results = judged(scenario, None), direct_results(ScenarioPlan(scenario=scenario))
    assert np.array_equal(block.status, results["status"].values)


@pytest.mark.parametrize("level", [2, 3])
def test_stored_searches_of_another_probability_are_refused(level: int) -> None:
    results = direct_results(ScenarioPlan(scenario=clear_sky(level, epochs=6)))
    with pytest.raises(VestigeError, match=r"a false-alarm probability of 1e-06 of one search, expected 0\.1"):
        judged_by(results, lambda processor: asking(processor, P_FA))
    assert judged_by(results, lambda processor: asking(processor, 1e-6)).status.size
