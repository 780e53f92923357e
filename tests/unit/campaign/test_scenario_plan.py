"""A scenario gives the same bits whatever the workers, the chunks and the interruptions, at both fidelities.

`test_run.py`, `test_cluster.py` and `test_interruption.py` hold the machinery with a toy; here real epochs go through.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from vestige.acas_processor.detectors import DETECTORS
from vestige.campaign.execution.cluster import connect
from vestige.campaign.run import RunProgress, run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import summarise
from vestige.campaign.store.results import open_results
from vestige.records import Status
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.theory.thresholds import threshold

distributed = pytest.importorskip("distributed", reason="needs the optional extra `distributed`")

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"
N_EPOCHS = {"samples": 150, "correlators": 1200}  # the latter: more than two blocks of draws
FIDELITIES = pytest.mark.parametrize("fidelity", N_EPOCHS)


def plan(fidelity: str, *settings: str, epochs: int | None = None) -> ScenarioPlan:
    own = (f'fidelity="{fidelity}"', f"epochs={epochs or N_EPOCHS[fidelity]}", *settings)
    scenario = load_scenario(SCENARIOS / "harsh.toml", own)
    assert isinstance(scenario, CampaignScenario)
    return ScenarioPlan(scenario=scenario)


def columns_of(whole: ScenarioPlan) -> dict[str, np.ndarray]:
    """Return the columns of every epoch, measured and judged in one call each, without any of the machinery."""
    _, columns = whole.judge(None, 0, whole.measure(0, whole.prepare().advance(0, whole.n_epochs)))
    return dict(columns)


@pytest.fixture(scope="module")
def truth() -> dict[str, dict[str, np.ndarray]]:
    """The columns of every epoch at both fidelities."""
    return {fidelity: columns_of(plan(fidelity)) for fidelity in N_EPOCHS}


def assert_equal(results: xarray.Dataset, expected: dict[str, np.ndarray]) -> None:
    assert set(results.data_vars) == set(expected)
    for name, values in expected.items():
        assert results[name].values.tobytes() == values.tobytes(), name


@FIDELITIES
@pytest.mark.parametrize("chunk", [1 / 3, 0.29, 2])
def test_any_chunks(tmp_path: Path, truth: Any, fidelity: str, chunk: float) -> None:
    chunk_epochs = int(chunk * N_EPOCHS[fidelity])
    assert_equal(run(plan(fidelity), tmp_path / "a", chunk_epochs=chunk_epochs), truth[fidelity])


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_two_workers(tmp_path: Path, truth: Any, executor: Any) -> None:
    for fidelity, n_epochs in N_EPOCHS.items():
        path = tmp_path / fidelity
        results = run(plan(fidelity), path, chunk_epochs=n_epochs // 7, workers=2, executor=executor)
        assert_equal(results, truth[fidelity])


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", protocol="tcp", silence_logs="CRITICAL"
    ) as cluster:
        yield cluster.scheduler_address


# dask leaves sockets and log lines behind when its processes are killed
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_cluster_of_which_a_worker_is_killed(tmp_path: Path, truth: Any, scheduler: str) -> None:
    killed: list[int] = []
    with connect(scheduler) as cluster:

        def kill(progress: RunProgress) -> None:
            if progress.epochs_done and not killed:
                killed.append(cluster.submit(os.getpid).result())
                os.kill(killed[0], signal.SIGKILL)

        how: dict[str, Any] = {"executor": cluster, "workers": cluster.workers}
        assert_equal(run(plan("samples"), tmp_path / "a", chunk_epochs=10, progress=kill, **how), truth["samples"])
        assert_equal(run(plan("correlators"), tmp_path / "b", chunk_epochs=170, **how), truth["correlators"])
    assert killed


@pytest.mark.slow
def test_kill_of_the_command_at_a_random_moment(tmp_path: Path, truth: Any) -> None:
    """Of a longer run, so that there is time to kill; the epochs above are its beginning, bit for bit."""
    more = 4 * N_EPOCHS["samples"]
    command = [
        *(sys.executable, "-m", "vestige.cli.main", "run", SCENARIOS / "harsh.toml", "-o", tmp_path / "a"),
        *("--set", f"epochs={more}", "--chunk", "25", "-j", "2"),
    ]
    delay_s = random.SystemRandom().uniform(0, 0.25)
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:  # noqa: S603
        while not (tmp_path / "a" / "progress" / "digest" / "c").exists():
            assert process.poll() is None
            time.sleep(0.01)
        time.sleep(delay_s)
        process.kill()
    assert process.returncode == -signal.SIGKILL, f"not killed after {delay_s} s"
    kept = open_results(tmp_path / "a", partial=True).dataset.sizes["epoch"]
    assert kept < more
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)  # noqa: S603
    results = open_results(tmp_path / "a").dataset
    first = results.isel(epoch=slice(0, N_EPOCHS["samples"]))
    assert_equal(first, truth["samples"])
    whole = plan("samples", epochs=more)
    preparation = whole.prepare()
    preparation.advance(0, more - 20)
    last = whole.measure(more - 20, preparation.advance(more - 20, 20))
    assert_equal(results.isel(epoch=slice(more - 20, more))[list(last)], dict(last))
    _, judged = whole.judge(None, 0, {name: results[name].values for name in last})
    assert_equal(results, dict(judged))


@FIDELITIES
def test_without_signal_the_noise_stays(fidelity: str) -> None:
    """The taps differ from those with a signal, their noise floor by the signal's own share only."""
    epochs = 40
    silent, loud = (plan(fidelity, f"receiver.signal={on}", epochs=epochs) for on in ("false", "true"))
    quiet, full = columns_of(silent), columns_of(loud)
    sigma = np.sqrt(quiet["noise_power"] / 2)[..., None]
    assert np.abs(quiet["taps"] / sigma).max() < 6  # 440 Rayleigh magnitudes: 7e-6
    assert np.abs(full["taps"] / np.sqrt(full["noise_power"] / 2)[..., None]).max(axis=-1).min() > 5
    assert np.all(quiet["tap_index"] == -1)
    assert "cn0_dbhz" not in silent.attrs


