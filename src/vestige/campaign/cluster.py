"""Several machines: the executor of a dask cluster, for `run(plan, store, executor=connect("tcp://…"))`.

dask knows which worker holds what. When one dies, the scheduler gives its chunks to another, also those that were
measured and not fetched yet; a chunk that is measured twice gives the same bits. The cluster's machines need the same
source of vestige, and where bits depend on it the
same kind of processor (both checked with every chunk), and nothing else: no shared disk, no data.
"""

from __future__ import annotations

import re
import socket
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from functools import partial
from importlib import import_module
from typing import Any, ParamSpec, TypeVar

from vestige.errors import UnsupportedError, VestigeError

P = ParamSpec("P")
R = TypeVar("R")

_ADDRESS = re.compile(r"(tcp|tls|ws|wss)://(?P<host>\[[0-9a-fA-F:.%]+\]|[^\s:/\[\]]+):(?P<port>[0-9]{1,5})")
CONNECT_S = 10.0  # a scheduler that is there answers in milliseconds


class ClusterExecutor(Executor):
    """Calls on the workers of a dask cluster; closing it ends the connection and leaves the cluster running.

    dask has an executor of its own, whose futures never end when the connection to the scheduler breaks while a result
    is fetched. These do.
    """

    def __init__(self, client: Any) -> None:
        self._client = client

    @property
    def workers(self) -> int:
        """How many calls the cluster runs at the same time, at present."""
        return sum(self._client.nthreads().values())

    def submit(self, fn: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> Future[R]:
        """Return the future of a call; its outcome is `BrokenExecutor` if the cluster could not finish it."""
        outer: Future[R] = Future()
        # One object, because dask looks for its own futures inside of arguments. Not pure, because equal calls would
        # share a result, and to find them dask hashes everything.
        inner = self._client.submit(partial(fn, *args, **kwargs), pure=False)
        inner.add_done_callback(lambda done: _pass_on(done, outer))
        outer.add_done_callback(lambda done: inner.cancel() if done.cancelled() else None)
        return outer

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002  (no use for them)
        """End the connection; calls that have not ended are cancelled."""
        self._client.close()


def connect(address: str) -> ClusterExecutor:
    """Return an executor on the dask cluster whose scheduler is at `address`, e.g. `tcp://host:8786`.

    It is a context manager; leaving it ends the connection:

        with connect("tcp://host:8786") as cluster:
            run(plan, store, executor=cluster, workers=cluster.workers)

    Raises
    ------
    UnsupportedError
        If dask.distributed is not installed.
    VestigeError
        If no scheduler answers, or it has no worker.
    """
    try:
        distributed = import_module("distributed")
    except ImportError as error:
        raise UnsupportedError("a cluster needs dask.distributed: pip install 'vestige[distributed]'") from error
    _check_answer(address)
    client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    cluster = ClusterExecutor(client)
    if not cluster.workers:
        cluster.shutdown()
        raise VestigeError(f"{address}: the dask scheduler has no workers")
    return cluster


def _check_answer(address: str) -> None:
    """Raise if nobody listens at an address. A dask client that cannot connect complains once more when it is freed."""
    match = _ADDRESS.fullmatch(address)
    if match is None or not int(match["port"]) < 1 << 16:
        raise VestigeError(f"--scheduler: found {address!r}, expected an address such as tcp://host:8786")
    try:
        socket.create_connection((match["host"].strip("[]"), int(match["port"])), timeout=CONNECT_S).close()
    except (OSError, UnicodeError) as error:  # UnicodeError: a name that no network can have
        raise VestigeError(f"{address}: no dask scheduler answers ({error})") from error


def _pass_on(inner: Any, outer: Future[R]) -> None:
    """Give `outer` the outcome of a dask future; what dask says of its own troubles becomes `BrokenExecutor`."""
    killed_worker = import_module("distributed").KilledWorker
    if not outer.set_running_or_notify_cancel():
        return
    try:
        outer.set_result(inner.result())
    except (CancelledError, killed_worker, OSError) as error:
        outer.set_exception(BrokenExecutor(f"{type(error).__name__}: {error}"))
    except BaseException as error:  # raised again where the result is asked for
        outer.set_exception(error)
