"""Run a plan: workers measure chunks of epochs, and a store keeps the results. A run may be interrupted at any time.

The coordinator (this process) runs through the epochs in order, sends each chunk's inputs to a worker, and takes the
results back in order. At most `IN_FLIGHT` chunks for each worker, and one more chunk, are sent and not yet written.
Memory therefore does not grow with the length of the run. The results have the same bits with any number of workers and
any timing.
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

IN_FLIGHT = 3  # chunks for each worker: a running chunk, a waiting chunk, and a result that waits for earlier results

ExecutorChoice = Literal["threads", "processes"] | Executor


@dataclass(frozen=True, slots=True, kw_only=True)
class RunProgress:
    """Progress of a run: epochs in the store, epochs in total, and the time since the run began."""

    epochs_done: int  # epochs in the store
    epochs_total: int  # epochs of the plan
    epochs_resumed: int  # epochs that were in the store when this run began
    elapsed_s: float  # time since this run began

    @property
    def rate_epochs_per_s(self) -> float:
        """Number of epochs that are measured in a second; NaN before the first chunk."""
        measured = self.epochs_done - self.epochs_resumed
        return measured / self.elapsed_s if measured and self.elapsed_s > 0 else float("nan")

    @property
    def remaining_s(self) -> float:
        """Remaining time in s at the mean rate of this run; NaN if epochs remain and no chunk was measured yet."""
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
    """Measure the epochs of a plan that the store lacks, and return the results.

    Parameters
    ----------
    store
        Folder, which is made if it does not exist. Stored results of this plan are kept.
    workers
        Number of threads or processes to start. For your own executor, give the number of calls that the executor runs
        at the same time.
    executor
        `threads` if the plan's computations release the GIL of Python, `processes` if they do not, or any executor (see
        `cluster.connect`). Your own executor is left open. Processes import the main module again, so a script needs
        `if __name__ == "__main__":`. For `threads`, set the variables of `executors.ONE_THREAD` before numpy is loaded,
        as the command line does.
    chunk_epochs
        Number of epochs in one call of `measure`, for a new store.
    progress
        Function that is called with the progress at the beginning and after each measured chunk.
    enough
        Function that is called with the columns of each chunk in order, including stored chunks. The results end with
        the first chunk for which the function returns true, and no later chunk is written. If the store then lacks
        chunks, the store stays unfinished, and a later call may continue the run.

    Raises
    ------
    InputFileError
        If `store` is no store, is damaged beyond repair, or belongs to another plan or another build (`build_id`). If
        another process writes into the store.
    VestigeError
        If workers are lost or have another build (`build_id`), if a chunk would be too large, or if the code of a
        user's class fails.
    KeyboardInterrupt
        If the user presses Ctrl-C. While chunks are measured, this exception has a note (`__notes__`) with the number
        of stored epochs. Other exceptions then have the same note, or have the number in their text. The same call
        continues the run.
    """
    # A new store replaces an empty folder. The lock prevents the replacement while another process may write into the
    # folder.
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
    """Measure the chunks that a store lacks; see `run`."""
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
    """Yield number and results of each chunk that is not in `skip`, in order, with any number of workers.

    A caller that needs no more chunks closes this iterator. The yielded chunks do not depend on the number of workers.
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
                pending.extend(islice(submitted, 1))  # workers continue while the caller writes the yielded results
                yield chunk, results
        finally:
            for _, future in pending:
                future.cancel()


def _submitted(
    plan: Plan, pool: Executor, chunk_epochs: int, chunks: Sequence[int]
) -> Iterator[tuple[int, Future[Columns]]]:
    """Submit each chunk of `chunks`, and yield the number of the chunk and its future.

    Earlier chunks that are not in `chunks` are prepared, too, because the preparation must run through all earlier
    epochs.
    """
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
    """Return a message with the number of epochs that are stored on disk, including the last written chunk."""
    done = sum(len(opened.epochs(chunk)) for chunk in opened.finished(verify=False))
    return f"{done} of {opened.n_epochs} epochs are stored in {opened.path}; the same command continues there"
