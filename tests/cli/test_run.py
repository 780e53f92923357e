from __future__ import annotations

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import numpy as np
import pytest
import xarray
from click.testing import CliRunner, Result

from builders import MEACONED
from report_builder import rows_of
from vestige.acas_processor.measurement import Availability
from vestige.campaign.execution.executors import ONE_THREAD
from vestige.campaign.store.results import open_results
from vestige.cli.campaigns.attack_report import attack_lines, attack_values
from vestige.cli.campaigns.plot import command as plot
from vestige.cli.campaigns.run import command
from vestige.errors import InputFileError, VestigeError
from vestige.folder_lock import only_writer
from vestige.records import Status
from vestige.report import run_page

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
    assert found["attack"] == []
    assert "attack" not in text.stdout


def test_json_when_nothing_is_detected(tmp_path: Path) -> None:
    settings = ("--set", "epochs=50", "--set", "receiver.cn0_dbhz=0")
    found = json.loads(_invoke(QUICK, "-o", tmp_path / "a", *settings, "--json").stdout)
    assert found["detectors"]["early"]["range_offset_mean_m"] is None


def test_what_came_of_an_attack(tmp_path: Path) -> None:
    """A lift-off of E6 alone: the early detector comes back, the other does not; text and JSON say the same."""
    arguments = (SCENARIOS / "liftoff_sudden.toml", "-o", tmp_path / "a", "--fidelity", "correlators")
    text = _invoke(*arguments).stdout
    (found,) = json.loads(_invoke(*arguments, "--json").stdout)["attack"]
    early, maximum = found["early"], found["maximum"]
    assert (found["svid"], early["epochs"], early["first_s"], early["e1_captured"]) == (11, 1000, 500.0, 0.0)
    assert 300 < early["time_to_mitigate_s"] < 550
    assert maximum["time_to_mitigate_s"] is None
    assert sum(early["shares"].values()) == pytest.approx(1.0)
    assert maximum["shares"]["SPOOFER"] > 0.4 > early["shares"]["SPOOFER"]
    assert re.search(
        r"early flank of the correlation peak, where outliers cluster: \d+ range offsets between -27 and", text
    )
    assert f"attack on E11: 1000 epochs from 500 s on, first alarm after {early['time_to_detect_s']:g} s" in text
    assert f"it returned to the true signal after {early['time_to_mitigate_s']:g} s and stayed" in text
    assert "it did not return to the true signal for the rest of the attack" in text.splitlines()[-1]


@pytest.mark.parametrize(("level", "after_s", "worst_m", "within_m"), [(1, None, 599.6, 0.5), (2, 0.0, 0.0, 26.5)])
def test_what_is_said_of_an_attack_is_what_the_level_says(
    tmp_path: Path, level: int, after_s: float | None, worst_m: float, within_m: float
) -> None:
    """A loud meaconer of both bands: level 1 uses its delay of 600 m; level 2 sees it and uses the earlier signal."""
    (tmp_path / "loud.toml").write_text(MEACONED)
    arguments = (tmp_path / "loud.toml", "-o", tmp_path / "loud", "--set", f"processor.level={level}")
    (found,) = json.loads(_invoke(*arguments, "--json").stdout)["attack"]
    assert found["early"]["time_to_detect_s"] == after_s
    assert found["early"]["worst_range_m"] == pytest.approx(worst_m, abs=within_m)
    last = _invoke(*arguments).stdout.splitlines()[-3]
    assert ("no alarm" in last) == (after_s is None)


PULLED = (
    "attack=[{kind='lift-off', start_s=30, delay_m={kind='ramp', first=0, last=60, start_s=30, stop_s=250}, "
    "power_db=3, bands=['E1']}]"
)


