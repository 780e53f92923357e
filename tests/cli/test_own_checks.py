"""What the commands say of a check that a user wrote, at level 1: name, counts and verdicts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from extend_page import no_parts, write_page
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
    assert f"every fifth, your own check: {failed} of {made} tests failed" in said
    assert f"every fifth failed {failed} times, first at T = 5 s" in said


def test_what_is_not_available_is_counted_from_the_status(of_run: tuple[str, Path, str]) -> None:
    """Where the user's check failed the verdict is SUSPECT, with correlators or without."""
    name, folder, said = of_run
    if name == "sky":
        assert "NOT_AVAILABLE" not in said
        return
    status = open_dataset(folder / "a.zarr")["status"].values
    found = int((status == list(Status).index(Status.NOT_AVAILABLE)).sum())
    assert 0 < found < 60
    assert f"NOT_AVAILABLE: {found} of 60 verdicts" in said


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
    rows = rows_of(text, "Checks of mitigation level 1, and when they first failed")
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


SIMULATE = ("--set", "interval_s=0.1", "--set", "receiver.sample_rate_hz=6.2e6", "--epochs", "3:8")


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the parts and a recording."""
    folder = tmp_path_factory.mktemp("recording")
    write_page(folder)
    (folder / "fives.py").write_text(CHECK)
    (folder / "again.py").write_text(CHECK)
    (folder / "touch.py").write_text(
        CHECK.replace("statistic = ", "evidence.measured.snapshots.e6.samples\n        x = ")
    )
    invoke("simulate", SCENARIOS / "quick.toml", "-o", folder / "case", *SIMULATE)
    return folder


def test_a_recording_is_seen_by_a_detector_and_a_check_of_the_users(case: Path) -> None:
    """The check fails where it says; the detector, which is the early one with a limit, finds what that finds."""
    plain = json.loads(invoke("process", case / "case", "--json").stdout)["verdicts"]
    own = ("--parts", case, "--detector", "my_detector:RelativePeak", "--check", "fives:Fives")
    found = json.loads(invoke("process", case / "case", *own, "--json").stdout)["verdicts"]
    assert len(found) == len(plain) == 5
    for number, (one, without) in enumerate(zip(found, plain, strict=True)):
        assert [check["name"] for check in one["checks"]] == ["E6 power", "E1-E6 range", "every fifth"]
        assert one["checks"][2]["statistic"] == (2.0 if one["snapshot"] % 10 == 5 else 0.0), number
        assert one["status"] == ("SUSPECT" if one["snapshot"] % 10 == 5 else without["status"])
        assert one["range_offset_m"] == pytest.approx(without["range_offset_m"], abs=1e-6)


def test_a_detector_that_finds_nothing_decides_on_a_recording(case: Path) -> None:
    (case / "blind.py").write_text(
        "import numpy as np\nclass Blind:\n    def __init__(self, spacing): self.spacing = spacing\n"
        "    def detect(self, magnitudes, threshold): return np.full(len(magnitudes), -1)\n"
    )
    said = invoke("process", case / "case", "--parts", case, "--detector", "blind:Blind", "--json").stdout
    assert {one["status"] for one in json.loads(said)["verdicts"]} == {"NOT_DETECTED"}


def refused(*arguments: object) -> str:
    with no_parts():
        result = CliRunner().invoke(vestige, ["process", *(str(one) for one in arguments)])
    assert result.exit_code != 0
    return str(result.output if result.exit_code == 2 else result.exception)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--check", "nothing:Here"), "nothing:Here: found no nothing.py in "),
        (("--check", "fives:Fives", "--check", "again:Fives"), "--check: two checks have the same name"),
        (("--check", "touch:Fives"), "touch:Fives: found evidence.measured.snapshots.e6.samples"),
        (("--detector", "latest"), "found 'latest', expected early, maximum or module:Name"),
        (("--detector", "fives:Fives"), "fives:Fives: found TypeError"),
    ],
)
def test_what_is_wrong_with_a_part_is_one_line(words: tuple[str, ...], said: str, case: Path) -> None:
    assert said in refused(case / "case", "--parts", case, *words)


def test_no_part_comes_without_a_folder(case: Path) -> None:
    assert "found no folder of own parts" in refused(case / "case", "--check", "fives:Fives")


def test_verdicts_are_not_continued_with_a_part_that_has_changed(case: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(CHECK)
    words = (
        case / "case",
        "--follow",
        "--idle-s",
        "0",
        "-o",
        tmp_path / "kept",
        "--parts",
        tmp_path,
        "--check",
        "mine:Fives",
    )
    invoke("process", *words)
    (tmp_path / "mine.py").write_text(CHECK + "# changed\n")
    assert "own parts" in refused(*words)
