from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.patches import StepPatch

from results_builder import campaign_results
from vestige.plots.figure import BLUE, RED
from vestige.plots.magnitude_histogram import magnitude_histogram


def bars(ax: Axes, colour: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the left border and the height of the bars of a colour."""
    (stairs,) = (patch for patch in ax.patches if patch.get_facecolor() == to_rgba(colour))
    assert isinstance(stairs, StepPatch)
    return stairs.get_data().edges[:-1], stairs.get_data().values


def test_every_epoch_with_a_correlation_is_in_a_bar() -> None:
    results = campaign_results(2000, cn0_dbhz=31.0, unavailable=slice(0, 100))
    ax = magnitude_histogram(results)
    detected = int((results["tap_index"].values[0] >= 0).sum())
    assert bars(ax, BLUE)[1].sum() == detected
    assert bars(ax, RED)[1].sum() == 1900 - detected
    assert ax.get_ylabel() == "epochs per 0.25 σ"
    assert ax.get_xlabel() == "magnitude (σ)"
    legend = ax.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()][:2] == [
        f"detected: {detected}", f"not detected: {1900 - detected}, strongest",
    ]  # fmt: skip


@pytest.mark.parametrize("bin_sigma", [0.25, 0.7])
def test_cut_at_the_threshold(bin_sigma: float) -> None:
    ax = magnitude_histogram(campaign_results(2000, cn0_dbhz=31.0), bin_sigma=bin_sigma)
    threshold = np.sqrt(-2 * np.log(1e-7))
    (line,) = [line for line in ax.lines if line.get_linestyle() == "--"]
    assert line.get_xdata()[0] == pytest.approx(threshold)
    left, height = bars(ax, BLUE)
    assert left[height > 0].min() == pytest.approx(threshold)  # the border of a bin, and nothing below
    left, height = bars(ax, RED)
    assert left[height > 0].max() == pytest.approx(threshold - bin_sigma)


def test_heights_are_the_counts_of_the_bins() -> None:
    results = campaign_results(3000)
    left, height = bars(magnitude_histogram(results, bin_sigma=0.5), BLUE)
    values = results["magnitude_sigma"].values[0, :, 0]
    for start, count in zip(left, height, strict=True):
        assert count == np.sum((values >= start) & (values < start + 0.5))


def test_theory_is_the_rice_distribution_of_an_aligned_tap() -> None:
    ax = magnitude_histogram(campaign_results(3000))
    (line,) = [line for line in ax.lines if line.get_linestyle() == "-"]
    x, y = (np.asarray(values) for values in line.get_data())
    draws = np.random.default_rng(5).standard_normal((400_000, 2)) + np.array([np.sqrt(2 * 10**3.5 * 0.016), 0])
    counts, _ = np.histogram(np.hypot(*draws.T), np.append(x - 0.125, x[-1] + 0.125))
    expected = counts / 400_000 * 3000
    np.testing.assert_allclose(y, expected, atol=6 * np.sqrt(expected.max() * 3000 / 400_000))
    assert "Rice, A = 10.06 σ" in [text.get_text() for text in ax.get_legend().get_texts()]


def test_without_attributes_there_is_neither_theory_nor_threshold() -> None:
    results = campaign_results(100)
    results.attrs.clear()
    assert list(magnitude_histogram(results).lines) == []


def test_strong_signals_get_along_with_600_bins() -> None:
    results = campaign_results(50, cn0_dbhz=80.0)
    ax = magnitude_histogram(results)
    assert bars(ax, BLUE)[1].sum() == 50
    assert len(bars(ax, BLUE)[1]) <= 603
    assert ax.get_ylabel() == "epochs per 4 σ"


def test_linear_scale() -> None:
    assert magnitude_histogram(campaign_results(50), log=False).get_yscale() == "linear"
    assert magnitude_histogram(campaign_results(50)).get_yscale() == "log"
