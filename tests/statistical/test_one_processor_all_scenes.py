"""Every scene of the threat table, at every level: one by one, in blocks and as a campaign it has the same bits."""

from __future__ import annotations

import pytest

from one_processor import assert_says, blocks, said_of, short_scene, threat_scenes
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan

SCENES = threat_scenes()


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_in_pieces_is_the_scene_as_a_campaign(name: str) -> None:
    number = list(SCENES).index(name)
    level = 1 + number % 3 if name.startswith("A0") else 3 - number % 2
    scenario = short_scene(*SCENES[name], 20 + number, level, before_s=18, after_s=8)
    results = direct_results(ScenarioPlan(scenario=scenario))
    for cut in ((1,), (1, 13, 2, 20)):
        assert_says(results, said_of(scenario, blocks(scenario, cut)))
