from __future__ import annotations

import numpy as np
import pytest

from builders import START, random_chips
from search_builder import arrival, e6_source
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch

CHIP_S = 1 / 5.115e6


@pytest.mark.parametrize("apart_chips", [1.6, 2.0, 3.0, 4.5])
def test_signals_whose_cells_touch_are_two(apart_chips: float) -> None:
    """At 42 dBHz all cells of a triangle are above the screen: those of two signals are one cluster."""
    chips = random_chips(np.random.default_rng(16), 81_840)
    both = [arrival(chips, 6e-6 + late * CHIP_S, 42.0, 500.0) for late in (0.0, apart_chips)]
    source = e6_source(both, 16e-3 + 12e-6, 3)
    search = ExhaustiveSearch(integration_s=16e-3, engine="segment", workers=1)
    *_, state = search.run(source, [chips], START, START + 1, 8.0)
    places = [(peak.start_time - START - 6e-6) / CHIP_S for peak in state.peaks]
    assert places == pytest.approx([0.0, apart_chips], abs=0.1)
