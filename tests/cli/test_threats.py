from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from builders import MEACONED
from extend_page import no_parts, write_page
from vestige.cli.campaigns.plot import command as plot
from vestige.cli.campaigns.threats import command
from vestige.errors import InputFileError, VestigeError
from vestige.folder_lock import only_writer
from vestige.threats.runs import RUNS, read_runs
from vestige.threats.table import read_threat_dataset

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


def threats(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments])


def measured(*arguments: object) -> str:
    result = threats(*arguments)
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.mark.slow
def test_a_row_with_its_expectation_and_what_differs() -> None:
    lines = measured("--only", "A14", "--seeds", 6, "--level", 1).splitlines()
    (row,) = (line for line in lines if "E6 a chip behind E1" in line and "miss" in line)
    assert "DIFFERS" in row
    assert "6 (54–100)" in row
    assert any("A14 E6 a chip behind E1, level 1: differs: the attacker" in line for line in lines)
    place = next(place for place, line in enumerate(lines) if "Level 1: failed checks" in line)
    (row,) = (line for line in lines[place:] if line.startswith(" A14 E6 a chip behind E1"))
    assert "E1-E6 range 6/6, 60 s" in row


@pytest.mark.slow
def test_nominal_scenes_have_false_alarms_a_day() -> None:
    text = measured("--only", "A0", "--seeds", 1, "--level", 2)
    assert "False alarms a day without an attack" in text
    assert text.count("as expected") == 5
    assert "ionosphere 2014" in text


@pytest.mark.parametrize("level", [1, 2, 3])
def test_expectations_can_be_read_without_a_measurement(level: int) -> None:
    result = threats("--level", level, "--expected")
    assert result.exit_code == 0
    assert f"Mitigation level {level}: expected" in result.stdout
    assert all(f"A{number} " in result.stdout for number in range(15))
    assert "[WFO, Sec. VI-B]" in result.stdout


@pytest.mark.slow
def test_one_json_object(tmp_path: Path) -> None:
    found = json.loads(measured("--only", "A1", "--seeds", 1, "-o", tmp_path / "out", "--json"))
    assert found["threats"][0]["expected"] == {"1": "detect", "2": "detect", "3": "detect"}
    first, second, third = found["cells"]
    assert (first["threat"], first["level"], first["detected"], first["detected_of"]) == ("A1", 1, 1, 1)
    assert first["worst_range_m"] is None
    assert second["word"] == third["word"] == "mitigated"
    assert first["checks"][0]["name"] == "E6 power"
    # the receiver is restarted and acquires for a second: the first RECS that it has E1 for is the one after that
    assert (first["checks"][0]["time_s"], first["checks"][0]["failed"]["successes"]) == (30.0, 1)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "runs.csv",
        "threats.csv",
        "threats.zarr",
        "threats.png",
    }
    drawn = CliRunner().invoke(plot, ["threats", str(tmp_path / "out"), "-o", str(tmp_path / "map.svg")])
    assert drawn.exit_code == 0
    assert (tmp_path / "map.svg").stat().st_size > 1000


def test_a_folder_without_a_table_has_no_figure(tmp_path: Path) -> None:
    with pytest.raises(VestigeError, match=r"threats\.zarr: store: found nothing, expected the table that"):
        CliRunner().invoke(
            plot,
            ["threats", str(tmp_path), "-o", str(tmp_path / "x.png")],
            standalone_mode=False,
            catch_exceptions=False,
        )


