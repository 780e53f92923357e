from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from vestige.campaign.store import open_results
from vestige.cli.run import command
from vestige.errors import InputFileError, VestigeError

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
QUICK = SCENARIOS / "quick.toml"


def _invoke(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments], standalone_mode=False)


def test_text_and_json_say_the_same(tmp_path: Path) -> None:
    text = _invoke(QUICK, "-o", tmp_path / "a", "--set", "epochs=3000")
    assert text.exception is None
    found = json.loads(_invoke(QUICK, "-o", tmp_path / "a", "--set", "epochs=3000", "--json").stdout)
    misses = found["detectors"]["early"]["misses"]
    assert f"early    detector: {misses} missed" in text.stdout
    assert found["p_d_theory"] == pytest.approx(0.99999565, abs=1e-8)


def test_json_when_nothing_is_detected(tmp_path: Path) -> None:
    settings = ("--set", "epochs=50", "--set", "receiver.cn0_dbhz=0")
    found = json.loads(_invoke(QUICK, "-o", tmp_path / "a", *settings, "--json").stdout)
    assert found["detectors"]["early"]["range_offset_mean_m"] is None


def test_samples_and_workers(tmp_path: Path) -> None:
    settings = ("--set", "epochs=60", "--fidelity", "samples")
    for name, workers in (("one", ()), ("two", ("-j", 2, "--threads"))):
        result = _invoke(QUICK, "-o", tmp_path / name, *settings, *workers)
        assert result.exception is None
    one, two = (open_results(tmp_path / name) for name in ("one", "two"))
    for variable in one.data_vars:
        assert np.array_equal(one[variable].values, two[variable].values, equal_nan=one[variable].dtype.kind in "fc")


def test_a_store_of_another_scenario_is_refused(tmp_path: Path) -> None:
    assert _invoke(QUICK, "-o", tmp_path / "a", "--set", "epochs=100").exception is None
    other = _invoke(QUICK, "-o", tmp_path / "a", "--set", "epochs=100", "--set", "seed=2")
    assert isinstance(other.exception, VestigeError)


def test_a_recording_is_no_campaign(tmp_path: Path) -> None:
    result = _invoke(SCENARIOS / "first_light.toml", "-o", tmp_path / "a")
    assert isinstance(result.exception, VestigeError)
    assert not (tmp_path / "a").exists()


def test_bad_settings(tmp_path: Path) -> None:
    assert isinstance(_invoke(QUICK, "-o", tmp_path / "a", "--set", "epochs=-1").exception, InputFileError)
