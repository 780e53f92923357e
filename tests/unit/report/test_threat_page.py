from __future__ import annotations

import hashlib
from pathlib import Path

import pytest
from click.testing import CliRunner

from report_builder import rows_of, threat_folder
from vestige.cli.campaigns.threats import command as threats
from vestige.report.threat_page import OWN_SCENARIO, QUESTION, threat_page
from vestige.threats.table import TABLE

NOMINAL = {"threat": "A0", "attack": "none", "scene": "clean", "expected_level_1": "pass", "by_chance_of": "0"}
DIFFERENT = {"scene": "two", "level_1": "DIFFERS", "note": "the bank <moves>"}
MATRIX = "The expected outcome, whether the measurement agrees, and the share of runs"


def page_of(tmp_path: Path, *rows: dict[str, str]) -> str:
    return threat_page(threat_folder(tmp_path / "mine", *rows) / TABLE, "mine").html()


def test_a_cell_says_what_was_expected_and_whether_it_is_so(tmp_path: Path) -> None:
    page = page_of(tmp_path, {}, DIFFERENT)
    rows = rows_of(page, MATRIX)
    assert rows["A1 none of <b>these</b>"] == []
    assert rows["one"] == ["detect detected 95 %, missed 15 %", "miss"]
    assert '<div class="tile agrees"><span class="mark" data-sign="✓">' in page
    assert '<div class="tile differs"><span class="mark" data-sign="✗">' in page
    assert '<div class="tile unmeasured"><span class="mark" data-sign="○">' in page


def test_the_answer_counts_the_scenes_of_each_level(tmp_path: Path) -> None:
    page = page_of(tmp_path, {}, DIFFERENT, {"scene": "three", "level_1": "undecided"})
    assert "<dt>level 1</dt><dd>1 of 3<small>scenes as expected; 1 differ, 1 undecided" in page
    assert "<dt>level 2</dt><dd>–<small>expected, not measured" in page
    assert QUESTION in page


def test_numbers_have_intervals(tmp_path: Path) -> None:
    (row,) = rows_of(page_of(tmp_path), "Level 1: runs, and the exact 95 % interval of their share").values()
    assert row == [
        "one",
        "19 of 20 75–99 %",
        "0 of 20 0–17 %",
        "3 of 20 3–38 %",
        "0 of 20 0–17 %",
        "2",
        "90 s",
        "28.3 m",
    ]


def test_which_check_failed_when_is_said_of_the_highest_level(tmp_path: Path) -> None:
    page = page_of(tmp_path, {}, {"scene": "two", "checks": ""}, NOMINAL)
    rows = rows_of(page, "Level 1: checks that failed, in how many runs, and the median time of their first failure")
    assert rows == {"A1 one": ["C/N0 19/20 after 4.5 s; RAIM 2/20 after 60 s"], "A1 two": ["none"]}


def test_false_alarms_are_those_of_scenes_without_an_attack(tmp_path: Path) -> None:
    page = page_of(tmp_path, NOMINAL, {})
    rows = rows_of(page, "False alarms that a user sees in a day, and the exact 95 % interval")
    assert rows == {"clean": ["216 (166 to 275) 60 in 0.278 days, at most 62 a day", "–"]}
    assert rows_of(page, MATRIX)["clean"][0] == "pass 216 alarms a day"
    assert "False alarms" not in page_of(tmp_path, {})


def test_why_it_differs_stands_there_escaped(tmp_path: Path) -> None:
    page = page_of(tmp_path, DIFFERENT, {"shows": "one line of sight"})
    assert "<dt>A1 two</dt><dd>Level 1 differs: the bank &lt;moves&gt;.</dd>" in page
    assert "<dt>A1</dt><dd>Shown by one line of sight.</dd>" in page
    assert "<b>these" not in page


def test_how_to_get_it_again(tmp_path: Path) -> None:
    page = page_of(tmp_path)
    assert "vestige threats --only A1 --seeds 20 -o mine\n" in page
    assert "Measured with vestige 1.2." in page
    own = page_of(tmp_path / "own", {"threat": OWN_SCENARIO, "scene": "mast"}, {"threat": OWN_SCENARIO, "scene": "van"})
    assert "vestige threats --attack mast.toml --attack van.toml --seeds 20 -o mine\n" in own
    assert hashlib.sha256((tmp_path / "mine" / TABLE).read_bytes()).hexdigest() in page


def test_every_column_is_there_even_an_unknown_one(tmp_path: Path) -> None:
    page = page_of(tmp_path, {"colour": "blue"})
    assert rows_of(page, "Every column, as in the file")["A1"][-1] == "blue"


def test_own_attacks_have_no_expectation(tmp_path: Path) -> None:
    own = {"threat": "mine", "attack": "", "scene": "", "expected_level_1": "", "expected_level_2": "", "level_1": ""}
    rows = rows_of(page_of(tmp_path, own), MATRIX)
    assert rows == {"mine": ["measured detected 95 %, missed 15 %", "no expected outcome"]}


@pytest.mark.slow
def test_a_real_table(tmp_path: Path) -> None:
    folder = tmp_path / "real"
    words = ["--only", "A0", "--only", "A14", "--only", "A1", "--seeds", "1", "-o", str(folder)]
    assert CliRunner().invoke(threats, words).exit_code == 0
    page = threat_page(folder / TABLE, "real").html()
    rows = rows_of(page, MATRIX)
    assert any(cells and cells[0].startswith("pass") for cells in rows.values())
    assert "alarms a day" in page
