"""When the exhaustive search is made: the rule alone, and the rule in a processor that runs."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import Phase, given, settings, strategies

from block_builder import Keys, MadeUpSky
from block_builder import settings as monitoring
from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.searches.searches import search_due
from vestige.records.checks import CheckName

N = 30


@pytest.mark.parametrize(
    ("since_s", "suspicious", "found_twice", "due"),
    [
        (None, False, False, True),
        (10.0, False, False, False),
        (10.0, True, False, True),
        (10.0, False, True, True),
        (60.0, False, False, True),
        (60.0 - 1e-9, False, False, True),
        (59.9, False, False, False),
    ],
)
def test_the_rule(since_s: float | None, suspicious: bool, found_twice: bool, due: bool) -> None:
    assert search_due(since_s, 60.0, suspicious=suspicious, found_twice=found_twice) is due


@settings(max_examples=20, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(
    seed=strategies.integers(0, 2**31),
    every=strategies.integers(1, 4),
    trouble=strategies.sampled_from([0.0, 0.002, 0.05]),
    periods=strategies.integers(1, 8),
)
def test_searches_are_scheduled(seed: int, every: int, trouble: float, periods: int) -> None:
    """At the start, after every suspicion at the next RECS, and then, only then, when the last is a period ago."""
    sky = MadeUpSky(seed=seed, n=N, every=every, trouble=trouble).whole
    interval_s = float((sky.time[1:] - sky.time[:-1])[0])
    period_s = periods * every * interval_s
    processor = AcasProcessor(level=3, monitoring=replace(monitoring(), exhaustive_period_s=period_s))
    block = processor.step(None, sky, Keys()).block  # type: ignore[arg-type]
    searched, twice = block.searched, block.exhaustive_search.twice.any(axis=1)
    suspicious = np.zeros(N, bool)
    for name, failed in block.failed.items():
        if name is not CheckName.E6_EXHAUSTIVE_SEARCH:
            suspicious |= failed if failed.ndim == 1 else failed.any(axis=1)
    assert not np.any(searched & ~sky.recs)
    places = np.flatnonzero(sky.recs)
    assert searched[places[0]]
    for before, place in pairwise(places.tolist()):
        suspicion = suspicious[before + 1 : place + 1].any() or (searched[before] and twice[before])
        due = not searched[max(0, place - periods * every + 1) : place].any()
        assert searched[place] == (suspicion or due)
