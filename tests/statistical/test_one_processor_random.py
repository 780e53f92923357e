"""Random campaigns: snapshots one by one, in blocks of a random cut, and the campaign get the same bits."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from one_processor import SVIDS, assert_says, blocks, said_of, threat_scenes
from sky_builder import sky_scenario
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.campaign import CampaignScenario
from vestige.threats.scenes import scene_scenario

EPOCHS = 18
ATTACKS = {
    name: scene_scenario(threat, scene, 1).attack for name, (threat, scene) in threat_scenes().items() if scene.attack
}


@st.composite
def campaigns(draw: st.DrawFn) -> tuple[list[str], str | None, float]:
    """Return a random receiver and processor as settings of a short sky, the name of an attack, and when it starts."""
    level = draw(st.sampled_from((1, 2, 3)))
    settings_ = [
        f"seed={draw(st.integers(0, 2**32 - 1))}",
        f"epochs={EPOCHS}",
        f"interval_s={draw(st.sampled_from((0.5, 1.0, 2.0)))}",
        f"recs.every={draw(st.integers(1, 6))}",
        f"recs.key_delay={draw(st.sampled_from((0, 1)))}",
        f"constellation.svids={list(SVIDS[: draw(st.integers(1, len(SVIDS)))])}",
        f"receiver.cn0_dbhz={draw(st.floats(26.0, 48.0))}",
        f"receiver.cn0_e1_dbhz={draw(st.floats(26.0, 48.0))}",
        f"receiver.e1_multipath={draw(st.sampled_from(('true', 'false')))}",
        f"receiver.time_uncertainty_s={draw(st.sampled_from((0.0, 1.0, 14.0)))}",
        f"processor.level={level}",
        f'processor.detector="{draw(st.sampled_from(("early", "maximum")))}"',
        f"processor.spacing={draw(st.integers(1, 3))}",
        f"processor.search_s={draw(st.sampled_from((4.0, 3600.0)))}",
    ]
    settings_ += draw(st.sampled_from(((), ("receiver.accelerometers=none",))))
    settings_ += draw(st.sampled_from(((), ("receiver.multipath=none",), ("receiver.ionosphere=none",))))
    attack = draw(st.sampled_from(sorted(ATTACKS))) if draw(st.integers(0, 3)) else None
    return settings_, attack, draw(st.floats(0.0, 12.0))


def campaign_of(settings_: list[str], attack: str | None, start_s: float) -> CampaignScenario:
    """Return the campaign that was drawn: strategies only draw, because what a scenario reads may use `random`."""
    attacks = ATTACKS[attack] if attack else ()
    return sky_scenario(*settings_).replaced(attack=tuple(replace(one, start_s=start_s) for one in attacks))


# A campaign takes a second: one that fails is reported as it is, without a search for the shortest.
@settings(max_examples=20, phases=(Phase.explicit, Phase.generate))
@given(campaigns(), st.lists(st.integers(1, 9), min_size=1, max_size=5))
def test_a_random_campaign_has_the_same_bits_however_it_is_cut(
    drawn: tuple[list[str], str | None, float], cut: list[int]
) -> None:
    """Verdicts with checks and reasons, changes of state, ranges, searches and positions with their covariance."""
    scenario = campaign_of(*drawn)
    results = direct_results(ScenarioPlan(scenario=scenario))
    assert_says(results, said_of(scenario, blocks(scenario, (1,))))
    assert_says(results, said_of(scenario, blocks(scenario, tuple(cut))))
