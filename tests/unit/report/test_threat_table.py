from __future__ import annotations

import math
from pathlib import Path

import pytest

from report_builder import THREAT_ROW, threat_folder
from vestige.errors import InputFileError
from vestige.report.threat_table import read_threat_table
from vestige.threats.table import TABLE


def table_of(tmp_path: Path, *rows: dict[str, str]) -> Path:
    return threat_folder(tmp_path / "t", *rows) / TABLE


def test_one_level_is_measured_and_another_expected(tmp_path: Path) -> None:
    found = read_threat_table(table_of(tmp_path))
    assert found.levels == (1, 2)
    ((row, (first, second)),) = found.scenes()
    assert row == THREAT_ROW
    assert (first.expected, first.agreement, first.measured) == (("detect", "it is seen"), "as expected", True)
    assert (first.value("detected"), first.value("worst_range_m")) == (19, 28.3)
    assert (second.expected, second.agreement, second.measured) == (("miss", ""), "", False)
    assert math.isnan(second.value("detected"))


def test_a_table_of_release_0_2_0_is_read_with_its_largest_range_error(tmp_path: Path) -> None:
    path = table_of(tmp_path)
    path.write_text(path.read_text().replace("worst_range_m", "worst_accepted_m"))
    ((_, (first, _)),) = read_threat_table(path).scenes()
    assert first.value("worst_range_m") == 28.3


@pytest.mark.parametrize("name", ["{0}_level_2", "level_2_{0}"])
def test_columns_of_further_levels_appear(tmp_path: Path, name: str) -> None:
    more = {"level_2": "DIFFERS", name.format("detected"): "7", name.format("detected_of"): "20"}
    ((_, (first, second)),) = read_threat_table(table_of(tmp_path, more)).scenes()
    assert (second.agreement, second.value("detected"), second.measured) == ("DIFFERS", 7, True)
    assert not first.measured  # two levels are measured: `detected` alone is of neither


def test_a_row_for_each_level(tmp_path: Path) -> None:
    rows = ({"level": "1"}, {"level": "3", "expected_level_3": "mitigate"}, {"level": "1", "scene": "two"})
    whole = [{"expected_level_3": ""} | row for row in rows]
    for row, word in zip(whole, ("as expected", "DIFFERS", "undecided"), strict=True):
        row |= {"agreement": word, "detected": str(len(word))}
    path = table_of(tmp_path, *whole)
    path.write_text(path.read_text().replace("level_1,detected,", "was,detected,"))
    found = read_threat_table(path)
    assert found.levels == (1, 2, 3)
    (_, (first, second, third)), (_, (other, *_)) = found.scenes()
    assert (first.agreement, third.agreement, other.agreement) == ("as expected", "DIFFERS", "undecided")
    assert (first.value("detected"), third.value("detected")) == (11, 7)
    assert third.expected[0] == "mitigate"
    assert not second.measured


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: found no column threat"),
        ("a,b\n1,2\n", "line 1: found no column threat"),
        ("threat,attack\n", "line 1: found no column scene"),
        ("threat,scene,level_1\n", "rows: found none"),
        ("threat,scene,level_1\nA1,x\n", "row 2: found 2 cells, expected 3"),
        ("threat,scene,detected\nA1,x,many\n", "row 2, detected: found many, expected a number"),
        ("threat,scene,detected_of_level_2\nA1,x,inf\n", "row 2, detected_of_level_2: found inf, expected a count"),
        ("threat,scene,level\nA1,x,first\n", "row 2, level: found first, expected a mitigation level"),
        ('threat,scene\nA1,"x\n', "file: found"),
    ],
)
def test_what_is_no_table_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / TABLE
    path.write_text(text)
    with pytest.raises(InputFileError) as caught:
        read_threat_table(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert "\n" not in str(caught.value)


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    path = tmp_path / TABLE
    path.write_bytes(b"threat,scene\n\xff\xfe\x00")
    with pytest.raises(InputFileError, match="expected a table of threats"):
        read_threat_table(path)
