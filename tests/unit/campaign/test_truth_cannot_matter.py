"""Nothing that the processor says depends on the truth, neither in memory nor in the columns of a campaign.

The processor is built from the text of the scenario alone. It measures; then all that is simulated behind its
snapshots is replaced by noise; then it assesses. Truth columns of a campaign are replaced between its two halves.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vestige as vs
from one_processor import blocks, short_scene, threat_scenes
from truth_noise import ask_all, make_noise_of_the_truth, noise_like
from vestige.acas_processor.checks.check import series_of
from vestige.acas_processor.checks.e1_e6_range import RangeCheck
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.measurement import MeasurementBlock
from vestige.acas_processor.processor import AcasProcessor
from vestige.campaign.columns import measured_columns
from vestige.campaign.columns.judged_columns import JUDGED_COLUMNS, judged_columns
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.records.checks import CheckSeries
from vestige.records.recs_block import AssistanceData
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.scenario.scenario_processor import navigation_text, overhead_of, receiver_processor
from vestige.scenario.stored import stored_scenario

QUICK = Path(__file__).resolve().parents[3] / "scenarios" / "quick.toml"
THREATS = ("A0 harsh", "A1 while E1 is acquired", "A5 both bands, 1 m/s", "A8 CW", "A12 three of eight")
LINE = ("epochs=30", "receiver.cn0_dbhz=30", "receiver.time_uncertainty_s=30", "processor.search_s=9")
LIFT_OFF = "attack=[{kind='lift-off', start_s=10, delay_m=80, power_db=6, bands=['E1', 'E6']}]"
LINES = {
    "a line of sight": LINE,
    "a line of sight under attack": (*LINE, LIFT_OFF),
    "a line of sight, samples": (*LINE, LIFT_OFF, "epochs=14", "fidelity=samples"),
}
SLOW = {"A1 while E1 is acquired", "A8 CW", "A12 three of eight"}
SCENES = [pytest.param(one, marks=pytest.mark.slow) if one in SLOW else one for one in (*THREATS, *LINES)]
CUT = (9,)  # epochs in a block: what is remembered between blocks is in it


def scene(name: str, level: int) -> CampaignScenario:
    if name in LINES:
        found = load_scenario(QUICK, (*LINES[name], f"processor.level={level}"))
        assert isinstance(found, CampaignScenario)
        return found
    return short_scene(*threat_scenes()[name], 3, level)


def processor_of_text(scenario: CampaignScenario) -> AcasProcessor:
    """Return the processor that a reader of the scenario's text builds."""
    stored = stored_scenario(scenario.model_dump_json())
    return receiver_processor(stored, overhead_of(scenario), navigation_text(scenario))


Measured = tuple[list[MeasurementBlock], AssistanceData]


def measured(scenario: CampaignScenario, processor: AcasProcessor) -> Measured:
    """Return what was measured, with the simulated world behind it."""
    assistance, found = scenario.simulated_receiver.assistance, []
    for block in blocks(scenario, CUT):
        found.append(processor.measure(block, assistance))
        ask_all(block)
    return found, assistance


def said(processor: AcasProcessor, of: Measured) -> list[dict[str, Any]]:
    """Return all that the processor says of measured blocks: columns, positions, and each verdict with its words."""
    state, found = None, []
    for one in of[0]:
        block, state = processor.assess(state, one, of[1])
        columns = {name: values.tobytes() for name, values in judged_columns(block).items()}
        position = b"" if block.position is None else block.position.position_m.tobytes()
        found.append(columns | {"position": position, "verdicts": repr(list(block.verdicts())), "state": repr(state)})
    return found


def in_noise(of: Measured) -> Measured:
    """Return the same with noise for the simulated world."""
    found: Measured = copy.deepcopy(of)
    assert make_noise_of_the_truth(found) > 100
    return found


@pytest.mark.parametrize("level", [1, 2, 3])
@pytest.mark.parametrize("name", SCENES)
def test_noise_behind_the_snapshots_changes_nothing(name: str, level: int) -> None:
    """Statuses, states, statistics, thresholds, reasons, ranges, positions and the state after, to the bit."""
    scenario = scene(name, level)
    processor = processor_of_text(scenario)
    of = measured(scenario, processor)
    assert said(processor, in_noise(of)) == said(processor, of)


