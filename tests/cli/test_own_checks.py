"""What the commands say of a check that a user wrote, at level 1: name, counts and verdicts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from extend_page import no_parts
from report_builder import rows_of
from vestige.campaign.store.results import open_dataset
from vestige.cli.main import vestige
from vestige.records import Status

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
CHECK = """
import numpy as np
from vestige.records.checks import CheckSeries

class Fives:
    name, unit, p_fa = "every fifth", "1", 1e-3

    def series(self, evidence):
        statistic = np.where(evidence.measured.snapshots.index % 10 == 5, 2.0, 0.0)[:, None] + np.zeros(evidence.shape)
        return CheckSeries(name=self.name, unit=self.unit, p_fa=self.p_fa, statistic=statistic,
                           threshold=np.ones(evidence.shape), explain=lambda epoch, satellite: "it is a fifth epoch")
"""
SKY = ("epochs=60", "recs.every=10", "constellation.svids=[6, 7, 8, 12, 13]")
QUICK = ("epochs=60", "receiver.time_uncertainty_s=30")


def words(name: str) -> list[str]:
    settings = SKY if name == "sky" else QUICK
    return [str(SCENARIOS / f"{name}.toml"), "--set", 'processor.checks=["fives:Fives"]', *(
        word for one in settings for word in ("--set", one)
    )]  # fmt: skip


def invoke(*arguments: object) -> Result:
    with no_parts():
        result = CliRunner().invoke(vestige, [str(one) for one in arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result


@pytest.fixture(scope="module", params=["quick", "sky"])
def of_run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path, str]:
    """Return the scenario's name, the folder with parts and store, and what `vestige run` said."""
    folder = tmp_path_factory.mktemp("fives")
    (folder / "fives.py").write_text(CHECK)
    said = invoke("run", *words(request.param), "--parts", folder, "-o", folder / "a.zarr").stdout
    return request.param, folder, said


def made_and_failed(name: str) -> tuple[int, int]:
    return (5 * 60, 5 * 6) if name == "sky" else (60, 6)


def test_run_names_it_and_counts(of_run: tuple[str, Path, str]) -> None:
    name, _, said = of_run
    made, failed = made_and_failed(name)
    assert f"every fifth, a check of yours: {failed} of {made} tests failed" in said
    assert f"every fifth failed {failed} times, first at T = 5 s" in said


def test_what_is_not_available_is_counted_from_the_status(of_run: tuple[str, Path, str]) -> None:
    """Where the user's check failed the verdict is SUSPECT, with correlators or without."""
    name, folder, said = of_run
    if name == "sky":
        assert "not available" not in said
        return
    status = open_dataset(folder / "a.zarr")["status"].values
    found = int((status == list(Status).index(Status.NOT_AVAILABLE)).sum())
    assert 0 < found < 60
    assert f"not available: {found} of 60 verdicts" in said


def test_json_has_it(of_run: tuple[str, Path, str]) -> None:
    name, folder, _ = of_run
    said = invoke("run", *words(name), "--parts", folder, "-o", folder / "a.zarr", "--json").stdout
    made, failed = made_and_failed(name)
    verdicts = json.loads(said)["verdicts"]
    assert verdicts["own_checks"] == {"every fifth": {"tests": made, "failed": failed}}
    assert verdicts["failures"]["every fifth"] == failed
    # a verdict of a RECS is the gravest since the RECS before, so a failure between two of them counts
    assert verdicts["alarms"] >= 1


def test_the_report_has_it(of_run: tuple[str, Path, str]) -> None:
    name, folder, _ = of_run
    page = folder / f"{name}.html"
    invoke("report", folder / "a.zarr", "--parts", folder, "-o", page)
    text = page.read_text(encoding="utf-8")
    made, failed = made_and_failed(name)
    rows = rows_of(text, "Checks of mitigation level 1, and where they failed")
    assert rows["every fifth"] == [str(made), "0.001", str(failed), "T = 5 s"]
    counted = rows_of(text.partition('id="false-alarms"')[2], "Monitors")
    assert counted["every fifth"][1:3] == [str(failed), str(made)]
    assert "fives:Fives" in text
    verdicts = rows_of(text, f"{30 if name == 'sky' else 60} verdicts were due, 0 of them under attack")
    if name == "sky":  # the failures lie between the RECS: all verdicts but those of the first RECS are suspect
        assert [verdicts[one][0] for one in verdicts if one.startswith("suspect")] == ["25"]


def test_plot_monitors_draws_it(of_run: tuple[str, Path, str]) -> None:
    _, folder, _ = of_run
    file = folder / "monitors.svg"
    assert invoke("plot", "monitors", folder / "a.zarr", "--parts", folder, "-o", file).stdout == f"{file}\n"
    assert file.stat().st_size > 1000