def test_both_detectors_decide_on_equal_banks() -> None:
    """The columns are what the detectors say, in the order of the coordinate."""
    one = plan("correlators", "receiver.cn0_dbhz=28", epochs=300)
    results = columns_of(one)
    magnitudes = np.abs(results["taps"][:, 0]) / np.sqrt(results["noise_power"] / 2)
    assert list(one.coords["detector"].values) == list(DETECTORS)
    for index, detector in enumerate(DETECTORS.values()):
        expected = detector(spacing=1).detect(magnitudes.astype(float), float(threshold(1e-7)))
        assert np.array_equal(results["tap_index"][index, :, 0], expected)


@pytest.mark.parametrize("fidelity", ["samples", "correlators"])
def test_what_cannot_be_decrypted_is_not_available(fidelity: str) -> None:
    """An attack that keeps keys away, too weak to be seen in the C/N0 of E1: no alarm follows from it."""
    denial = 'attack=[{kind = "osnma-denial", j_over_n_db = -20.0, start_s = 60}]'
    denied = plan(fidelity, denial, "interval_s=30.0", epochs=6)
    results = columns_of(denied)
    lost = np.isnan(results["noise_power"][:, 0])
    np.testing.assert_array_equal(lost[3:], True)
    status = np.array(list(Status))[results["status"][:, 0]]
    assert set(status[lost]) == {Status.NOT_AVAILABLE}
    assert Status.NOT_AVAILABLE not in status[~lost]


@pytest.mark.parametrize(("key_delay", "time_uncertainty_s", "first_lost"), [(0, 1.0, 21), (1, 40.0, 12), (0, 3600, 0)])
def test_what_was_not_provably_received_before_disclosure_is_not_available(
    key_delay: int, time_uncertainty_s: float, first_lost: int
) -> None:
    """The key is on air from 22 s of its subframe on: from `first_lost` on, no epoch of a subframe can be decided.

    A RECS is received 16 ms and its travel time, here none, after it was sent.
    """
    settings = (f"recs.key_delay={key_delay}", f"receiver.time_uncertainty_s={time_uncertainty_s}")
    lost = np.arange(60) % 30 >= first_lost
    for fidelity in N_EPOCHS:
        one = plan(fidelity, *settings, epochs=60)
        measured = columns_of(one)
        status = [list(Status)[place] for place in measured["status"].ravel()]
        assert [place is Status.NOT_AVAILABLE for place in status] == lost.tolist(), fidelity
        assert np.array_equal(np.isnan(measured["noise_power"]).ravel(), lost)
        assert np.array_equal(np.isnan(measured["taps"]).all(axis=(1, 2)), lost)
        assert not (measured["tap_index"][:, lost] >= 0).any()
        results = xarray.Dataset({name: (one.columns[name].dims, values) for name, values in measured.items()})
        summary = summarise(results.assign_coords(detector=list(DETECTORS)))
        assert summary.detections.trials == np.count_nonzero(~lost)
        assert summary.misses == 0
