from __future__ import annotations

import numpy as np
import pytest

from results_builder import campaign_results
from vestige.plots.bank_edge import EDGE_LABEL, mark_bank_edge
from vestige.plots.epochs import select
from vestige.plots.figure import new_axes


@pytest.mark.parametrize(
    ("offsets_m", "edges_m"),
    [
        ((0.0, 67.5), [75.0]),
        ((-67.5, np.nan, 67.5), [-75.0, 75.0]),
        ((-60.0,), [-75.0]),
        ((-59.0, 59.0), []),
        ((np.nan,), []),
    ],
)
@pytest.mark.parametrize("upright", [False, True])
def test_an_edge_is_marked_if_offsets_come_within_a_tap(
    offsets_m: tuple[float, ...], edges_m: list[float], upright: bool
) -> None:
    ax = new_axes()
    found_m = mark_bank_edge(ax, select(campaign_results(3)), np.array(offsets_m), upright=upright)
    assert found_m.tolist() == edges_m
    assert [(line.get_xdata() if upright else line.get_ydata())[0] for line in ax.lines] == edges_m
    assert ax.get_legend_handles_labels()[1] == [EDGE_LABEL][: len(edges_m)]


def test_a_single_tap_has_no_edge() -> None:
    ax = new_axes()
    assert not mark_bank_edge(ax, select(campaign_results(3).isel(tap=[5])), np.zeros(3)).size
    assert not ax.lines
