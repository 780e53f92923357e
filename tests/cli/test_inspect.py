from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from vestige.cli.recordings.inspect import command
from vestige.errors import InputFileError

TOML = """
start = "2021-11-25T00:40:00 UTC"
time_uncertainty_s = 1.0
sample_rate_hz = 12e6
[e6]
file = "l6.bin"
format = "int8"
layout = "iq"
center_frequency_hz = 1278.75e6
spectral_inversion = true
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "l6.bin").write_bytes(bytes([1, 3, 255, 253]) * 600)
    (tmp_path / "recording.toml").write_text(TOML)
    (tmp_path / "log.csv").write_text("gst_week,gst_second,svid,pseudorange_m\n1161,348018,5,2.4e7\n")
    return tmp_path


def run(*arguments: str) -> Result:
    return CliRunner().invoke(command, arguments, catch_exceptions=False, standalone_mode=False)


def test_text(folder: Path) -> None:
    (folder / "recording.toml").write_text(TOML + '[observations]\nfile = "log.csv"\n')
    result = run(str(folder))
    assert result.exit_code == 0
    for text in (
        "recording described by recording.toml, clock right to ±1 s",
        "E6  l6.bin: int8 I,Q, 12 Msps, 0.0001 s",
        "2021-11-25T00:40:18.000 GST",
        "0 Hz is 1278.75 MHz, spectrum inverted",
        "4 distinct values, 50.00% at ±3, rms 2.236",
        "E1 observations  log.csv: CSV, 1 epochs",
        "satellites 5",
        "missing for ACAS",
    ):
        assert text in result.stdout


def test_json_is_one_object(folder: Path) -> None:
    result = run(str(folder), "--json")
    found = json.loads(result.stdout)
    assert found["bands"]["E6"]["n_samples"] == 1200
    assert found["bands"]["E6"]["start_gst"] == "1161:348018"
    assert found["bands"]["E6"]["spectral_inversion"] is True
    assert found["time_uncertainty_s"] == 1.0
    assert found["missing"][0].startswith("no E1")


def test_what_is_not_stated_is_null(folder: Path) -> None:
    (folder / "recording.toml").write_text(TOML.replace("time_uncertainty_s = 1.0", "").replace("start", "#"))
    found = json.loads(run(str(folder), "--json").stdout)
    assert found["time_uncertainty_s"] is found["bands"]["E6"]["start"] is None
    found = json.loads(run(str(folder), "--json", "--start", "1200:5.5", "--time-uncertainty", "2").stdout)
    assert (found["time_uncertainty_s"], found["bands"]["E6"]["start_gst"]) == (2.0, "1200:5.5")


def test_bad_files_and_options_are_errors(folder: Path) -> None:
    with pytest.raises(InputFileError):
        run(str(folder / "l6.bin"))
    assert CliRunner().invoke(command, [str(folder), "--start", "noon"]).exit_code == 2
    assert CliRunner().invoke(command, [str(folder), "--start", "9999-12-31T23:59:59"]).exit_code == 2
