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


def test_a_staircase_is_cautioned_against(tmp_path: Path) -> None:
    rate = ("--set", "receiver.sample_rate_hz=10.23e6", "--set", "epochs=2")
    (line,) = _invoke(QUICK, "-o", tmp_path / "a", *rate, "--fidelity", "samples").stderr.splitlines()
    assert "29.3 m" in line
    assert _invoke(QUICK, "-o", tmp_path / "b", *rate).stderr == ""


def test_what_the_front_end_said_is_in_the_results(tmp_path: Path) -> None:
    front_end = ("--set", "receiver.front_end={bits=2}", "--set", "epochs=5")
    for fidelity in ("samples", "correlators"):
        assert _invoke(QUICK, "-o", tmp_path / fidelity, *front_end, "--fidelity", fidelity).exception is None
    samples, drawn = (open_results(tmp_path / fidelity) for fidelity in ("samples", "correlators"))
    assert samples["e6_agc_gain_db"].values == pytest.approx(-samples["e6_total_power_db"].values)
    assert np.abs(samples["e6_total_power_db"].values) == pytest.approx(np.zeros(5), abs=0.05)
    assert samples["e6_saturated"].values.tolist() == [0] * 5
    assert np.all(np.isnan(drawn["e6_total_power_db"].values))
    assert drawn["e6_saturated"].values.tolist() == [-1] * 5


def test_errors_beyond_the_samples_end_the_run_with_one_line(tmp_path: Path) -> None:
    bias = ("--set", 'receiver.bias={kind="bias", bgd_sigma_m=1e6}', "--set", "epochs=4")
    result = _invoke(QUICK, "-o", tmp_path / "a", *bias, "--fidelity", "samples", "-j", 2)
    assert isinstance(result.exception, VestigeError)
