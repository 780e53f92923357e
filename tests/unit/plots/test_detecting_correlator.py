from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from results_builder import campaign_results, lift_off
from vestige.plots.detecting_correlator import detecting_correlator
from vestige.plots.figure import BLUE, ORANGE, RED


def by_colour(ax: Axes) -> dict[str, Line2D]:
    return {str(line.get_color()): line for line in ax.lines}


def right_of(ax: Axes) -> Axes:
    (twin,) = [other for other in ax.figure.axes if other is not ax]
    return twin


@pytest.mark.parametrize(("detector", "row"), [("early", 0), ("maximum", 1)])
def test_drawn_is_what_was_measured(detector: str, row: int) -> None:
    results = campaign_results(500, cn0_dbhz=31.0, unavailable=slice(100, 120))
    ax = detecting_correlator(results, detector=detector)
    lines, (phase,) = by_colour(ax), right_of(ax).lines
    for line in (lines[ORANGE], lines[RED], phase):
        np.testing.assert_array_equal(line.get_xdata(), results["time_s"])
    np.testing.assert_array_equal(lines[ORANGE].get_ydata(), results["magnitude_sigma"][row, :, 0])
    np.testing.assert_array_equal(phase.get_ydata(), results["phase_rad"][row, :, 0])
    flags = (results["tap_index"].values[row, :, 0] >= 0).astype(float)
    flags[100:120] = np.nan  # neither detected nor missed
    np.testing.assert_array_equal(lines[RED].get_ydata(), flags)
    assert {0.0, 1.0} <= set(flags)
    assert phase.get_color() == BLUE


def test_threshold_and_labels() -> None:
    ax = detecting_correlator(campaign_results(50))
    dashed = [line for line in ax.lines if line.get_linestyle() == "--"]
    assert [line.get_ydata()[0] for line in dashed] == [pytest.approx(5.678, abs=5e-4)]
    assert (ax.get_xlabel(), ax.get_ylabel(), right_of(ax).get_ylabel()) == ("time (s)", "magnitude (σ)", "phase (rad)")
    legend = ax.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == [
        "magnitude", "phase", "detected 1, not 0", "threshold 5.68 σ",
    ]  # fmt: skip


@pytest.mark.parametrize("results", [campaign_results(900, spoofer=lift_off), campaign_results(40, cn0_dbhz=5.0)])
def test_nothing_covers_anything(results: object) -> None:
    ax = detecting_correlator(results)
    ax.figure.canvas.draw()
    frame = ax.get_window_extent()

    def heights(line: Line2D) -> np.ndarray:
        y = np.asarray(line.get_ydata(), dtype=float)
        x = np.zeros_like(y)
        return line.axes.transData.transform(np.column_stack([x, y])[np.isfinite(y)])[:, 1]

    lines, (phase,) = by_colour(ax), right_of(ax).lines
    flags, magnitude, turns = heights(lines[RED]), heights(lines[ORANGE]), heights(phase)
    assert frame.y0 < flags.min()
    if magnitude.size:
        assert flags.max() < magnitude.min()
        assert magnitude.max() < turns.min()
        assert turns.max() < frame.y1
    right = right_of(ax)
    assert frame.y1 > right.transData.transform((0, np.pi))[1] > frame.y0


def test_results_without_a_threshold() -> None:
    results = campaign_results(20)
    results.attrs.clear()
    ax = detecting_correlator(results)
    assert ax.get_title() == "Detecting correlator, early detector, E11"
    assert not [line for line in ax.lines if line.get_linestyle() == "--"]