@pytest.mark.parametrize("level", [1, 2])
def test_a_run_its_page_and_a_sweep_give_one_largest_range_error(tmp_path: Path, level: int) -> None:
    """E1 is pulled by 60 m; ranges of the earlier signal are in use with SPOOFED, and some AUTHENTIC have none."""
    settings = ("epochs=300", "receiver.cn0_dbhz=35", "receiver.cn0_e1_dbhz=35", f"processor.level={level}", PULLED)
    common = [word for setting in settings for word in ("--set", setting)]
    text = _invoke(QUICK, "-o", tmp_path / "a", *common).stdout
    found = json.loads(_invoke(QUICK, "-o", tmp_path / "a", *common, "--json").stdout)
    swept = json.loads(_invoke(QUICK, "-o", tmp_path / "s", *common, "--sweep", "seed=1", "--json").stdout)
    row_m = swept["campaigns"][0]["outcome"]["worst_range_m"]
    results = open_results(tmp_path / "a").dataset.load()
    authentic = results["status"].values == list(Status).index(Status.AUTHENTIC)
    in_use = np.isfinite(results["range_in_use_m"].values)
    assert (authentic & ~in_use).any()
    assert (~authentic & in_use).any()
    by_status_m = np.abs(results["truth_e1_worst_error_m"].values[authentic]).max()
    assert abs(row_m) < by_status_m - 5
    assert found["worst_range_m"] == found["attack"][0]["early"]["worst_range_m"] == row_m
    assert f"largest range error in use {row_m:+.1f} m" in text
    if level > 1:
        assert found["verdicts"]["worst_range_m"] == row_m
    page = run_page(results, "a").html()
    number = f"{row_m:.4g}\N{NO-BREAK SPACE}m"
    assert f"<dt>largest range error in use</dt><dd>{number}" in page
    assert rows_of(page, "Outcome of the attack")["E11, early"][6] == f"{row_m:.4g} m"
    with (tmp_path / "s" / "sweep.csv").open() as file:
        assert float(next(csv.DictReader(file))["worst_range_m"]) == row_m


def test_people_read_of_the_satellites_that_are_aimed_at(tmp_path: Path) -> None:
    """Of two satellites one has the spoofing signal, and both its noise; or both have noise alone."""
    short = ("--set", "epochs=520", "--fidelity", "correlators")
    assert _invoke(SCENARIOS / "liftoff_sudden.toml", "-o", tmp_path / "a", *short).exception is None
    aimed = open_results(tmp_path / "a").dataset.load()
    noise = aimed.assign(truth_spoofed=aimed["truth_spoofed"] & False).assign_coords(svid=("satellite", [12]))
    one = attack_lines(aimed)
    assert [len(one), one[0].split(":")[0]] == [3, "attack on E11"]
    assert attack_lines(xarray.concat([aimed, noise], "satellite", data_vars="minimal")) == one
    both = xarray.concat([noise, noise.assign_coords(svid=("satellite", [13]))], "satellite", data_vars="minimal")
    assert [line.split(":")[0] for line in attack_lines(both)[::3]] == ["attack on E12", "attack on E13"]
    assert [each["svid"] for each in attack_values(both)] == [12, 13]


def test_an_attack_that_leaves_nothing_to_decide(tmp_path: Path) -> None:
    denial = ("--set", 'attack=[{kind="osnma-denial"}]', "--set", "epochs=20")
    text = _invoke(QUICK, "-o", tmp_path / "a", *denial).stdout
    assert "early    detector: no RECS was correlated" in text
    assert "attack on E11: 20 epochs from 0 s on, no alarm; E1 captured in 0 %, no range in use" in text
    assert "nan m" not in text


def test_numeric_libraries_get_one_thread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ONE_THREAD:
        monkeypatch.setenv(name, "7")
    assert _invoke(QUICK, "-o", tmp_path / "a", "--set", "epochs=10").exception is None
    assert {os.environ[name] for name in ONE_THREAD} == {"1"}


def test_without_signal(tmp_path: Path) -> None:
    silent = ("--set", "epochs=500", "--set", "receiver.signal=false", "--set", "processor.p_fa=1e-3")
    text = _invoke(QUICK, "-o", tmp_path / "a", *silent).stdout
    found = json.loads(_invoke(QUICK, "-o", tmp_path / "a", *silent, "--json").stdout)
    assert "no signal" in text
    assert "theory" not in text
    assert (found["cn0_dbhz"], found["p_d_theory"], found["false_alarms"]["trials"]) == (None, None, 1500)


SWEEP = (QUICK, "--set", "epochs=300", "--sweep", "receiver.cn0_dbhz=29:33:2")


def test_a_sweep(tmp_path: Path) -> None:
    text = _invoke(*SWEEP, "-o", tmp_path / "a")
    assert text.exception is None
    rows = json.loads(_invoke(*SWEEP, "-o", tmp_path / "a", "--json", "-j", 2).stdout)["campaigns"]
    assert [row["settings"] for row in rows] == [{"receiver.cn0_dbhz": value} for value in (29, 31, 33)]
    heading, *lines, last = text.stdout.splitlines()
    assert heading.split()[:2] == ["receiver.cn0_dbhz", "counted"]
    assert last == f"table: {tmp_path / 'a' / 'sweep.csv'}"
    for line, row in zip(lines, rows, strict=True):
        found = row["detections"]["early"]
        assert line.split()[1:3] == ["300", str(300 - found["successes"])]
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == sorted(
        [row["store"] for row in rows] + ["sweep.csv"]
    )


