"""Run a campaign on several machines with a dask cluster: `run(plan, store, executor=connect("tcp://…"))`.

If a worker is lost, the dask scheduler gives its chunks to another worker, including measured chunks whose results were
not yet fetched. A chunk that is measured twice gives the same bits both times. All machines need the same source code
of vestige and of the user's own classes. All machines also need the same kind of CPU if the bits depend on the CPU.
Source code and kind of CPU are checked with every chunk. The machines need no shared disk and no data.
"""

from __future__ import annotations

import re
import socket
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from functools import partial
from importlib import import_module
from typing import Any, ParamSpec, TypeVar

from vestige.errors import UnsupportedError, VestigeError

P = ParamSpec("P")
R = TypeVar("R")

_ADDRESS = re.compile(r"(tcp|tls|ws|wss)://(?P<host>\[[0-9a-fA-F:.%]+\]|[^\s:/\[\]]+):(?P<port>[0-9]{1,5})")
CONNECT_S = 10.0  # longest time in s to wait for the scheduler, which answers in milliseconds if it is running
NO_WORKERS_S = 10.0  # time in s without workers until a warning; a worker that is started again connects sooner
LOOK_EVERY_S = 2.0


class ClusterExecutor(Executor):
    """Executor on a dask cluster; `shutdown` ends the connection and leaves the cluster running.

    dask has its own executor. If the connection to the scheduler breaks while a result is fetched, the futures of
    dask's executor never end. The futures of this executor end with `BrokenExecutor`.
    """

    def __init__(self, client: Any, address: str, warn: Callable[[str], None]) -> None:
        self._client, self._address, self._warn = client, address, warn
        self._closed = threading.Event()
        threading.Thread(target=self._watch, name="vestige cluster", daemon=True).start()

    @property
    def _gone(self) -> str:
        return f"{self._address}: the dask scheduler does not answer"

    @property
    def workers(self) -> int:
        """Number of calls that the cluster can run at the same time now."""
        return sum(self._client.nthreads().values())

    def submit(self, fn: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> Future[R]:
        """Return the future of a call; the future raises `BrokenExecutor` if the cluster could not finish the call."""
        outer: Future[R] = Future()
        # dask searches arguments for its own futures, so `partial` puts the arguments in one object. With `pure=True`,
        # dask would hash all arguments to share the results of equal calls.
        try:
            inner = self._client.submit(partial(fn, *args, **kwargs), pure=False)
        except Exception as error:
            if self._client.status == "running":
                raise
            raise BrokenExecutor(self._gone) from error
        inner.add_done_callback(lambda done: self._pass_on(done, outer))
        outer.add_done_callback(lambda done: inner.cancel() if done.cancelled() else None)
        return outer

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002  (not used here)
        """End the connection and cancel the calls that have not ended."""
        self._closed.set()
        self._client.close()

    def _pass_on(self, inner: Any, outer: Future[R]) -> None:
        """Give `outer` the outcome of a dask future; a lost call or an `OSError` becomes `BrokenExecutor`."""
        killed_worker = import_module("distributed").KilledWorker
        if not outer.set_running_or_notify_cancel():
            return
        try:
            outer.set_result(inner.result())
        except (CancelledError, killed_worker, OSError) as error:
            gone = self._client.status != "running"
            outer.set_exception(BrokenExecutor(self._gone if gone else f"{type(error).__name__}: {error}"))
        except BaseException as error:  # `outer.result()` raises this error again
            outer.set_exception(error)

    def _watch(self) -> None:
        """Warn when the cluster has had no workers for `NO_WORKERS_S`, and when the cluster has workers again."""
        without_s, told = 0.0, False
        while not self._closed.wait(LOOK_EVERY_S):
            try:
                workers = self.workers
            except Exception:  # the connection has ended; the waiting calls raise the error
                return
            without_s = 0.0 if workers else without_s + LOOK_EVERY_S
            if not workers and not told and without_s >= NO_WORKERS_S:
                self._warn(f"{self._address}: the dask cluster has no workers left; waiting for new ones")
            elif workers and told:
                self._warn(f"{self._address}: the dask cluster has workers again: {workers}")
            told = not workers and without_s >= NO_WORKERS_S


def connect(address: str, *, warn: Callable[[str], None] = lambda _line: None) -> ClusterExecutor:
    """Return an executor on the dask cluster whose scheduler is at `address`, e.g. `tcp://host:8786`.

    The executor is a context manager, and its exit ends the connection:

        with connect("tcp://host:8786") as cluster:
            run(plan, store, executor=cluster, workers=cluster.workers)

    Parameters
    ----------
    address
        Address of the scheduler.
    warn
        Function that is called with one line when the cluster has had no workers for `NO_WORKERS_S`, and when the
        cluster has workers again. Calls wait while the cluster has no workers. A separate thread calls the function.

    Raises
    ------
    UnsupportedError
        If dask.distributed is not installed.
    VestigeError
        If `address` is not valid, no scheduler answers, or the scheduler has no workers.
    """
    try:
        distributed = import_module("distributed")
    except ImportError as error:
        raise UnsupportedError("a cluster needs dask.distributed: pip install 'vestige[distributed]'") from error
    _check_answer(address)
    client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    cluster = ClusterExecutor(client, address, warn)
    if not cluster.workers:
        cluster.shutdown()
        raise VestigeError(f"{address}: the dask scheduler has no workers")
    return cluster


def _check_answer(address: str) -> None:
    """Raise `VestigeError` if an address is not valid, or no scheduler answers at the address.

    A dask client that was made without a connection would print a second error when the client is deleted.
    """
    match = _ADDRESS.fullmatch(address)
    if match is None or not int(match["port"]) < 1 << 16:
        raise VestigeError(f"--scheduler: found {address!r}, expected an address such as tcp://host:8786")
    try:
        socket.create_connection((match["host"].strip("[]"), int(match["port"])), timeout=CONNECT_S).close()
    except (OSError, UnicodeError) as error:  # UnicodeError is raised if the host name is not valid
        raise VestigeError(f"{address}: no dask scheduler answers ({error})") from error
