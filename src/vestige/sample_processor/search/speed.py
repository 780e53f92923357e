"""How long an exhaustive search will take, from a short measurement on this machine."""

from __future__ import annotations

import os
import time

import numpy as np

from vestige.sample_processor.search.exhaustive_search import ENGINES, ExhaustiveSearch

_OFFSETS = 16_384  # that are timed: 5 to 60 ms


def expected_seconds(search: ExhaustiveSearch, hypotheses: float) -> float:
    """Return the run time in s of so many hypotheses with the engine and workers of a search."""
    rng = np.random.default_rng(1)
    codes = (1 - 2 * rng.integers(0, 2, (1, search.n_chips))).astype(np.int8)
    chips = rng.integers(-20, 21, (2, 2, search.n_chips + _OFFSETS)).astype(np.int16)
    engine = ENGINES[search.engine](codes)
    engine.powers(chips[:, :, : search.n_chips + 1], 1)  # compiles
    begin = time.thread_time()
    engine.powers(chips, _OFFSETS)
    spent_s = time.thread_time() - begin
    rate = 2 * _OFFSETS * search.bins_hz.size / max(spent_s, 1e-6)
    return hypotheses / rate / (search.workers or os.cpu_count() or 1)
