"""Run a plan: chunks of epochs on workers, results into a store, at any time interruptible.

The coordinator (this process) runs through the epochs in order, hands each chunk's inputs to a worker, and takes the
results back in order. At most `IN_FLIGHT` chunks for each worker are handed out and not yet written, so memory does not
grow with the length of the run. Which worker measures a chunk, and when, has no influence on any bit of the results.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import closing, nullcontext
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, Literal

import xarray

from vestige.campaign.columns.measured_columns import Columns
from vestige.campaign.execution.executors import local_executor, measure_chunk
from vestige.campaign.plan import CHUNK_EPOCHS, Plan, check_results, judged
from vestige.campaign.store.build_id import build_id
from vestige.campaign.store.results import open_results
from vestige.campaign.store.store import Store, make_store, open_store
from vestige.errors import VestigeError
from vestige.folder_lock import only_writer

IN_FLIGHT = 3  # chunks for each worker: one runs, one waits, one may be held back by a slower neighbour

ExecutorChoice = Literal["threads", "processes"] | Executor


@dataclass(frozen=True, slots=True, kw_only=True)
class RunProgress:
    """Progress of a run: epochs in the store, epochs in total, and the time since the run began."""

    epochs_done: int  # epochs in the store
    epochs_total: int
    epochs_resumed: int  # those of them that were there when this run began
    elapsed_s: float  # since this run began

    @property
    def rate_epochs_per_s(self) -> float:
        """Epochs measured in a second; NaN before the first."""
        measured = self.epochs_done - self.epochs_resumed
        return measured / self.elapsed_s if measured and self.elapsed_s > 0 else float("nan")

    @property
    def remaining_s(self) -> float:
        """Time left at this rate, in s; NaN before the first chunk."""
        left = self.epochs_total - self.epochs_done
        return left / self.rate_epochs_per_s if left else 0.0


def run(
    plan: Plan,
    store: Path | str,
    *,
    workers: int = 1,
    executor: ExecutorChoice = "threads",
    chunk_epochs: int = CHUNK_EPOCHS,
    progress: Callable[[RunProgress], None] | None = None,
    enough: Callable[[Columns], bool] | None = None,
) -> xarray.Dataset:
    """Return the results of a plan, after measuring what is not in the store yet.

    Parameters
    ----------
    store
        A folder, made if it does not exist. If it holds a part of the same work, that part is kept.
    workers
        Threads or processes to start; with an executor of your own, how many calls it runs at the same time.
    executor
        `threads` where kernels release the GIL, `processes` where they do not, or any executor (see `cluster.connect`),
        which is left open. `processes` import the main module anew: a script needs `if __name__ == "__main__":`.
        For `threads`, set the variables of `executors.ONE_THREAD` before numpy is loaded, as the command line does.
    chunk_epochs
        Epochs in one call of `measure`, for a new store.
    progress
        Called at the beginning and after each chunk.
    enough
        Called with the columns of each chunk in order, stored ones included. The first chunk for which it is true is
        the last one that is returned, and what comes after it is not measured: the store stays unfinished, to be
        continued by a call that wants more.

    Raises
    ------
    InputFileError
        If `store` is something else, or the store of another scenario, seed or source of vestige, or another process
        writes it.
    VestigeError
        If workers are lost, or have another source of vestige or, where it matters, another processor.
    KeyboardInterrupt
        As raised by Ctrl-C. Like every exception from here it has a note (`__notes__`) that says how much is stored;
        the same call continues there.
    """
    # an empty folder is replaced by the new store, and with it the lock of whoever is about to write there
    with only_writer(Path(store)) if Path(store).is_dir() else nullcontext():
        make_store(Path(store), plan, chunk_epochs=chunk_epochs)
    with only_writer(Path(store)):
        return _run(open_store(store, plan, chunk_epochs=chunk_epochs), plan, workers, executor, progress, enough)


def _run(
    opened: Store,
    plan: Plan,
    workers: int,
    executor: ExecutorChoice,
    progress: Callable[[RunProgress], None] | None,
    enough: Callable[[Columns], bool] | None,
) -> xarray.Dataset:
    """Measure what a store lacks; see `run`."""
    finished = opened.finished(verify=True)
    resumed = done = sum(len(opened.epochs(chunk)) for chunk in finished)
    returned = 0
    begin = time.monotonic()

    def report() -> None:
        if progress is not None:
            elapsed_s = time.monotonic() - begin
            progress(
                RunProgress(epochs_done=done, epochs_total=plan.n_epochs, epochs_resumed=resumed, elapsed_s=elapsed_s)
            )

    try:
        report()
        chunks = measure_chunks(
            plan, workers=workers, executor=executor, chunk_epochs=opened.chunk_epochs, skip=finished
        )
        state: Any = None
        last_missing = max(set(range(opened.n_chunks)) - finished, default=-1)
        with closing(chunks):
            for chunk in range(opened.n_chunks):
                epochs = opened.epochs(chunk)
                if chunk not in finished:
                    _, measured = next(chunks)
                    state, results = judged(plan, state, epochs.start, measured)
                    check_results(plan, results, len(epochs))
                    opened.write(chunk, results)
                    done += len(epochs)
                    report()
                elif enough is not None or chunk < last_missing:
                    results = opened.read(chunk)
                    state, _ = judged(plan, state, epochs.start, results)
                returned = epochs.stop
                if enough is not None and enough(results):
                    break
    except BrokenExecutor as error:
        raise VestigeError(f"workers were lost ({error}); {_stored(opened)}") from error
    except BaseException as stop:
        stop.add_note(_stored(opened))
        raise
    stored = open_results(opened.path, partial=enough is not None, verify=False).dataset
    return stored if enough is None else stored.isel(epoch=slice(0, returned))


def measure_chunks(
    plan: Plan,
    *,
    workers: int = 1,
    executor: ExecutorChoice = "threads",
    chunk_epochs: int = CHUNK_EPOCHS,
    skip: Collection[int] = (),
) -> Generator[tuple[int, Columns]]:
    """Yield number and results of each chunk, in order, whatever the workers.

    Who has seen enough closes this iterator: the epochs seen by then do not depend on the number of workers.
    """
    left = [chunk for chunk in range(-(-plan.n_epochs // chunk_epochs)) if chunk not in skip]
    if not left:
        return
    with nullcontext(executor) if isinstance(executor, Executor) else local_executor(executor, workers) as pool:
        submitted = _submitted(plan, pool, chunk_epochs, left)
        pending = deque(islice(submitted, IN_FLIGHT * workers))
        try:
            while pending:
                chunk, future = pending[0]
                results = future.result()
                pending.popleft()
                pending.extend(islice(submitted, 1))  # before the yield: workers go on while the results are written
                yield chunk, results
        finally:
            for _, future in pending:
                future.cancel()


def _submitted(
    plan: Plan, pool: Executor, chunk_epochs: int, chunks: Sequence[int]
) -> Iterator[tuple[int, Future[Columns]]]:
    """Hand out `chunks`, one a step; the preparation runs through all the epochs before them."""
    preparation = plan.prepare()
    wanted = frozenset(chunks)
    expected = build_id(plan)
    for chunk in range(chunks[-1] + 1):
        first = chunk * chunk_epochs
        count = min(chunk_epochs, plan.n_epochs - first)
        inputs = preparation.advance(first, count)
        if chunk in wanted:
            yield chunk, pool.submit(measure_chunk, plan, first, inputs, expected)


def _stored(opened: Store) -> str:
    """Return how much is on disk: a run may be stopped between writing a chunk and counting it."""
    done = sum(len(opened.epochs(chunk)) for chunk in opened.finished(verify=False))
    return f"{done} of {opened.n_epochs} epochs are stored in {opened.path}; the same run again continues there"
