"""A check that a user wrote sees the same evidence in a campaign as in the processor: every field, to the bit."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import vestige as vs
from extend_page import no_parts, page_scenario
from one_processor import assert_columns, assert_says, said_of, short_scene, threat_scenes
from own_check_probe import all_fields, documented_fields, write_probes
from vestige.campaign.columns.own_check_columns import OWN_CHECK_COLUMNS
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.levels import level_verdicts
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.errors import VestigeError
from vestige.own_parts import OwnPartError, own_parts_from
from vestige.records import Outcome
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

QUICK = Path(__file__).resolve().parents[3] / "scenarios" / "quick.toml"
LATE_S = 8.0
PUSH = 'attack=[{kind="time-push", start_s=30, power_db=6, delay_m=75}]'  # the true signal is 75 m before E1's


@pytest.fixture(autouse=True)
def _parts() -> Iterator[None]:
    with no_parts():
        yield


def line(*settings: str, checks: tuple[str, ...]) -> CampaignScenario:
    found = load_scenario(QUICK, (f"processor.checks={json.dumps(checks)}", *settings))
    assert isinstance(found, CampaignScenario)
    return found


def sky(name: str, level: int, *, checks: tuple[str, ...], **settings: object) -> CampaignScenario:
    found = short_scene(*threat_scenes()[name], 3, level, before_s=8, after_s=10)
    table = found.processor.model_validate({**found.processor.model_dump(), "checks": checks})
    return found.replaced(processor=table, **settings)


Scene = Callable[[tuple[str, ...]], CampaignScenario]
SCENES: dict[str, Scene] = {
    "a line of sight, level 1": lambda checks: line(
        "epochs=30", "receiver.cn0_dbhz=31", "receiver.time_uncertainty_s=30", checks=checks
    ),
    "a line of sight, samples": lambda checks: line('fidelity="samples"', "epochs=12", checks=checks),
    "a line of sight, level 3": lambda checks: line(
        "epochs=20", "processor.level=3", "processor.search_s=9", checks=checks
    ),
    "a sky, level 1": lambda checks: sky("A3 repeater", 1, checks=checks),
    "a sky, level 3": lambda checks: sky("A9 noise on E1", 3, checks=checks),
    "a sky of samples, level 2": lambda checks: sky("A3 repeater", 2, checks=checks, fidelity="samples", epochs=11),
}
SLOW = {"a sky of samples, level 2", "a sky, level 1"}  # level 1 is quick with a line of sight, a sky at level 3


def test_the_page_names_every_field() -> None:
    assert documented_fields() == all_fields()


@pytest.mark.parametrize("name", [pytest.param(one, marks=pytest.mark.slow) if one in SLOW else one for one in SCENES])
def test_every_field_is_the_same_in_a_campaign(name: str, tmp_path: Path) -> None:
    """A check for each field: statistic, threshold and verdicts of `processor.run`, of a campaign, and judged again."""
    own_parts_from(tmp_path)
    scenario = SCENES[name](write_probes(tmp_path, late_s=LATE_S))
    results = run(ScenarioPlan(scenario=scenario), tmp_path / "a", chunk_epochs=7)
    assert_columns(results, said_of(scenario, vs.simulate(scenario, block_epochs=7)))  # a probe sees the cut
    place = {svid: column for column, svid in enumerate(results["svid"].values.tolist())}
    checks = results["check"].values.tolist()
    fields, failed = all_fields(), 0
    for verdict in vs.processor_of(scenario).run(vs.simulate(scenario, block_epochs=7)):
        here = {"epoch": verdict.index, "satellite": place[verdict.svid]}
        assert list(vs.Status)[results["status"].isel(here).item()] is verdict.status
        stored = {one: results[f"check_{one}"].isel(here).values for one in ("statistic", "threshold", "result")}
        for one in (check for check in verdict.checks if check.name in fields):
            row = checks.index(str(one.name))
            assert np.float32(one.statistic).tobytes() == stored["statistic"][row].tobytes() or np.isnan(one.statistic)
            assert np.float32(one.threshold).tobytes() == stored["threshold"][row].tobytes() or np.isnan(one.threshold)
            assert {Outcome.NOT_RUN: -1, Outcome.PASS: 0, Outcome.FAIL: 1}[one.outcome] == stored["result"][row]
            failed += one.outcome is Outcome.FAIL
    assert failed
    # judged again, in one block as the processor is here: also in double precision
    (again,) = level_verdicts(results, (scenario.processor.level,))
    (step,) = vs.processor_of(scenario).steps(
        vs.simulate(scenario, block_epochs=scenario.epochs), assistance=scenario.simulated_receiver.assistance
    )
    for field in fields:
        for values in ("statistic", "threshold"):
            live, stored_too = (getattr(one.checks[field], values) for one in (step.block, again))  # type: ignore[index]
            assert np.array_equal(live, stored_too, equal_nan=True), field


def test_a_check_with_memory_is_the_same_however_a_campaign_is_cut(tmp_path: Path) -> None:
    """Its test is over 10 RECS, more than a chunk has: one by one, in chunks, at once, and judged again."""
    scenario = page_scenario("my_memory_check", "epochs=60", PUSH)
    whole = direct_results(ScenarioPlan(scenario=scenario))
    check = whole["check"].values.tolist().index("early power of 10 RECS")
    assert {0, 1} <= set(whole["check_result"].values[check].ravel().tolist())
    for block_epochs in (1, 13):
        assert_says(whole, said_of(scenario, vs.simulate(scenario, block_epochs=block_epochs)))
    stored = run(ScenarioPlan(scenario=scenario), tmp_path / "a", chunk_epochs=7)
    for column in whole.data_vars:
        assert stored[column].values.tobytes() == whole[column].values.tobytes(), column
    (again,) = level_verdicts(stored, (scenario.processor.level,))
    assert again.status.tobytes() == whole["status"].values.tobytes()


def test_no_other_campaign_has_the_columns(tmp_path: Path) -> None:
    of_level_1 = set(direct_results(ScenarioPlan(scenario=line("epochs=3", checks=()))).data_vars)
    assert not of_level_1 & set(OWN_CHECK_COLUMNS)
    own_parts_from(tmp_path)
    checks = write_probes(tmp_path, late_s=LATE_S)[:1]
    results = direct_results(ScenarioPlan(scenario=line("epochs=3", checks=checks)))
    assert set(results.data_vars) - of_level_1 == set(OWN_CHECK_COLUMNS)
    for name in set(OWN_CHECK_COLUMNS) - {"e6_power_db"}:
        assert results[name].dtype == np.float64
    with pytest.raises(VestigeError, match="found no e6_expected_s, expected them because the scenario has your own"):
        level_verdicts(results.drop_vars("e6_expected_s"), (1,))


TOUCH = """
class Touch:
    name, unit, p_fa = "touch", "1", 0.5

    def series(self, evidence):
        evidence.measured.snapshots.{use}
