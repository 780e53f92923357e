"""A local dask cluster of worker processes: the same bits, also when workers are killed."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from pathlib import Path
from typing import Any

import pytest

from toy_plan import DeadlyPlan, ToyPlan
from vestige.campaign.execution.cluster import ClusterExecutor, connect
from vestige.campaign.run import RunProgress, run
from vestige.errors import UnsupportedError, VestigeError

distributed = pytest.importorskip("distributed", reason="needs the optional extra `distributed`")

# dask leaves sockets and log lines behind when its processes are killed
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")

QUICK = Path(__file__).resolve().parents[3] / "scenarios" / "quick.toml"
PLAN = ToyPlan(n_epochs=300)
TRUTH = PLAN.measure(0, PLAN.prepare().advance(0, 300))


def started(**options: Any) -> Any:
    return distributed.LocalCluster(
        threads_per_worker=1, dashboard_address=":0", protocol="tcp", silence_logs="CRITICAL", **options
    )


@pytest.fixture(scope="module")
def local_cluster() -> Iterator[Any]:
    with started(processes=True, n_workers=2) as cluster:
        yield cluster


@pytest.fixture
def cluster(local_cluster: Any) -> Iterator[ClusterExecutor]:
    with connect(local_cluster.scheduler_address) as executor:
        yield executor


def assert_right(results: Any) -> None:
    for name, values in TRUTH.items():
        assert results[name].values.tobytes() == values.tobytes(), name


@pytest.mark.slow
def test_the_same_bits(tmp_path: Path, cluster: ClusterExecutor) -> None:
    assert cluster.workers == 2
    assert_right(run(PLAN, tmp_path / "a.zarr", chunk_epochs=20, executor=cluster, workers=cluster.workers))


@pytest.mark.slow
def test_a_worker_that_is_killed_loses_nothing(tmp_path: Path, cluster: ClusterExecutor) -> None:
    killed: list[int] = []

    def kill(progress: RunProgress) -> None:
        if progress.epochs_done >= 60 and not killed:
            killed.append(cluster.submit(os.getpid).result())
            os.kill(killed[0], signal.SIGKILL)

    slow = ToyPlan(n_epochs=300, pause_s=1e-3)
    assert_right(run(slow, tmp_path / "a.zarr", chunk_epochs=20, executor=cluster, workers=2, progress=kill))
    assert killed


@pytest.mark.slow
def test_a_chunk_that_kills_every_worker(tmp_path: Path, local_cluster: Any, cluster: ClusterExecutor) -> None:
    local_cluster.scheduler.allowed_failures = 0
    deadly = DeadlyPlan(n_epochs=300, deadly_epoch=100)
    with pytest.raises(VestigeError, match=r"workers were lost .* of 300 epochs are stored"):
        run(deadly, tmp_path / "a.zarr", chunk_epochs=50, executor=cluster)
    assert_right(run(PLAN, tmp_path / "a.zarr", executor=cluster))


@pytest.mark.slow
def test_an_error_of_the_plan_is_raised_here(cluster: ClusterExecutor) -> None:
    with pytest.raises(ValueError, match="invalid literal"):
        cluster.submit(int, "seven").result()


@pytest.mark.slow
def test_a_scheduler_that_goes_away(tmp_path: Path) -> None:
    slow = ToyPlan(n_epochs=300, pause_s=1e-3)
    with started(processes=False, n_workers=1) as other, connect(other.scheduler_address) as executor:

        def leave(progress: RunProgress) -> None:
            if progress.epochs_done == 60:
                other.close()

        with pytest.raises(VestigeError, match="workers were lost"):
            run(slow, tmp_path / "a.zarr", chunk_epochs=20, executor=executor, progress=leave)
    assert_right(run(PLAN, tmp_path / "a.zarr"))


@pytest.mark.slow
def test_a_scheduler_that_went_away_before_a_call(tmp_path: Path) -> None:
    with started(processes=False, n_workers=1) as other, connect(other.scheduler_address) as executor:
        executor._client.close()
        with pytest.raises(BrokenExecutor, match=f"^{other.scheduler_address}: the dask scheduler does not answer$"):
            executor.submit(os.getpid)


@pytest.mark.slow
def test_a_dead_scheduler_is_one_line(tmp_path: Path) -> None:
    """Of `threats`, too; dask and asyncio say nothing of their own."""
    script = (
        "import sys\n"
        "from distributed import LocalCluster\n"
        "from vestige.cli.campaigns import threats\n"
        "from vestige.cli.main import main\n"
        "import vestige.threats.matrix as matrix\n"
        "if __name__ == '__main__':\n"
        "    cluster = LocalCluster(n_workers=1, processes=False, dashboard_address=':0', protocol='tcp')\n"
        "    submitted = matrix.measure_threats\n"
        "    def measured(*arguments, **options):\n"
        "        cluster.close()\n"
        "        return submitted(*arguments, **options)\n"
        "    matrix.measure_threats = measured\n"
        "    main(['threats', '--only', 'A1', '--seeds', '1', '-o', sys.argv[1], '--scheduler',"
        " cluster.scheduler_address])\n"
    )
    (tmp_path / "script.py").write_text(script)
    command = [sys.executable, str(tmp_path / "script.py"), str(tmp_path / "out")]
    found = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)  # noqa: S603
    lines = [line for line in found.stderr.splitlines() if "attacked runs" not in line]
    assert found.returncode == 1
    assert len(lines) == 1, found.stderr
    assert lines[0].startswith("vestige: workers were lost (tcp://")
    assert "the dask scheduler does not answer); the results so far are stored in" in lines[0]


@pytest.mark.slow
def test_no_workers_left_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vestige.campaign.execution.cluster.NO_WORKERS_S", 0.1)
    monkeypatch.setattr("vestige.campaign.execution.cluster.LOOK_EVERY_S", 0.02)
    told: list[str] = []
    with started(processes=False, n_workers=1) as other:
        with connect(other.scheduler_address, warn=told.append) as executor:
            assert executor.submit(int, "7").result() == 7
            other.scale(0)
            _wait(lambda: told)
            waiting = executor.submit(int, "8")
            other.scale(1)
            assert waiting.result(timeout=60) == 8
            _wait(lambda: len(told) == 2)
        assert told == [
            f"{other.scheduler_address}: the dask cluster has no workers left; waiting for new ones",
            f"{other.scheduler_address}: the dask cluster has workers again: 1",
        ]


def _wait(condition: Callable[[], object]) -> None:
    end = time.monotonic() + 60
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    assert condition()


def test_no_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vestige.campaign.execution.cluster.CONNECT_S", 0.2)
    for address in ("tcp://127.0.0.1:9", "tcp://[::1]:9", f"tcp://{'a' * 70}:9"):
        with pytest.raises(VestigeError, match=rf"^{re.escape(address)}: no dask scheduler answers"):
            connect(address)


@pytest.mark.parametrize(
    "address", ["", "foo", "tcp://", "tcp://host", "tcp://host:port", "http://host:1", "tcp://h:99999"]
)
def test_no_address(address: str) -> None:
    with pytest.raises(VestigeError, match=f"found '{address}', expected an address such as tcp://host:8786"):
        connect(address)


@pytest.mark.slow
def test_no_traceback_after_the_line(tmp_path: Path) -> None:
    arguments = ["run", str(QUICK), "-o", str(tmp_path / "a"), "--scheduler", "tcp://127.0.0.1:9"]
    command = [sys.executable, "-m", "vestige", *arguments]
    found = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)  # noqa: S603
    assert found.returncode == 1
    (line,) = found.stderr.splitlines()
    assert "no dask scheduler answers" in line


@pytest.mark.slow
def test_no_workers() -> None:
    with started(processes=False, n_workers=0) as empty, pytest.raises(VestigeError, match="no workers"):
        connect(empty.scheduler_address)


def test_distributed_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UnsupportedError, match=r"pip install 'vestige\[distributed\]'"):
        connect("tcp://127.0.0.1:9")