@pytest.mark.parametrize("level", [1, 2, 3])
@pytest.mark.parametrize("name", SCENES)
def test_noise_in_the_columns_of_truth_changes_nothing(name: str, level: int) -> None:
    """Between `measure` and `judge` of a plan, as a campaign goes."""
    columns, plan = columns_of(scene(name, level))
    before, after = (plan.judge(None, 0, one)[1] for one in (columns, with_noise(columns)))
    for column in (*JUDGED_COLUMNS, *({"fix_position_m"} & set(before))):
        assert np.asarray(after[column]).tobytes() == np.asarray(before[column]).tobytes(), column


@pytest.mark.parametrize("name", ["A0 harsh", "a line of sight"])
def test_the_text_of_a_scenario_gives_the_processor_of_its_campaign(name: str) -> None:
    scenario = scene(name, 3)
    of = measured(scenario, vs.processor_of(scenario))
    assert said(processor_of_text(scenario), of) == said(vs.processor_of(scenario), of)


def columns_of(scenario: CampaignScenario) -> tuple[dict[str, np.ndarray], ScenarioPlan]:
    plan = ScenarioPlan(scenario=scenario)
    return dict(plan.measure(0, plan.prepare().advance(0, scenario.epochs))), plan


def with_noise(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return columns with noise for those of the truth, also of those that say where satellites really are."""
    rng = np.random.default_rng(5)
    names = {name for name in columns if name.startswith("truth_")} | ({"azimuth_deg", "elevation_deg"} & set(columns))
    assert len(names) > 10
    return columns | {name: noise_like(columns[name], rng) for name in sorted(names)}


def peeking(look: Callable[[Evidence], np.ndarray]) -> Callable[[RangeCheck, Evidence], CheckSeries]:
    """Return the series of a check that looks at something else."""

    def series(self: RangeCheck, evidence: Evidence) -> CheckSeries:
        statistic = look(evidence) + evidence.measured.detected.range_offset_m
        return series_of(self, statistic, np.full(evidence.shape, self.limit_m), lambda _epoch, _satellite: "it peeked")

    return series


PEEKS: dict[str, Callable[[Evidence], np.ndarray]] = {
    "ionosphere": lambda evidence: np.stack(
        [one.iono_diff_m for one in evidence.measured.snapshots.e6.of.truth],  # type: ignore[union-attr]
        axis=1,
    ),
    "E1 error": lambda evidence: evidence.measured.snapshots.searches.of.e1_error_m,  # type: ignore[union-attr]
    "C/N0": lambda evidence: np.broadcast_to(
        [one.cn0_dbhz for one in evidence.measured.snapshots.e6.of.simulations],  # type: ignore[union-attr]
        evidence.shape,
    ),
}


@pytest.mark.parametrize("name", ["A0 harsh", "a line of sight"])
@pytest.mark.parametrize("peek", PEEKS)
def test_a_check_that_looks_behind_its_snapshots_is_found_out(
    peek: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The test above can fail: a check that reads truth of the simulated world does."""
    scenario = scene(name, 1)
    processor = processor_of_text(scenario)
    of = measured(scenario, processor)
    monkeypatch.setattr(RangeCheck, "series", peeking(PEEKS[peek]))
    assert said(processor, in_noise(of)) != said(processor, of)


@pytest.mark.parametrize("name", ["A0 harsh", "a line of sight"])
@pytest.mark.parametrize("column", ["truth_iono_diff_m", "truth_e1_noise_m"])
def test_a_measurement_rebuilt_from_truth_is_found_out(column: str, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """So can that of the columns: what is measured of E6 takes some of the truth."""
    columns, plan = columns_of(scene(name, 1))
    detected = measured_columns._detected

    def with_truth(of: Any, stored: Any) -> Any:
        found = detected(of, stored)
        return replace(found, range_offset_m=found.range_offset_m + stored[column])

    monkeypatch.setattr(measured_columns, "_detected", with_truth)
    before, after = (plan.judge(None, 0, one)[1]["check_statistic"] for one in (columns, with_noise(columns)))
    assert np.asarray(after).tobytes() != np.asarray(before).tobytes()
