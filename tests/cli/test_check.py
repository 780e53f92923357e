from __future__ import annotations

import json
import re
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from vestige.cli.campaigns.check import command
from vestige.errors import InputFileError

SCENARIOS = sorted((Path(__file__).resolve().parents[2] / "scenarios").glob("*.toml"))


def test_every_scenario_of_the_project_is_good() -> None:
    assert SCENARIOS
    result = CliRunner().invoke(command, [*map(str, SCENARIOS), "--json"], standalone_mode=False)
    content = json.loads(result.stdout, parse_constant=pytest.fail)  # one has an infinite limit
    assert content.keys() == {str(path) for path in SCENARIOS}


def test_good_ones_are_printed_before_the_bad_one_is_reported(tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text("seed = 1")
    result = CliRunner().invoke(command, [str(bad), str(SCENARIOS[0])], standalone_mode=False)
    assert isinstance(result.exception, InputFileError)
    assert str(SCENARIOS[0]) in result.stdout


def test_text(tmp_path: Path) -> None:
    result = CliRunner().invoke(command, [str(SCENARIOS[0])], standalone_mode=False)
    assert result.exception is None
    assert "satellites" in result.stdout


def test_a_profile_with_points_has_no_empty_file_name() -> None:
    liftoff = next(path for path in SCENARIOS if path.stem == "liftoff")
    delay = 'attack.0.delay_m={kind="table", time_s=[0.0, 100.0], values=[0.0, 50.0]}'
    result = CliRunner().invoke(command, [str(liftoff), "--set", delay], standalone_mode=False)
    assert "  attack.0.delay_m: table: time_s = [0, 100], values = [0, 50]\n" in result.stdout


def test_a_campaign_is_printed_with_the_keys_of_its_file_and_not_as_python() -> None:
    """Every value can be typed into a scenario, and `--set` replaces one."""
    liftoff = next(path for path in SCENARIOS if path.stem == "liftoff")
    arguments = [str(liftoff), "--set", "processor.detector=maximum"]
    result = CliRunner().invoke(command, arguments, standalone_mode=False)
    assert result.exception is None
    told = " ".join(result.stdout.split())
    assert "attack.0: lift-off: start_s = 0, stop_s = inf" in told
    assert "attack.0.delay_m: sine: first = 71.5, turn = 0" in told
    assert re.search(r"(?m)^  processor\.budget: hardware_m = 0, group_delay_m = ", result.stdout)
    assert "{" not in told.partition("processor:")[2].partition("attack.0")[0]
    assert "detector = maximum, spacing = 1, p_fa = 1e-07" in told
    assert "receiver.bias: none" in told
    assert not {"(", "None", "True", "False", "'"} & set(told.replace("BOC(1,1)", "").replace("(", " ( ").split())
    assert max(map(len, result.stdout.splitlines()[1:])) <= 120


@pytest.mark.parametrize("text", ["", "\x00", "seed = [", "a.b.c = 1"])
def test_garbage(tmp_path: Path, text: str) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text(text)
    result = CliRunner().invoke(command, [str(bad)], standalone_mode=False)
    assert isinstance(result.exception, InputFileError)
    assert "\n" not in str(result.exception)


def test_schema() -> None:
    result = CliRunner().invoke(command, ["--schema"], standalone_mode=False)
    assert result.exception is None
    found = json.loads(result.stdout, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert {"CampaignScenario", "RecordingScenario"} <= found["$defs"].keys()


@pytest.mark.parametrize("arguments", [[], ["--schema", str(SCENARIOS[0])]])
def test_files_or_the_schema(arguments: list[str]) -> None:
    assert isinstance(CliRunner().invoke(command, arguments, standalone_mode=False).exception, click.UsageError)


def test_a_staircase_is_cautioned_against_on_stderr(tmp_path: Path) -> None:
    path = tmp_path / "stairs.toml"
    harsh = next(path for path in SCENARIOS if path.stem == "harsh").read_text()
    path.write_text(harsh.replace("12.5e6", "10.23e6"))
    result = CliRunner().invoke(command, [str(path), "--json"], standalone_mode=False)
    content = json.loads(result.stdout, parse_constant=pytest.fail)  # one has an infinite limit
    assert content.keys() == {str(path)}
    (line,) = result.stderr.splitlines()
    assert "29.3 m" in line
    assert "10.3 MHz" in line
