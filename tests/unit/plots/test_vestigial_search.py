"""Figures of the vestigial searches: what is in them, by their artists."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vestige.plots import SearchTrace, code_phases, roc_curves, vestigial_search, write


def _labels(ax: object) -> list[str]:
    return ax.get_legend_handles_labels()[1]  # type: ignore[attr-defined]


def test_the_earliest_is_marked_as_true_and_the_rest_as_spoofing(tmp_path: Path) -> None:
    trace = SearchTrace(
        time_s=[0.0, 0.5, 1.0, 2.0],
        magnitude=[1.0, 9.0, 2.0, 20.0],
        threshold=6.0,
        peaks=[(0.5, 9.2), (2.0, 20.1), (3.0, 8.0)],
    )
    ax = vestigial_search(trace, title="E6, E11")
    assert _labels(ax) == ["searched", "threshold 6.00", "true: the earliest", "later: spoofing"]
    searched, _, true, *later = ax.lines
    assert list(np.asarray(searched.get_xdata())) == [0.0, 0.5, 1.0, 2.0]
    assert np.asarray(true.get_xdata()).item() == 0.5
    assert [np.asarray(one.get_xdata()).item() for one in later] == [2.0, 3.0]
    assert ax.get_ylim()[1] > 20.1
    write(ax, tmp_path / "a.png", width_cm=8)


def test_a_search_that_found_nothing_has_no_peaks() -> None:
    ax = vestigial_search(SearchTrace(time_s=[], magnitude=[], threshold=6.0, peaks=[]), title="E6")
    assert _labels(ax) == ["searched", "threshold 6.00"]


@pytest.mark.parametrize("found", [[], [(1.0, 5.0), (3.0, 2.0)]])
def test_code_phases_circle_what_was_found(found: list[tuple[float, float]]) -> None:
    ax = code_phases(np.linspace(0, 4, 100), np.full(100, 0.7), found, title="E1, E11")
    assert _labels(ax) == ["threshold", f"signals found: {len(found)}"]
    assert np.asarray(ax.lines[2].get_xdata()).tolist() == [phase for phase, _ in found]


def test_measured_points_have_their_intervals() -> None:
    """200 of 400 lie at 0.5, from 0.45 to 0.55 (Clopper-Pearson, 95 %)."""
    pfa = np.array([1e-4, 1e-3, 1e-2])
    ax = roc_curves([("hand-over", pfa, np.array([0.4, 0.5, 0.6]), pfa[1:2], np.array([200]), 400)], title="ROC")
    (bar,) = ax.containers
    assert np.asarray(bar.lines[0].get_ydata()).tolist() == [0.5]
    low, high = bar.lines[2][0].get_segments()[0][:, 1]
    assert (low, high) == (pytest.approx(0.45, abs=2e-3), pytest.approx(0.55, abs=2e-3))
    assert ax.get_xscale() == "log"
