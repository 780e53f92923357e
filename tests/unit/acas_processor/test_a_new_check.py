"""A new check is one file and one row of the table: nothing else of the processor names a check."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from block_builder import Keys, MadeUpSky, cut, settings
from vestige.acas_processor.checks.check import Monitor, series_of
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.levels import LEVELS, CheckSpec, Scope, TestCadence
from vestige.acas_processor.monitoring.alarm_budget import Cadence, false_alarm_budget
from vestige.acas_processor.monitoring.baseline import Quantity
from vestige.acas_processor.monitoring.memory import RECEIVER, CheckMemory
from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.records import Status
from vestige.records.checks import CheckName, CheckSeries

PROCESSOR = Path(__file__).resolve().parents[3] / "src" / "vestige" / "acas_processor"
N, NAME = 24, "C/N0 of even epochs"


@dataclass(frozen=True, slots=True, kw_only=True)
class EvenCn0Monitor(Monitor):
    """The file of the new check: it compares with reference levels, and fails in even epochs on purpose."""

    name: ClassVar = NAME
    unit: ClassVar = "dB"
    p_fa: float = 1e-6

    def series(self, evidence: Evidence) -> CheckSeries:
        reference = evidence.references[Quantity.E1_CN0_DBHZ].value
        statistic = np.where(np.isnan(reference), np.nan, 2.0 * (np.arange(len(reference)) % 2 == 0)[:, None])
        return series_of(self, statistic, np.ones(statistic.shape), lambda *_: "an even epoch")


ROW = CheckSpec(
    step=3,
    name=NAME,
    failure=Status.SPOOFED,
    make=lambda _, p_fa: EvenCn0Monitor(p_fa=p_fa),
    cadence=TestCadence.RECS,
    exact=True,
    needs_references=True,
)


def judged(processor: AcasProcessor) -> VerdictBlock:
    return processor.step(None, MadeUpSky(seed=5, n=N, trouble=0.3).whole, Keys()).block  # type: ignore[arg-type]


@pytest.fixture
def with_row(monkeypatch: pytest.MonkeyPatch) -> AcasProcessor:
    monkeypatch.setitem(LEVELS, 2, (*LEVELS[2], ROW))
    return AcasProcessor(level=2, monitoring=settings())


def test_a_check_runs_that_is_a_row_of_the_table(with_row: AcasProcessor) -> None:
    whole = judged(with_row)
    series = whole.checks[NAME]
    assert series.run.any()
    assert series.failed.any()
    place = [spec.name for spec in whole.specs].index(NAME)
    assert np.any(whole.cause == place)
    here = tuple(np.argwhere(whole.cause == place)[0].tolist())
    assert "an even epoch" in whole.reason(*here)


def test_it_has_a_share_of_the_budget(with_row: AcasProcessor) -> None:
    cadence = Cadence(satellites=8)
    shares = false_alarm_budget(2, cadence)
    assert (shares[NAME].chosen, shares[NAME].exact) == (True, True)
    assert shares[NAME].p_fa == pytest.approx(1 / 13 / (8 * 2880))  # twelve others have a share
    whole = judged(with_row)
    expected = false_alarm_budget(2, with_row.monitoring.cadence)[NAME].p_fa
    assert whole.checks[NAME].p_fa == expected


def test_it_is_gone_without_its_row() -> None:
    whole = judged(AcasProcessor(level=2, monitoring=settings()))
    assert NAME not in whole.checks


@dataclass(frozen=True, slots=True, kw_only=True)
class RecsCountMonitor(Monitor):
    """The file of a new check with memory: it counts RECS, and fails with the twelfth."""

    name: ClassVar = "number of RECS"
    unit: ClassVar = "RECS"
    p_fa: float = 1e-6

    def _count(self, evidence: Evidence) -> np.ndarray:
        (before,) = evidence.memory.get(RECEIVER, (0.0,))
        return before + np.cumsum(evidence.measured.snapshots.recs)

    def series(self, evidence: Evidence) -> CheckSeries:
        count = self._count(evidence)
        return series_of(self, count, np.full(count.shape, 11.5), lambda *_: "a dozen RECS")

    def remember(self, evidence: Evidence) -> CheckMemory:
        return {RECEIVER: (float(self._count(evidence)[-1]),)}


def test_a_check_with_memory_is_its_file_and_its_row_too(monkeypatch: pytest.MonkeyPatch) -> None:
    name = RecsCountMonitor.name
    row = CheckSpec(
        step=3,
        name=name,
        failure=Status.SUSPECT,
        make=lambda _, p_fa: RecsCountMonitor(p_fa=p_fa),
        scope=Scope.RECEIVER,
    )
    monkeypatch.setitem(LEVELS, 1, (*LEVELS[1], row))
    sky = MadeUpSky(seed=5, n=40).whole
    blocks = [cut(sky, first, last) for first, last in pairwise([0, 1, 17, 30, 40])]
    steps = list(AcasProcessor(monitoring=settings()).steps(blocks, assistance=Keys()))  # type: ignore[arg-type]
    statistic = np.concatenate([step.block.checks[name].statistic for step in steps])
    assert statistic.tolist() == np.cumsum(np.arange(40) % 3 == 0).tolist()
    assert np.flatnonzero(np.concatenate([step.block.failed[name] for step in steps]))[0] == 33
    assert steps[-1].state.memory == {name: {RECEIVER: (14.0,)}}


def test_the_processor_names_only_what_it_makes_itself() -> None:
    """`assess` makes the searches, and asks step 1 whether there is a verdict; it names no other check."""
    allowed = {"E6_POWER", "E1_VESTIGIAL_SEARCH", "E6_EXHAUSTIVE_SEARCH"}
    for path in (PROCESSOR / "assess.py", *sorted((PROCESSOR / "monitoring").glob("*.py"))):
        named = {
            node.attr
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "CheckName"
        }
        assert named <= allowed, path.name


def test_every_row_is_made_but_the_searches() -> None:
    processor = AcasProcessor(level=3, monitoring=settings())
    searches = {CheckName.E1_VESTIGIAL_SEARCH, CheckName.E6_EXHAUSTIVE_SEARCH}
    assert {spec.name for spec in LEVELS[3] if spec.make is None} == searches
    for spec in LEVELS[3]:
        check = None if spec.make is None else spec.make(processor, 1e-5)
        assert check is None or check.name == spec.name
