from __future__ import annotations

import csv
from collections.abc import Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from vestige.campaign.executors import local_executor
from vestige.campaign.threat_matrix import (
    Cell,
    case_of,
    cases,
    measure,
    measure_threats,
    row_of,
    window_of,
    write_table,
)
from vestige.campaign.threat_outcome import Agreement
from vestige.campaign.threat_runs import RUNS, read_runs
from vestige.errors import InputFileError
from vestige.scenario.threats import read_threats

SOME = cases([threat for threat in read_threats() if threat.id in {"A1", "A3"}])


class Counting(Executor):
    """Runs a call at once and counts; after `limit` calls Ctrl-C."""

    def __init__(self, limit: float = float("inf")) -> None:
        self.calls, self.limit = 0, limit

    def submit(self, call: Any, /, *arguments: Any, **more: Any) -> Future[Any]:
        if self.calls >= self.limit:
            raise KeyboardInterrupt
        self.calls += 1
        future: Future[Any] = Future()
        future.set_result(call(*arguments, **more))
        return future


def table(pool: Executor, folder: Path | None = None, seeds: Sequence[int] = range(3)) -> list[Cell]:
    return list(measure_threats(SOME, seeds, pool, folder=folder))


def found(cells: Sequence[Cell]) -> list[dict[str, object]]:
    return [{name: str(value) for name, value in row_of(cell).items()} for cell in cells]


def test_level_1_detects_a_spoofer_on_e1_and_misses_a_meaconer() -> None:
    e1, meaconer = table(Counting(), seeds=range(8))
    assert (e1.agreement, meaconer.agreement) == (Agreement.AGREES, Agreement.AGREES)
    assert (e1.found.detected.successes, e1.found.missed.successes) == (8, 0)
    assert (meaconer.found.detected.successes, meaconer.found.missed.successes) == (0, 8)
    assert e1.found.by_chance.successes == 0
    assert e1.found.by_chance.trials == 8


def test_nothing_is_measured_twice(tmp_path: Path) -> None:
    pool = Counting()
    first = table(pool, tmp_path)
    assert pool.calls == 2 * 3 * 2  # cases, seeds, with attack and without
    again = Counting()
    assert found(table(again, tmp_path)) == found(first)
    assert again.calls == 0
    more = Counting()
    table(more, tmp_path, range(4))
    assert more.calls == 4


def test_an_interrupted_table_goes_on_where_it_was(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        table(Counting(limit=7), tmp_path)
    kept = len(read_runs(tmp_path / RUNS))
    assert 0 < kept <= 7
    with (tmp_path / RUNS).open("a") as file:
        file.write("A1,while E1")  # cut off in the middle of a line
    pool = Counting()
    assert found(table(pool, tmp_path)) == found(table(Counting()))
    assert pool.calls == 12 - kept


def test_workers_change_nothing() -> None:
    with local_executor("threads", 2) as pool:
        assert found(list(measure_threats(SOME, range(3), pool, workers=2))) == found(table(Counting()))


def test_another_scenario_is_measured_anew(tmp_path: Path) -> None:
    scenario = SOME[1].scenario(0, True)
    for changed in (scenario, scenario.model_copy(update={"epochs": 35})):
        pool = Counting()
        list(measure_threats([case_of("mine", changed)], range(2), pool, folder=tmp_path))
        assert pool.calls == 4


def test_a_scenario_of_ones_own_has_no_expectation() -> None:
    (cell,) = measure_threats([case_of("mine", SOME[0].scenario(0, True))], range(3), Counting())
    assert cell.agreement is Agreement.NOT_EXPECTED
    assert cell.found.detected.successes == 3
    mine = case_of("mine", SOME[0].scenario(0, True))
    assert [mine.scenario(seed, attacked).seed for seed in (3, 4) for attacked in (True, False)] == [3, 3, 4, 4]
    assert not mine.scenario(3, False).attack
    quiet = SOME[0].scenario(0, False)
    (cell,) = measure_threats([case_of("quiet", quiet)], range(3), Counting())
    assert not cell.attacked
    assert cell.found.alarms.trials == 3 * quiet.epochs
    assert cell.found.by_chance.trials == 0


def test_windows() -> None:
    assert window_of(SOME[0].scenario(0, True)) == (300.0, float("inf"))
    assert window_of(SOME[0].scenario(0, False)) == (0.0, float("inf"))
    outcome = measure(SOME[0].scenario(0, True), (300.0, 360.0))
    assert outcome.epochs == 2


def test_the_table_as_csv(tmp_path: Path) -> None:
    cells = table(Counting(), seeds=range(8))
    write_table(tmp_path / "threats.csv", cells)
    with (tmp_path / "threats.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["threat"] for row in rows] == ["A1", "A3"]
    assert rows[0]["expected_level_1"] == "detect"
    assert rows[0]["level_1"] == "as expected"
    assert (rows[0]["detected"], rows[0]["detected_of"]) == ("8", "8")
    assert float(rows[1]["worst_accepted_m"]) > 80.0


@pytest.mark.parametrize(
    "text", ["hello\n", "no line end", "\x00\n", "threat,scene\n"], ids=["word", "cut", "zero", "other"]
)
def test_a_foreign_file_is_refused_and_left_alone(tmp_path: Path, text: str) -> None:
    (tmp_path / RUNS).write_text(text)
    with pytest.raises(InputFileError, match="line 1"):
        table(Counting(), tmp_path)
    assert (tmp_path / RUNS).read_text() == text


def test_a_spoilt_line_is_named(tmp_path: Path) -> None:
    table(Counting(), tmp_path)
    lines = (tmp_path / RUNS).read_text().splitlines()
    for spoilt in (lines[3][:-9], lines[3] + ",1", lines[3].replace(",30,", ",x,"), ""):
        (tmp_path / RUNS).write_text("\n".join([*lines[:3], spoilt, *lines[4:]]) + "\n")
        with pytest.raises(InputFileError, match="line 4"):
            read_runs(tmp_path / RUNS)
    (tmp_path / RUNS).write_bytes(b"\xff\n")
    with pytest.raises(InputFileError):
        read_runs(tmp_path / RUNS)


def test_an_executor_of_processes_can_have_the_runs() -> None:
    """What travels to a worker can be pickled."""
    import pickle

    pickle.loads(pickle.dumps((measure, SOME[0].scenario(0, True), (0.0, 1.0))))  # noqa: S301
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(measure, SOME[0].scenario(0, True), (0.0, 100.0)).result().epochs == 4
