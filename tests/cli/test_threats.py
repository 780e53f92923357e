from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from vestige.cli.threats import command
from vestige.errors import VestigeError

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
MINE = """
kind = "campaign"
seed = 1
start = "2026-11-21T12:00:00 GST"
epochs = 20
interval_s = 30.0
[receiver]
cn0_dbhz = 40.0
cn0_e1_dbhz = 40.0
[[attack]]
kind = "meaconing"
start_s = 300
delay_s = 2e-6
power_db = 6.0
"""


def threats(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments])


def test_a_row_with_its_expectation_and_what_differs() -> None:
    result = threats("--only", "A14", "--seeds", 7)
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    (row,) = (line for line in lines if "E6 a chip behind E1" in line and "miss" in line)
    assert "DIFFERS" in row
    assert "7 (59–100)" in row
    assert float(row.split()[-1]) < 53  # worst accepted, the last column
    assert any("A14 E6 a chip behind E1: differs: an attacker" in line for line in lines)
    assert result.stdout.count("not measured yet") == 2


def test_nominal_scenes_have_false_alarms_a_day() -> None:
    result = threats("--only", "A0", "--seeds", 1, "--level", 1)
    assert result.exit_code == 0
    assert "A0 harsh: " in result.stdout
    assert result.stdout.count("false alarms a day (95 %") == 5
    assert "not measured yet" not in result.stdout


@pytest.mark.parametrize("level", [2, 3])
def test_other_levels_are_expectations(level: int) -> None:
    result = threats("--level", level)
    assert result.exit_code == 0
    assert f"Mitigation level {level}: expected, not measured yet" in result.stdout
    assert all(f"A{number} " in result.stdout for number in range(15))
    assert "[WFO, Sec. VI-B]" in result.stdout


def test_what_single_satellite_runs_cannot_show_is_said() -> None:
    result = threats("--only", "A12", "--seeds", 2, "--level", 1)
    assert "A12: shown by one line of sight" in result.stdout


def test_one_json_object(tmp_path: Path) -> None:
    result = threats("--only", "A1", "--seeds", 2, "-o", tmp_path / "out", "--json")
    found = json.loads(result.stdout)
    assert found["threats"][0]["expected"] == {"1": "detect", "2": "detect", "3": "detect"}
    (row,) = found["level_1"]
    assert (row["threat"], row["detected"], row["detected_of"]) == ("A1", 2, 2)
    assert row["worst_accepted_m"] is None
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"runs.csv", "threats.csv"}


def test_an_attack_of_ones_own(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(MINE)
    result = threats("--attack", tmp_path / "mine.toml", "--quick", "-o", tmp_path / "out")
    assert result.exit_code == 0
    (row,) = (line for line in result.stdout.splitlines() if " mine " in line)
    assert "20 (83–100)" in row  # missed
    assert "A1" not in result.stdout
    assert f"table: {tmp_path / 'out' / 'threats.csv'}" in result.stdout


def test_bad_input_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text(MINE.replace("2e-6", "-1"))
    for file, message in (
        (tmp_path / "bad.toml", "delays by 0 to 60 s"),
        (SCENARIOS / "first_light.toml", "expected 'campaign'"),
    ):
        with pytest.raises(VestigeError, match=message) as caught:
            CliRunner().invoke(command, ["--attack", str(file)], standalone_mode=False, catch_exceptions=False)
        assert str(caught.value).startswith(f"{file}: ")
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "arguments",
    [
        ("--level", "4"),
        ("--quick", "--seeds", "3"),
        ("--seeds", "0"),
        ("--only", "A99"),
        ("--only", "A1", "--attack", "x.toml"),
        ("--level", "2", "--attack", "x.toml"),
        ("-j", "0"),
    ],
)
def test_usage_errors(arguments: tuple[str, ...]) -> None:
    result = threats(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""


def test_help_loads_nothing_heavy() -> None:
    assert "threat table" in threats("--help").stdout
    code = "import sys, vestige.cli.threats; print(sorted({'numpy', 'xarray', 'rich'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"  # noqa: S603
