"""Start and end the local workers of a campaign, and define the function that each worker runs.

Every worker process imports this module, so the module imports no large packages.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.forkserver
import os
import platform
import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import wait
from typing import TYPE_CHECKING, Any

from vestige.campaign.store.build_id import build_id
from vestige.errors import VestigeError

if TYPE_CHECKING:
    import numpy as np

    from vestige.campaign.plan import Plan

# Chunks of a campaign are measured in parallel. Libraries that start their own threads would slow the workers down.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def measure_chunk(
    plan: Plan, first: int, inputs: Mapping[str, Any], expected: Mapping[str, str]
) -> Mapping[str, np.ndarray]:
    """Return the result of `plan.measure`, if this worker has the `expected` build_id.

    `VestigeError` is raised if the worker has another build_id, because its results may differ in some bits.
    """
    found = build_id(plan)
    for name, value in expected.items():
        if found.get(name) != value:
            raise VestigeError(f"worker {platform.node()}: {name}: found {found.get(name)}, expected {value}")
    return plan.measure(first, inputs)


@contextmanager
def local_executor(kind: str, workers: int, preload: Sequence[str] = ()) -> Iterator[Executor]:
    """Yield an executor with `workers` threads or processes; the exit of the context waits for running calls.

    Without `preload`, processes are started with `spawn`, because a fork of a process with threads may inherit a locked
    lock. If `preload` names modules, a server process without threads imports these modules while the caller continues.
    Each worker is a fork of this server, so all workers together need a single import. Without fork servers, as on
    Windows, each worker imports the modules that it needs.
    """
    if workers < 1:
        raise ValueError(f"{workers} workers")
    if kind == "threads":
        executor: Executor = ThreadPoolExecutor(workers, thread_name_prefix="vestige")
    elif kind == "processes":
        method = "forkserver" if preload and "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
        context = multiprocessing.get_context(method)
        executor = ProcessPoolExecutor(workers, mp_context=context, initializer=_start_process)
    else:
        raise ValueError(f"executor {kind!r}: threads, processes or a concurrent.futures.Executor")
    with _environment(ONE_THREAD if kind == "processes" else {}):
        if kind == "processes" and method == "forkserver":
            _start_server(preload)
        try:
            yield executor
        finally:
            executor.shutdown(wait=True, cancel_futures=True)


def _start_server(preload: Sequence[str]) -> None:
    """Start the server process from which workers are forked. Server and workers ignore Ctrl-C, also during imports."""
    multiprocessing.set_forkserver_preload(list(preload))
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)  # a new process ignores the signals that its parent ignores
    try:
        multiprocessing.forkserver.ensure_running()
    finally:
        signal.signal(signal.SIGINT, handler)


@contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables in this context; new processes read the variables when they load numpy."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _start_process() -> None:
    """Ignore Ctrl-C, which the coordinator handles, and end this process when the coordinator ends or is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    if (parent := multiprocessing.parent_process()) is not None:
        wait([parent.sentinel])
        os._exit(1)