"""


@pytest.mark.parametrize(
    "use",
    [
        "e6.correlate(None, None, None)",
        "e6.of.truth",
        "searches.e1(None)",
        "searches.exhaustive(None)",
        "searches.finds",
    ],
)  # fmt: skip
@pytest.mark.parametrize("level", [1, 3])
def test_what_is_not_stored_is_refused_everywhere(use: str, level: int, tmp_path: Path) -> None:
    """In one line, the same of a simulation and of a campaign, whatever the fidelity."""
    own_parts_from(tmp_path)
    (tmp_path / "touch.py").write_text(TOUCH.format(use=use))
    said = set()
    for fidelity in ("samples", "correlators"):
        settings = (f"fidelity={json.dumps(fidelity)}", "epochs=2", f"processor.level={level}")
        scenario = line(*settings, checks=("touch:Touch",))
        for judge in (
            lambda scenario: list(vs.processor_of(scenario).run(vs.simulate(scenario))),
            lambda scenario: direct_results(ScenarioPlan(scenario=scenario)),
        ):
            with pytest.raises(OwnPartError) as error:
                judge(scenario)
            said.add(str(error.value))
    used = use.partition("(")[0].removesuffix(".truth")
    assert said == {
        f"touch:Touch: found evidence.measured.snapshots.{used}, expected the other fields of the evidence: "
        "stored results have no samples, so no check may use them"
    }