def test_an_attack_of_ones_own(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(MEACONED)
    text = measured("--attack", tmp_path / "mine.toml", "--quick", "-o", tmp_path / "out")
    (level_1,) = (line for line in text.splitlines() if "mine" in line and "(54–100)" in line)
    assert " missed " in level_1
    assert "A1 " not in text
    assert f"written: {tmp_path / 'out' / 'threats.csv'}" in text


def test_bad_input_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text(MEACONED.replace("2e-6", "-1"))
    for file, message in (
        (tmp_path / "bad.toml", "a delay of the meaconer from 0 to 60 s"),
        (SCENARIOS / "first_light.toml", "expected 'campaign'"),
    ):
        with pytest.raises(VestigeError, match=message) as caught:
            CliRunner().invoke(command, ["--attack", str(file)], standalone_mode=False, catch_exceptions=False)
        assert str(caught.value).startswith(f"{file}: ")
        assert "\n" not in str(caught.value)


def test_attacks_in_one_list_or_one_by_one() -> None:
    text = measured("--only", "A17,A15", "--expected", "--level", 1)
    assert text == measured("--only", "A15", "--only", "A17", "--expected", "--level", 1)
    assert [word for word in ("A14", "A15", "A16", "A17") if f"{word} " in text] == ["A15", "A17"]


@pytest.mark.parametrize(
    "arguments",
    [
        ("--level", "4"),
        ("--quick", "--seeds", "3"),
        ("--seeds", "0"),
        ("--only", "A99"),
        ("--only", "A1,A99"),
        ("--only", "A1,"),
        ("--only", "A1", "--attack", "x.toml"),
        ("--expected", "--attack", "x.toml"),
        ("--scheduler", "tcp://x:1", "-j", "2"),
        ("-j", "0"),
    ],
)
def test_usage_errors(arguments: tuple[str, ...]) -> None:
    result = threats(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""


def test_help() -> None:
    assert "threat table" in threats("--help").stdout


def test_one_writer_at_a_time(tmp_path: Path) -> None:
    with only_writer(tmp_path / "out"):
        result = threats("--only", "A14", "--seeds", 1, "-o", tmp_path / "out")
    assert isinstance(result.exception, InputFileError)
    assert str(result.exception).endswith("found another process that writes into it, expected one process at a time")
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.slow
def test_a_detector_and_a_check_of_the_users_are_measured_against_the_table(tmp_path: Path) -> None:
    """They enter the digest of the runs, and what is printed says which settings these were."""
    write_page(tmp_path)
    check = tmp_path / "my_check.py"
    check.write_text(check.read_text().replace("p_fa = 1e-6", "p_fa = 0.5"))  # fails in every other test
    out, parts = tmp_path / "out", ("--parts", tmp_path)
    words = ("--only", "A14", "--seeds", 1, "-o", out, "--json")
    own = ("processor.detector=my_detector:RelativePeak", 'processor.checks=["my_check:EarlyPower"]')
    measured(*words)
    plain = set(read_runs(out / RUNS))
    with no_parts():
        found = json.loads(measured(*words, *parts, *(word for one in own for word in ("--set", one))))
    assert found["settings"] == list(own)
    spoken = {one["name"] for cell in found["cells"] for one in cell["checks"]}
    assert "early power" in spoken
    both = read_runs(out / RUNS)
    assert len(both) == 2 * len(plain)
    assert {key[-1] for key in set(both) - plain}.isdisjoint(key[-1] for key in plain)
    assert read_threat_dataset(out).attrs["settings"] == " ".join(own)
    with (out / "threats.csv").open() as file:
        assert {row["settings"] for row in csv.DictReader(file)} == {" ".join(own)}


def test_settings_reach_every_scene_and_a_scenario_of_the_users() -> None:
    words = ("--set", "epochs=50", "--set", "recs.every=7", "--seeds", 1, "--level", 1)
    text = measured("--only", "A1", "--only", "A2", *words)
    assert text.startswith(
        "Every scene was run with epochs=50, recs.every=7. The expected outcomes are for scenes without these settings."
    )
    mine = measured("--attack", SCENARIOS / "quick.toml", "--seeds", 1, "--set", "epochs=20", "--json")
    assert json.loads(mine)["settings"] == ["epochs=20"]


@pytest.mark.parametrize("setting", ["seed=3", "processor.level=2", "kind=campaign"])
def test_what_the_table_chooses_itself_cannot_be_set(setting: str) -> None:
    assert threats("--set", setting).exit_code == 2
    assert threats("--expected", "--set", "epochs=3").exit_code == 2


def test_a_setting_that_no_scene_has_is_one_line() -> None:
    with pytest.raises(InputFileError, match=r"threats\.toml: processor\.detectr: "):
        CliRunner().invoke(command, ["--only", "A1", "--set", "processor.detectr=early"], catch_exceptions=False)
