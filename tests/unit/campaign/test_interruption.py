"""A run that is stopped, in whatever way and whenever, is ended by the same call, with the same bits."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from toy_plan import ToyPlan
from vestige.campaign.run import run
from vestige.campaign.store.results import open_results

N_EPOCHS, CHUNK_EPOCHS, PAUSE_S = 400, 10, 0.01  # 2 s on two workers
PLAN = ToyPlan(n_epochs=N_EPOCHS)
TRUTH = PLAN.measure(0, PLAN.prepare().advance(0, N_EPOCHS))
TESTS = Path(__file__).resolve().parents[2]

# the pauses make no difference to the results, so they are no part of what identifies the work
PROGRAM = f"""
import os, sys
sys.path.insert(0, {str(TESTS)!r})
from toy_plan import ToyPlan
from vestige.campaign.run import run

def report(progress):
    print(progress.epochs_done, flush=True)

if __name__ == "__main__":
    print("workers start", flush=True)
    plan = ToyPlan(n_epochs={N_EPOCHS}, pause_s={PAUSE_S})
    run(plan, sys.argv[1], chunk_epochs={CHUNK_EPOCHS}, workers=2, executor=sys.argv[2], progress=report)
"""


def start(folder: Path, executor: str) -> subprocess.Popen[str]:
    """Start a run in a process group of its own, as a shell does, and wait until its first chunk is stored."""
    script = folder / "program.py"
    script.write_text(PROGRAM)
    process = subprocess.Popen(  # noqa: S603
        [sys.executable, str(script), str(folder / "a.zarr"), executor],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A job in the background of a shell inherits a SIGINT that is ignored; a program at a terminal does not.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
    )
    assert process.stdout is not None
    before = 0
    for line in process.stdout:
        if line.strip().isdigit() and int(line) > before:
            return process
    raise AssertionError("the run did not begin")


def assert_resumes(path: Path) -> None:
    results = run(PLAN, path)
    for name, values in TRUTH.items():
        assert results[name].values.tobytes() == values.tobytes(), name


def group_is_gone(group: int) -> bool:
    """Return whether every process of a group has ended, or waits to be collected."""
    states = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == group:
            states.append(fields[0])
    return all(state == "Z" for state in states)


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_kill_at_a_random_moment(tmp_path: Path, executor: str) -> None:
    delay_s = random.SystemRandom().uniform(0, 0.3)
    with start(tmp_path, executor) as process:
        time.sleep(delay_s)
        process.kill()
        assert process.wait() == -signal.SIGKILL, f"not killed after {delay_s} s"
        finished = open_results(tmp_path / "a.zarr", partial=True).dataset.sizes["epoch"]
        assert 0 < finished < N_EPOCHS
        deadline = time.monotonic() + 10
        while not group_is_gone(process.pid):
            assert time.monotonic() < deadline, "workers outlive the run"
            time.sleep(0.02)
    assert_resumes(tmp_path / "a.zarr")


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_ctrl_c(tmp_path: Path, executor: str) -> None:
    with start(tmp_path, executor) as process:
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=20)
        assert process.returncode == -signal.SIGINT
        assert f"of {N_EPOCHS} epochs are stored in {tmp_path / 'a.zarr'}; the same command continues" in errors
    assert_resumes(tmp_path / "a.zarr")


# Nothing else imports `wave`. The import of `xarray` takes so long that Ctrl-C comes before its end. A process has a
# single server, so each test has a process.
SERVER_PROGRAM = """
import os, signal, sys, time
from vestige.campaign.execution.executors import local_executor

if __name__ == "__main__":
    with local_executor("processes", 2, preload=["wave", "xarray"]) as pool:
        print("started", flush=True)
        if "wait" in sys.argv:
            print(pool.submit(eval, "1").result(), flush=True)
            pool.submit(time.sleep, 60).result()
        loaded = pool.submit(eval, "'wave' in __import__('sys').modules").result()
        threads = pool.submit(os.getenv, "OMP_NUM_THREADS").result()
        print(loaded, threads, pool.submit(signal.getsignal, signal.SIGINT).result().name)
"""


def start_server(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(  # noqa: S603
        [sys.executable, "-c", SERVER_PROGRAM, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
    )


def test_a_worker_has_the_modules_one_thread_and_no_ctrl_c() -> None:
    with start_server() as process:
        found, errors = process.communicate(timeout=60)
    assert found.split("\n")[1] == "True 1 SIG_IGN", errors


def test_server_and_workers_end_with_a_killed_coordinator() -> None:
    with start_server("wait") as process:
        assert process.stdout is not None
        assert [process.stdout.readline() for _ in range(2)] == ["started\n", "1\n"]
        process.kill()
        process.wait()
        deadline = time.monotonic() + 20
        while not group_is_gone(process.pid):
            assert time.monotonic() < deadline, "workers outlive their coordinator"
            time.sleep(0.02)


def test_ctrl_c_ends_all_without_a_word_of_the_server() -> None:
    with start_server("wait") as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "started\n"
        time.sleep(0.2)  # the server has begun to import
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=30)
    assert errors.count("KeyboardInterrupt") == 1, errors  # the coordinator's own