def test_a_sweep_writes_over_nothing_else(tmp_path: Path) -> None:
    alone, swept = tmp_path / "a", tmp_path / "b"
    assert _invoke(QUICK, "-o", alone, "--set", "epochs=5").exception is None
    into_store = _invoke(QUICK, "-o", alone, "--set", "epochs=5", "--sweep", "seed=1,2").exception
    assert str(into_store).startswith(f"{alone}: sweep: found the store of one campaign, expected a folder")
    assert open_results(alone).dataset.sizes["epoch"] == 5
    assert not list(alone.glob("seed*"))
    inside = _invoke(QUICK, "-o", alone / "b", "--set", "epochs=5").exception
    assert str(inside).startswith(f"{alone / 'b'}: output: found a path in the results a, expected")
    assert not (alone / "b").exists()

    assert _invoke(QUICK, "-o", swept, "--sweep", "epochs=5,6").exception is None
    table = (swept / "sweep.csv").read_text()
    assert table.splitlines()[0].startswith("epochs,cn0_dbhz,integration_s,p_fa,epochs_counted,")
    other_keys = _invoke(QUICK, "-o", swept, "--set", "epochs=5", "--sweep", "seed=1,2").exception
    assert "keys: found epochs, expected seed, as in this sweep" in str(other_keys)
    assert (swept / "sweep.csv").read_text() == table
    assert _invoke(QUICK, "-o", swept, "--sweep", "epochs=5,6,7").exception is None


@pytest.mark.parametrize(("width", "epochs"), [("0.2", 100), ("50%", 300)])
def test_a_sweep_ends_early(tmp_path: Path, width: str, epochs: int) -> None:
    """At 33 dBHz nearly all are detected: narrow at once, but not relative to the misses."""
    result = _invoke(*SWEEP, "-o", tmp_path / "a", "--width", width, "--chunk", 100, "--json")
    assert json.loads(result.stdout)["campaigns"][-1]["epochs"] == epochs


