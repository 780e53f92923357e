"""There is one processor: snapshots one by one, blocks of any size and campaigns get the same bits from it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import vestige as vs
from one_processor import assert_says, blocks, said_of, short_scene, threat_scenes
from sky_builder import sky_scenario
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import level_verdicts
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

QUICK = Path(__file__).resolve().parents[3] / "scenarios" / "quick.toml"
SCENES = threat_scenes()


def scene(name: str, level: int, seed: int = 3) -> CampaignScenario:
    threat, found = SCENES[name]
    return short_scene(threat, found, seed, level)


def single_line(*settings: str) -> CampaignScenario:
    found = load_scenario(QUICK, settings)
    assert isinstance(found, CampaignScenario)
    return found


PUSH = 'attack=[{kind="position-push", svids=[7, 13], start_s=20, power_db=6, delay_m=90}]'
CAMPAIGNS = {
    "a repeater, level 1": lambda: scene("A3 repeater", 1),
    "a repeater, level 2": lambda: scene("A3 repeater", 2),
    "a nulled signal, level 3": lambda: scene("A7 gain −0.5 dB, 5°", 3),
    "OSNMA denied, level 3": lambda: scene("A9 noise on E1", 3),
    "a line of sight, level 1": lambda: single_line("epochs=60", "receiver.cn0_dbhz=29", "seed=5"),
    "alarms a day set, level 1": lambda: single_line(
        "epochs=80", "seed=5", "receiver.cn0_dbhz=34", "receiver.cn0_e1_dbhz=34",
        "processor.alarms_per_day=20", "processor.expected_satellites=1",
        'attack=[{kind="jamming", start_s=20, stop_s=60, j_over_n_db=2.5, bands=["E6"]}]',
    ),
    "alarms a day set, level 3": lambda: sky_scenario(
        "epochs=24", "recs.every=2", "constellation.svids=[6, 7, 12, 13]", "processor.level=3",
        "processor.alarms_per_day=50", 'attack=[{kind="jamming", start_s=6, j_over_n_db=9, bands=["E6"]}]',
    ),
    "a line of sight, level 3": lambda: single_line(
        "epochs=40", "processor.level=3", "processor.search_s=9", "receiver.time_uncertainty_s=14", "seed=6"
    ),
    "a RECS each 7 s, own key": lambda: sky_scenario(
        "epochs=25", "recs.every=7", "recs.key_delay=0", "constellation.svids=[6, 7, 12, 13, 24]",
        "processor.level=3", "processor.search_s=21", PUSH,
    ),
    "half seconds, no sensors": lambda: sky_scenario(
        "epochs=24", "interval_s=0.5", "recs.every=4", "receiver.accelerometers=none", "processor.level=2",
        "constellation.svids=[6, 7, 12, 13, 24]", 'processor.detector="maximum"', "processor.spacing=2",
    ),
    "samples": lambda: sky_scenario(
        "epochs=8", "recs.every=4", 'fidelity="samples"', "constellation.svids=[6, 7, 12, 13]", "processor.level=3"
    ),
}  # fmt: skip
QUICK_ONES = {
    "alarms a day set, level 1",
    "a repeater, level 2",
    "a line of sight, level 1",
    "half seconds, no sensors",
}
ONE_BY_ONE = {"alarms a day set, level 1", "a line of sight, level 1", "a line of sight, level 3", "samples"}


@pytest.mark.parametrize(
    "name", [name if name in QUICK_ONES else pytest.param(name, marks=pytest.mark.slow) for name in CAMPAIGNS]
)
def test_one_by_one_as_blocks_and_as_a_campaign_are_the_same(name: str, tmp_path: Path) -> None:
    """Verdicts with checks and reasons, changes of state, ranges, searches, positions with covariance, to the bit."""
    scenario = CAMPAIGNS[name]()
    plan = ScenarioPlan(scenario=scenario)
    results = direct_results(plan)
    assert np.ptp(results["status"].values) > 0 or scenario.constellation is None
    each = (1,) if name in ONE_BY_ONE else (1, 6, 1, 1, 8)  # simulating a block takes as long for one epoch as for ten
    assert_says(results, said_of(scenario, blocks(scenario, each)))
    for block_epochs in (7, scenario.epochs):
        assert_says(results, said_of(scenario, vs.simulate(scenario, block_epochs=block_epochs)))
    stored = run(plan, tmp_path / "a", chunk_epochs=13)
    for column in results.data_vars:
        assert stored[column].values.tobytes() == results[column].values.tobytes(), column


def test_stored_results_are_judged_as_the_campaign_was() -> None:
    for level in (1, 2, 3):
        results = direct_results(ScenarioPlan(scenario=scene("A3 repeater", level)))
        (found,) = level_verdicts(results, (level,))
        for name, values in (("status", found.status), ("state", found.state), ("cause", found.cause)):
            assert results[name].values.tobytes() == values.tobytes(), name
        assert results["range_in_use_m"].values.tobytes() == found.range_in_use_m.tobytes()
        assert found.position is not None
        position_m = results["fix_position_m"].sel(fix="authenticated").values
        assert position_m.tobytes() == found.position.position_m.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("damaged", [(3,), (0, 4)])
def test_a_resumed_run_has_the_same_bits(damaged: tuple[int, ...], tmp_path: Path) -> None:
    """Chunks in the middle are measured again, and judged with the state that the stored ones before them leave."""
    plan = ScenarioPlan(scenario=scene("A3 repeater", 3))
    whole = direct_results(plan)
    run(plan, tmp_path / "a", chunk_epochs=6)
    for chunk in damaged:
        torn = sorted((tmp_path / "a" / "e1_pseudorange_m").rglob(f"c/{chunk}/*"))
        assert torn
        torn[0].write_bytes(b"torn")
    again = run(plan, tmp_path / "a", chunk_epochs=6)
    for column in whole.data_vars:
        assert again[column].values.tobytes() == whole[column].values.tobytes(), column
