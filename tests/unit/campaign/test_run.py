"""The same bits whatever the workers, the chunks and the interruptions."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from toy_plan import DeadlyPlan, ToyPlan
from vestige.campaign.execution.executors import local_executor
from vestige.campaign.plan import Coord
from vestige.campaign.run import IN_FLIGHT, RunProgress, measure_chunks, run
from vestige.campaign.store.results import open_results
from vestige.errors import InputFileError, VestigeError

PLAN = ToyPlan(n_epochs=230)
TRUTH = PLAN.measure(0, PLAN.prepare().advance(0, 230))


def assert_right(results: xarray.Dataset) -> None:
    assert set(results.data_vars) == set(TRUTH)
    for name, values in TRUTH.items():
        assert results[name].dtype == values.dtype
        assert results[name].values.tobytes() == values.tobytes(), name


def test_an_epoch_a_chunk(tmp_path: Path) -> None:
    plan = ToyPlan(n_epochs=30)
    expected = plan.measure(0, plan.prepare().advance(0, 30))
    results = run(plan, tmp_path / "a.zarr", chunk_epochs=1)
    assert {name: results[name].values.tobytes() for name in results.data_vars} == {
        name: values.tobytes() for name, values in expected.items()
    }


# 230 chunks of an epoch take seconds; 30 of them are in the test above
@pytest.mark.parametrize("chunk_epochs", [pytest.param(1, marks=pytest.mark.slow), 7, 100, 230, 5000])
def test_any_chunks(tmp_path: Path, chunk_epochs: int) -> None:
    assert_right(run(PLAN, tmp_path / "a.zarr", chunk_epochs=chunk_epochs))


@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_any_workers(tmp_path: Path, executor: Any) -> None:
    assert_right(run(PLAN, tmp_path / "a.zarr", chunk_epochs=20, workers=2, executor=executor))


def test_an_axis_without_places(tmp_path: Path) -> None:
    """Without multipath there are no rays; the axis stays."""

    @dataclass(frozen=True, kw_only=True)
    class NoTaps(ToyPlan):
        @property
        def coords(self) -> Mapping[str, Coord]:
            return {**super().coords, "tap_offset_m": Coord(dim="tap", values=np.zeros(0), units="m", long_name="none")}

        def measure(self, first: int, inputs: Mapping[str, Any]) -> dict[str, np.ndarray]:
            results = super().measure(first, inputs)
            return results | {"taps": results["taps"][..., :0]}

    for _ in range(2):
        assert run(NoTaps(n_epochs=230), tmp_path / "a.zarr", chunk_epochs=100)["taps"].shape == (230, 2, 0)


def test_an_executor_of_one_s_own_is_left_open(tmp_path: Path) -> None:
    with ThreadPoolExecutor(2) as pool:
        assert_right(run(PLAN, tmp_path / "a.zarr", chunk_epochs=20, workers=2, executor=pool))
        assert pool.submit(int, "7").result() == 7


def test_files_are_equal_too(tmp_path: Path) -> None:
    for name, workers in (("a", 1), ("b", 2)):
        run(PLAN, tmp_path / name, chunk_epochs=50, workers=workers)
    first, second = (
        {p.relative_to(root): p.read_bytes() for p in root.rglob("*") if p.is_file()}
        for root in (tmp_path / "a", tmp_path / "b")
    )
    assert first == second


def test_a_finished_run_is_not_run_again(tmp_path: Path) -> None:
    @dataclass(frozen=True, kw_only=True)
    class Idle(ToyPlan):
        def prepare(self) -> Any:
            raise AssertionError("nothing is left to do")

    run(PLAN, tmp_path / "a.zarr")
    seen: list[RunProgress] = []
    assert_right(run(Idle(n_epochs=230), tmp_path / "a.zarr", progress=seen.append))
    assert [(one.epochs_done, one.epochs_resumed, one.remaining_s) for one in seen] == [(230, 230, 0.0)]


@pytest.mark.parametrize("lost", [(0,), (3, 5), (22, 0, 10)])
def test_only_what_is_missing_is_measured(tmp_path: Path, lost: tuple[int, ...]) -> None:
    measured = []

    @dataclass(frozen=True, kw_only=True)
    class Watched(ToyPlan):
        def measure(self, first: int, inputs: Mapping[str, Any]) -> dict[str, np.ndarray]:
            measured.append(first)
            return super().measure(first, inputs)

    run(PLAN, tmp_path / "a.zarr", chunk_epochs=10)
    for chunk in lost:
        (tmp_path / f"a.zarr/taps/c/{chunk}/0/0").write_bytes(b"torn")
        if chunk % 2:
            (tmp_path / f"a.zarr/progress/digest/c/{chunk}").unlink()
    assert_right(run(Watched(n_epochs=230), tmp_path / "a.zarr", chunk_epochs=77))
    assert measured == [10 * chunk for chunk in sorted(lost)]


def test_other_work_is_refused(tmp_path: Path) -> None:
    run(PLAN, tmp_path / "a.zarr")
    with pytest.raises(InputFileError, match="seed: found 1, expected 3"):
        run(ToyPlan(n_epochs=230, seed=3), tmp_path / "a.zarr")
    assert_right(open_results(tmp_path / "a.zarr").dataset)


def test_progress(tmp_path: Path) -> None:
    seen: list[RunProgress] = []
    run(PLAN, tmp_path / "a.zarr", chunk_epochs=100, progress=seen.append)
    assert [one.epochs_done for one in seen] == [0, 100, 200, 230]
    assert all(a.elapsed_s <= b.elapsed_s for a, b in pairwise(seen))
    assert np.isnan(seen[0].rate_epochs_per_s)
    assert np.isnan(seen[0].remaining_s)
    half = RunProgress(epochs_done=300, epochs_total=500, epochs_resumed=100, elapsed_s=4.0)
    assert (half.rate_epochs_per_s, half.remaining_s) == (50.0, 4.0)


def test_few_chunks_are_in_flight(tmp_path: Path) -> None:
    """Memory does not grow with the length of the run: what was handed out and is not written yet is bounded."""
    open_calls, most = 0, 0

    class Counting(Executor):
        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            nonlocal open_calls, most
            open_calls += 1
            most = max(most, open_calls)
            future: Future[Any] = Future()
            future.set_result(fn(*args, **kwargs))
            return future

    def written(progress: RunProgress) -> None:
        nonlocal open_calls
        open_calls -= 1 if progress.epochs_done else 0

    run(PLAN, tmp_path / "a.zarr", chunk_epochs=2, workers=4, executor=Counting(), progress=written)
    assert most == 4 * IN_FLIGHT + 1
    assert open_calls == 0


def test_chunks_come_in_order_and_may_be_left() -> None:
    chunks = measure_chunks(PLAN, chunk_epochs=10, workers=2)
    assert [next(chunks)[0] for _ in range(4)] == [0, 1, 2, 3]
    before = threading.active_count()
    chunks.close()
    assert threading.active_count() < before


def test_a_plan_that_breaks_its_promise(tmp_path: Path) -> None:
    @dataclass(frozen=True, kw_only=True)
    class Wrong(ToyPlan):
        def measure(self, first: int, inputs: Mapping[str, Any]) -> dict[str, np.ndarray]:
            results = super().measure(first, inputs)
            return results if first < 100 else results | {"time_s": results["time_s"].astype(np.float32)}

    with pytest.raises(ValueError, match=r"time_s as .*float32") as caught:
        run(Wrong(n_epochs=230), tmp_path / "a.zarr", chunk_epochs=50)
    assert caught.value.__notes__ == [
        f"100 of 230 epochs are stored in {tmp_path / 'a.zarr'}; the same command continues there"
    ]
    assert_right(run(PLAN, tmp_path / "a.zarr"))


def test_a_worker_process_that_is_killed(tmp_path: Path) -> None:
    deadly = DeadlyPlan(n_epochs=230, deadly_epoch=100)
    with pytest.raises(VestigeError, match=r"workers were lost .* of 230 epochs are stored"):
        run(deadly, tmp_path / "a.zarr", chunk_epochs=50, executor="processes")
    assert_right(run(PLAN, tmp_path / "a.zarr"))


def test_a_worker_of_another_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vestige.campaign.execution.executors.build_id", lambda _: {"vestige_version": "9.9"})
    with pytest.raises(VestigeError, match=r"vestige_version: found 9\.9, expected "):
        run(PLAN, tmp_path / "a.zarr")


@pytest.mark.parametrize("name", ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"])
def test_worker_processes_have_one_thread_each(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(name, "7")
    with local_executor("processes", 1) as pool:
        assert pool.submit(os.getenv, name).result() == "1"
    assert os.environ[name] == "7"


def test_worker_processes_leave_ctrl_c_to_the_coordinator() -> None:
    with local_executor("processes", 1) as pool:
        assert pool.submit(signal.getsignal, signal.SIGINT).result() == signal.SIG_IGN


def test_what_is_no_executor(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="fibres"), local_executor("fibres", 1):
        pass
    with pytest.raises(ValueError, match="0 workers"):
        run(PLAN, tmp_path / "a.zarr", workers=0)
