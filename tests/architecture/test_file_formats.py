"""What docs/file_formats.md says is true: every column and key is there, and every example is read."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import jsonschema
import pytest

from vestige.cli.recordings.verdicts import VERDICT_COLUMNS
from vestige.crypto.keys.key_file import KEY_COLUMNS
from vestige.recording.assistance.receiver_corrections import CORRECTIONS_HEADER, read_hardware_bias, read_ionosphere
from vestige.recording.observations.accelerations import ACCELERATION_COLUMNS, read_accelerations
from vestige.recording.observations.csv_observations import OBSERVATION_COLUMNS, CsvParser
from vestige.recording.outputs.position_file import POSITION_COLUMNS
from vestige.recording.recording_toml import read_recording_toml, recording_schema
from vestige.recording.samples.test_vector_csv import HEADER
from vestige.records import Band

PAGE = Path(__file__).resolve().parents[2] / "docs" / "file_formats.md"
TEXT = PAGE.read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^##+ ([^\n]+)\n(.*?)(?=^##|\Z)", TEXT, re.MULTILINE | re.DOTALL))
SCHEMA = recording_schema()


def explained(section: str, header: str) -> list[str]:
    """Return the names in the first column of the tables of a section that begin with a header."""
    found, inside = [], False
    for line in SECTIONS[section].splitlines():
        inside = line.startswith("|") and (inside or line.startswith(f"| {header} |"))
        if inside and not line.startswith((f"| {header} |", "|---")):
            found += re.findall(r"`\[?([\w.]+)\]?`", line.split("|")[1])
    return found


def block(section: str, language: str) -> str:
    (found,) = re.findall(rf"^```{language}\n(.*?)^```", SECTIONS[section], re.MULTILINE | re.DOTALL)
    return str(found)


@pytest.mark.parametrize(
    ("section", "columns"),
    [
        ("observations.csv", OBSERVATION_COLUMNS),
        ("keys.csv", KEY_COLUMNS),
        ("ionosphere.csv", CORRECTIONS_HEADER.split(",")),
        ("accelerations.csv", ACCELERATION_COLUMNS),
        ("Verdicts", VERDICT_COLUMNS),
        ("Positions as CSV", POSITION_COLUMNS),
    ],
)
def test_every_column_is_explained_in_its_order(section: str, columns: tuple[str, ...]) -> None:
    assert explained(section, "column") == list(columns)


def test_every_key_of_recording_toml_is_explained() -> None:
    assert explained("recording.toml", "key") == list(SCHEMA["properties"])
    assert explained("recording.toml", "key of a band") == list(SCHEMA["$defs"]["_BandTable"]["properties"])
    assert f"`{HEADER}`" in SECTIONS["Navigation pages"]


def test_the_examples_are_read(tmp_path: Path) -> None:
    names = {"receiver.toml": "toml", "ionosphere.csv": "text", "accelerations.csv": "text", "recording.toml": "toml"}
    for name, language in names.items():
        (tmp_path / name).write_text(block(name, language))
    for name in ("L1.bin", "L6.bin", "observations.csv"):
        (tmp_path / name).write_bytes(b"")
    assert set(read_recording_toml(tmp_path / "recording.toml").bands) == set(Band)
    assert read_hardware_bias(tmp_path / "receiver.toml") < 0
    assert read_ionosphere(tmp_path / "ionosphere.csv") == {11: 3.2}
    assert read_accelerations(tmp_path / "accelerations.csv").elapsed_s.size == 2
    parser = CsvParser(tmp_path / "observations.csv")
    for number, line in enumerate(block("observations.csv", "text").splitlines(), start=1):
        parser.take(number, line)
    epoch = parser.finish()
    assert epoch is not None
    assert set(epoch.observations) == {3}
    assert block("keys.csv", "text").splitlines()[2].split(",") == list(KEY_COLUMNS)


def test_the_schema_takes_the_example_and_refuses_what_the_reader_refuses() -> None:
    example = tomllib.loads(block("recording.toml", "toml"))
    validator = jsonschema.Draft202012Validator(SCHEMA)
    validator.check_schema(SCHEMA)
    assert validator.is_valid(example)
    for wrong in (
        {"sample_rate": 12e6},
        {"sample_rate_hz": -1.0},
        {"time_uncertainty_s": "1 s"},
        {"e1": example["e1"] | {"format": "int12"}},
        {"e6": {key: value for key, value in example["e6"].items() if key != "layout"}},
    ):
        assert not validator.is_valid(example | wrong), wrong
