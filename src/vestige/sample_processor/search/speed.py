"""Predict the run time of an exhaustive search from a short measurement on this machine."""

from __future__ import annotations

import os
import time

import numpy as np

from vestige.sample_processor.search.engines.choice import make_engine
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch
from vestige.theory.search_budget import search_budget


def expected_seconds(search: ExhaustiveSearch, hypotheses: float) -> float:
    """Return the expected run time in s for a number of hypotheses, with the engine and workers of a search.

    One block of one grid is timed, which takes 5 to 200 ms. The time is CPU time if the engine runs on every core, and
    wall time if all workers share one GPU.
    """
    rng = np.random.default_rng(1)
    codes = (1 - 2 * rng.integers(0, 2, (1, search.n_chips))).astype(np.int8)
    engine = make_engine(search.engine, codes)
    limit = search_budget(hypotheses, search.integration_s).threshold
    chips = rng.integers(-20, 21, (1, 2, search.n_chips + engine.block), dtype=np.int16)
    engine.powers(chips[:, :, : search.n_chips + 1], 1, limit)  # the first call compiles the engine
    clock = time.thread_time if engine.uses_cores else time.perf_counter
    begin = clock()
    engine.powers(chips, engine.block, limit)
    rate = engine.block * search.bins_hz.size / max(clock() - begin, 1e-6)
    cores = (search.workers or os.cpu_count() or 1) if engine.uses_cores else 1
    return hypotheses / rate / cores
