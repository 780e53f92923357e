"""Provide an executor for the work of a command: threads or processes of this machine, or a cluster."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from vestige.cli.terminal import detail, warn

if TYPE_CHECKING:
    from concurrent.futures import Executor

MAX_THREADS = 2  # more than two threads wait for each other in Python code; a process needs 200 MB of memory
_OF_DASK = ("asyncio", "distributed", "distributed.client", "distributed.comm", "distributed.core", "tornado")


@contextmanager
def pool(
    workers: int | None, threads: bool | None, scheduler: str | None, preload: Sequence[str] = ()
) -> Iterator[tuple[Executor, int]]:
    """Yield an executor and the number of calls that it runs at the same time.

    On this machine the number is `workers`, by default 1. `threads` is True for threads and False for processes. If
    `threads` is None, up to `MAX_THREADS` workers are threads, and more workers are processes. If `scheduler` is the
    address of a cluster's scheduler, the calls run on the cluster. `preload` names modules that worker processes need,
    as in `local_executor`.
    """
    if scheduler is not None:
        from vestige.campaign.execution.cluster import connect

        for name in _OF_DASK:  # vestige itself reports the errors of dask, in one line
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        with connect(scheduler, warn=warn) as cluster:
            detail(f"number of workers on the cluster {scheduler}: {cluster.workers}")
            yield cluster, cluster.workers
        return

    from vestige.campaign.execution.executors import local_executor

    workers = workers or 1
    kind = "threads" if (workers <= MAX_THREADS if threads is None else threads) else "processes"
    detail(f"number of {kind}: {workers}")
    with local_executor(kind, workers, preload) as executor:
        yield executor, workers