@pytest.mark.parametrize(
    "arguments",
    [
        ("--sweep", "receiver.cn0_dbhz=29:99:10"),
        ("--sweep", "receiver.nothing=1,2"),
        ("--sweep", "epochs=1,2", "--set", "epochs=3"),
        ("--sweep", 'fidelity="samples"', "--fidelity", "samples"),
        ("--sweep", "seed=1,2", "--sweep", "seed=3"),
    ],
)
def test_a_bad_sweep_is_refused_before_anything_runs(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    error = _invoke(QUICK, "-o", tmp_path / "a", *arguments).exception
    assert isinstance(error, VestigeError)
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize("width", [("0",), ("-1",), ("nan",), ("%",), ("x",), ("inf%",)])
def test_bad_widths(tmp_path: Path, width: tuple[str]) -> None:
    assert isinstance(_invoke(*SWEEP, "-o", tmp_path / "a", "--width", *width).exception, click.UsageError)


def test_a_width_is_of_a_sweep(tmp_path: Path) -> None:
    assert isinstance(_invoke(QUICK, "-o", tmp_path / "a", "--width", "0.1").exception, click.UsageError)


@pytest.mark.parametrize("local", [("-j", 2), ("--threads",), ("--processes",)])
def test_local_workers_are_not_those_of_a_cluster(tmp_path: Path, local: tuple[str | int, ...]) -> None:
    error = _invoke(QUICK, "-o", tmp_path / "a", "--scheduler", "tcp://127.0.0.1:9", *local).exception
    assert isinstance(error, click.UsageError)


def test_a_store_keeps_its_chunks(tmp_path: Path) -> None:
    arguments = (QUICK, "-o", tmp_path / "a", "--set", "epochs=20")
    assert _invoke(*arguments, "--chunk", 10).stderr == ""
    assert _invoke(*arguments, "--chunk", 10).stderr == ""
    (line,) = _invoke(*arguments, "--chunk", 7).stderr.splitlines()
    assert line == f"warning: {tmp_path / 'a'}: --chunk 7 has no effect: the store was made with chunks of 10 epochs"


def test_curves_of_a_sweep(tmp_path: Path) -> None:
    assert _invoke(*SWEEP, "-o", tmp_path / "a").exception is None
    for kind in ("detection-curve", "miss-curve", "false-alarm-curve"):
        arguments = [kind, str(tmp_path / "a"), "-o", str(tmp_path / f"{kind}.png")]
        assert CliRunner().invoke(plot, [*arguments, "--detector", "maximum"]).exit_code == 0
        assert CliRunner().invoke(plot, [*arguments, "--from", "3"]).exit_code == 2


@pytest.mark.slow
def test_ctrl_c_says_what_is_kept(tmp_path: Path) -> None:
    """One line and exit code 130; the same command goes on."""
    arguments = ["run", str(QUICK), "-o", str(tmp_path / "a"), "--chunk", "50", "--set", "epochs=40000"]
    command = [sys.executable, "-m", "vestige.cli.main", *arguments]
    with subprocess.Popen(  # noqa: S603
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
    ) as process:
        while not (tmp_path / "a" / "progress" / "digest" / "c").exists():
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    (line,) = err.split("\n")[-2:-1]
    kept = open_results(tmp_path / "a", partial=True).dataset.sizes["epoch"]
    expected = f"{kept} of 40000 epochs are stored in {tmp_path / 'a'}; the same command continues there"
    assert line == f"interrupted; {expected}"
    assert err.strip() == line


@pytest.mark.slow
def test_samples_and_workers(tmp_path: Path) -> None:
    settings = ("--set", "epochs=60", "--fidelity", "samples")
    for name, workers in (("one", ()), ("two", ("-j", 2, "--threads"))):
        result = _invoke(QUICK, "-o", tmp_path / name, *settings, *workers)
        assert result.exception is None
    one, two = (open_results(tmp_path / name).dataset for name in ("one", "two"))
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
    for settings in (
        ("--set", "epochs=-1"),
        ("--set", "processor.n_taps=3", "--set", "processor.spacing=2"),
        ("--set", "processor.tap_spacing_m=100", "--fidelity", "samples"),
    ):
        assert isinstance(_invoke(QUICK, "-o", tmp_path / "a", *settings).exception, InputFileError)


def test_a_staircase_is_cautioned_against(tmp_path: Path) -> None:
    rate = ("--set", "receiver.sample_rate_hz=10.23e6", "--set", "epochs=2")
    said = [
        [
            line
            for line in _invoke(QUICK, "-o", tmp_path / fidelity, *rate, "--fidelity", fidelity).stderr.splitlines()
            if line.startswith("warning:")
        ]  # a slow machine also writes its progress
        for fidelity in ("samples", "correlators")
    ]
    assert len(said[0]) == 1
    assert "29.3 m" in said[0][0]
    assert said[1] == []


def test_what_the_front_end_said_is_in_the_results(tmp_path: Path) -> None:
    front_end = ("--set", "receiver.front_end={bits=2}", "--set", "epochs=5")
    for fidelity in ("samples", "correlators"):
        assert _invoke(QUICK, "-o", tmp_path / fidelity, *front_end, "--fidelity", fidelity).exception is None
    samples, drawn = (open_results(tmp_path / fidelity).dataset for fidelity in ("samples", "correlators"))
    assert samples["e6_agc_gain_db"].values == pytest.approx(-samples["e6_total_power_db"].values)
    assert np.abs(samples["e6_total_power_db"].values) == pytest.approx(np.zeros(5), abs=0.05)
    assert samples["e6_saturated"].values.tolist() == [0] * 5
    assert np.all(np.isnan(drawn["e6_total_power_db"].values))
    assert drawn["e6_saturated"].values.tolist() == [-1] * 5


def test_errors_beyond_the_samples_leave_nothing_to_correlate(tmp_path: Path) -> None:
    """E6 is expected 1000 km beside its samples: as of a recording, that is a reason and not the end of the run."""
    bias = ("--set", 'receiver.bias={kind="bias", bgd_sigma_m=1e6}', "--set", "epochs=4")
    result = _invoke(QUICK, "-o", tmp_path / "a", *bias, "--fidelity", "samples", "-j", 2)
    assert result.exception is None
    found = open_results(tmp_path / "a").dataset
    assert (found["availability"].values == Availability.OUTSIDE).all()
    assert (found["status"].values == list(Status).index(Status.NOT_AVAILABLE)).all()


@pytest.mark.parametrize("sweep", [(), ("--sweep", "receiver.cn0_dbhz=33,35")])
def test_one_writer_at_a_time(tmp_path: Path, sweep: tuple[str, ...]) -> None:
    with only_writer(tmp_path / "a"):
        refused = _invoke(QUICK, "-o", tmp_path / "a", "--set", "epochs=5", *sweep).exception
    assert isinstance(refused, InputFileError)
    assert "found another process that writes into it" in str(refused)
    assert _invoke(QUICK, "-o", tmp_path / "a", "--set", "epochs=5", *sweep).exception is None
