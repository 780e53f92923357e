from __future__ import annotations

from pathlib import Path

from click.testing import CliRunner

from vestige.cli.start.init import command
from vestige.errors import InputFileError
from vestige.scenario.load import load_scenario
from vestige.scenario.shipped import shipped_scenarios

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


def test_the_scenarios_of_the_project_are_written_and_can_be_read(tmp_path: Path) -> None:
    result = CliRunner().invoke(command, [str(tmp_path / "new")], standalone_mode=False)
    assert result.exception is None
    written = sorted((tmp_path / "new" / "scenarios").iterdir())
    assert [path.name for path in written] == sorted(path.name for path in SCENARIOS.iterdir())
    for path in written:
        assert path.read_bytes() == (SCENARIOS / path.name).read_bytes()
        assert path.name in result.stdout
        load_scenario(path)


def test_a_folder_that_is_there_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "scenarios").mkdir()
    result = CliRunner().invoke(command, [str(tmp_path)], standalone_mode=False)
    assert isinstance(result.exception, InputFileError)
    assert not any((tmp_path / "scenarios").iterdir())


def test_there_are_scenarios_in_a_checkout() -> None:
    assert [path.parent for path in shipped_scenarios()] == [SCENARIOS] * len(shipped_scenarios())


def test_the_second_time_names_what_to_type(tmp_path: Path) -> None:
    (tmp_path / "scenarios").mkdir()
    result = CliRunner().invoke(command, [str(tmp_path)], standalone_mode=False)
    assert str(result.exception).endswith("give another folder: vestige init FOLDER")


def test_comments_stand_apart_from_the_commands(tmp_path: Path) -> None:
    result = CliRunner().invoke(command, [str(tmp_path / ("long" * 10))], standalone_mode=False)
    commands = [line for line in result.stdout.splitlines() if line.startswith("  vestige ")]
    assert len(commands) == 3
    assert all("  # " in line for line in commands)
