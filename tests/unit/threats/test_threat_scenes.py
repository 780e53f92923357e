from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario
from vestige.spoofer.spoofer import ALL_ATTACKS, Spoofer
from vestige.threats.scenes import (
    LEVEL_NUMBERS,
    OUTCOMES,
    Draw,
    Scene,
    Threat,
    read_threats,
    scene_attacks,
    scene_scenario,
)

THREATS = read_threats()
SCENES = [(threat, scene) for threat in THREATS for scene in threat.scene]


def test_the_table_is_complete() -> None:
    assert [threat.id for threat in THREATS] == [f"A{number}" for number in range(22)]
    assert len(THREATS[0].scene) == 5  # clean, harsh, two ionospheres, multipath
    for threat in THREATS:
        names = [scene.name for scene in threat.scene]
        assert len(names) == len(set(names))
        assert threat.source
        for level in LEVEL_NUMBERS:
            assert threat.outcome(level)[0] in OUTCOMES


def test_what_level_1_is_expected_to_do() -> None:
    """From the table of attack models, by hand."""
    expected = [
        "pass",
        "detect",
        "detect",
        "miss",
        "miss",
        "mitigate",
        "miss",
        "miss",
        "detect",
        "deny",
        "detect",
        "miss",
        "miss",
        "miss",
        "miss",
        "miss",
        "detect",
        "miss",
        "miss",
        "miss",
        "miss",
        "miss",
    ]
    assert [threat.outcome(1)[0] for threat in THREATS] == expected


def test_levels_2_and_3() -> None:
    misses = {level: {threat.id for threat in THREATS if threat.outcome(level)[0] == "miss"} for level in (2, 3)}
    assert misses == {2: {"A6", "A7", "A9", "A17", "A19", "A20"}, 3: {"A7", "A17", "A19", "A20"}}


@pytest.mark.slow
@pytest.mark.parametrize(("threat", "scene"), SCENES, ids=lambda one: getattr(one, "id", None) or one.name)
def test_every_row_is_a_scenario_that_runs(threat: Threat, scene: Scene) -> None:
    scenario = scene_scenario(threat, scene, 7).model_copy(update={"epochs": 12})
    results = direct_results(ScenarioPlan(scenario=scenario))
    assert results["status"].shape == (12, len(scenario.simulations))
    assert bool(scenario.attack) is (threat.id != "A0")


def test_an_attack_is_what_its_row_says() -> None:
    """Bands, and whether Assumption 2 holds, of each row."""
    bands = {"A1": "E1", "A2": "E1", "A9": "E1", "A10": "E6"}
    for threat, scene in SCENES:
        scenario = scene_scenario(threat, scene, 3)
        spoofer = Spoofer(attacks=scenario.attack)
        assert bool(spoofer.warnings()) is (threat.id in {"A7", "A15", "A19", "A20", "A21"})
        last_s = min(scenario.epochs * scenario.interval_s, 880.0)
        late_s = np.arange(last_s - 30.0, last_s)  # a whole period of what comes and goes
        svid = next((svids[0] for svids in (getattr(one, "svids", ()) for one in scenario.attack) if svids), 12)
        hit = set()
        for band in Band:
            effects = spoofer.effects(band, svid, late_s)
            if np.any(effects.power_db > -np.inf) or np.any(effects.white > 0) or effects.jammers:
                hit.add(band.value)
        expected = {"A0": set(), "A5": {"E6"} if "E6 alone" in scene.name else {"E1", "E6"}}
        assert hit == expected.get(threat.id, {bands[threat.id]} if threat.id in bands else {"E1", "E6"}), threat.id


def test_every_kind_of_attack_is_in_the_table() -> None:
    kinds = {attack.kind for threat, scene in SCENES for attack in scene_scenario(threat, scene, 0).attack}
    assert kinds == {kind.__dataclass_fields__["kind"].default for kind in ALL_ATTACKS}


def _drawn(seed: int) -> CampaignScenario:
    (threat,) = (one for one in THREATS if one.id == "A3")
    return scene_scenario(threat, threat.scene[0], seed)


def test_a_seed_draws_its_own_parameters_within_the_range() -> None:
    delays_s = np.array([_drawn(seed).attack[0].delay_s for seed in range(40)])  # type: ignore[union-attr]
    assert np.all((delays_s >= 0.3e-6) & (delays_s <= 1e-4))
    assert np.unique(delays_s).size == 40
    assert np.median(delays_s) == pytest.approx(math.sqrt(0.3e-6 * 1e-4), rel=1.0)  # log scale
    assert _drawn(5) == _drawn(5)
    assert _drawn(5).seed == 5


def test_a_scene_with_a_new_name_keeps_its_draws() -> None:
    renamed = [(threat, scene) for threat, scene in SCENES if scene.draws_of]
    assert len(renamed) == 7
    for threat, scene in renamed:
        before = scene.model_copy(update={"name": scene.draws_of, "draws_of": ""})
        other = before.model_copy(update={"name": "another"})
        assert scene_attacks(threat, scene, 4) == scene_attacks(threat, before, 4) != scene_attacks(threat, other, 4)


def test_without_its_attack_the_rest_is_the_same() -> None:
    for threat, scene in SCENES:
        attacked, quiet = scene_scenario(threat, scene, 2), scene_scenario(threat, scene, 2, attacked=False)
        assert quiet == attacked.model_copy(update={"attack": ()})


@given(st.floats(1e-9, 1e3), st.floats(1.001, 1e6), st.booleans(), st.floats(0, 1))
def test_a_draw_lies_between_its_ends(low: float, factor: float, log: bool, share: float) -> None:
    draw = Draw(low=low, high=low * factor, log=log)
    assert draw.low * (1 - 1e-9) <= draw.value(share) <= draw.high * (1 + 1e-9)
    assert draw.value(0.0) == pytest.approx(low)
    assert draw.value(1.0) == pytest.approx(low * factor)


@pytest.mark.parametrize(("low", "high", "log"), [(1.0, 1.0, False), (2.0, 1.0, False), (0.0, 1.0, True)])
def test_impossible_draws(low: float, high: float, log: bool) -> None:
    with pytest.raises(ValidationError):
        Draw(low=low, high=high, log=log)


@pytest.mark.parametrize("change", [{"expected": {"1": "perhaps"}}, {"id": "B1"}, {"scene": ()}, {"more": 1}])
def test_a_row_that_is_none_is_refused(change: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Threat.model_validate(THREATS[1].model_dump() | change)


def test_settings_of_the_users_replace_values_of_every_scene() -> None:
    """Those of an attack are left out where the scene is measured without its attack."""
    settings = ("processor.kappa=2.5", "attack.0.start_s=77")
    for threat, scene in SCENES:
        if not scene.attack:
            continue
        attacked, quiet = (scene_scenario(threat, scene, 2, attacked=one, settings=settings) for one in (True, False))
        assert (attacked.processor.kappa, quiet.processor.kappa) == (2.5, 2.5)
        assert (attacked.attack[0].start_s, quiet.attack) == (77, ())
