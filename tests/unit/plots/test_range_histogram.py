from __future__ import annotations

import numpy as np
import pytest
import xarray
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle, StepPatch

from results_builder import campaign_results
from vestige.plots.range_histogram import RightFlank, range_histogram


def bars(ax: Axes) -> tuple[np.ndarray, np.ndarray]:
    (stairs,) = (patch for patch in ax.patches if isinstance(patch, StepPatch))
    return stairs.get_data().edges[:-1], stairs.get_data().values


def label_of_cluster(ax: Axes) -> str:
    return next((str(patch.get_label()) for patch in ax.patches if isinstance(patch, Rectangle)), "")


def with_offsets(offsets_m: np.ndarray) -> xarray.Dataset:
    results = campaign_results(offsets_m.size)
    results["range_offset_m"].values[:] = offsets_m[:, None]
    return results


def test_heights_are_the_counts_of_the_bins() -> None:
    results = campaign_results(3000, cn0_dbhz=31.0)
    ax = range_histogram(results, detector="maximum", bin_m=1.0)
    values = results["range_offset_m"].values[1, :, 0]
    left, height = bars(ax)
    assert height.sum() == np.isfinite(values).sum() > 1000
    for start, count in zip(left, height, strict=True):
        assert count == np.sum((values >= start) & (values < start + 1.0))
    assert np.any(np.isclose(left, -0.5))  # 0 m is the middle of a bin
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_yscale()) == ("range offset (m)", "epochs per 1 m", "log")


def test_the_cluster_is_marked_and_counted() -> None:
    ax = range_histogram(with_offsets(np.array([-27.5, -27.0, -22.5, -18.0, -17.5, 0.0, np.nan])))
    (span,) = (patch for patch in ax.patches if isinstance(patch, Rectangle))
    assert str(span.get_label()) == "early flank, −22.5 m: 3"
    assert span.get_width() == pytest.approx(9.0)
    assert span.get_x() == pytest.approx(-27.0)
    assert not label_of_cluster(range_histogram(with_offsets(np.zeros(3)), mark_cluster=False))


def test_the_cluster_moves_with_the_taps() -> None:
    results = with_offsets(np.array([-15.0, -12.1, -11.9, 0.0])).assign_coords(
        tap_offset_m=("tap", np.arange(-5, 6) * 10.0)
    )
    assert label_of_cluster(range_histogram(results)) == "early flank, −15 m: 2"


def test_the_early_detector_makes_the_cluster_and_the_maximum_detector_does_not() -> None:
    results = campaign_results(40_000, seed=3)
    early, maximum = (
        int(label_of_cluster(range_histogram(results, detector=name)).rsplit(" ", 1)[1])
        for name in ("early", "maximum")
    )
    assert early >= 2  # 1e-4 to 2e-4 of the epochs
    assert maximum <= 1


def test_the_limit_of_the_range_check_is_a_line_on_both_sides() -> None:
    lines = range_histogram(with_offsets(np.zeros(3)), limit_m=26.6).lines
    assert [line.get_xdata()[0] for line in lines] == [-26.6, 26.6]
    assert [str(line.get_label()) for line in lines][1] == "range check ±26.6 m"


def test_the_edge_of_the_bank_is_a_line_if_offsets_come_near() -> None:
    (line,) = range_histogram(with_offsets(np.array([0.0, 67.5]))).lines
    assert (line.get_xdata()[0], line.get_label()) == (75.0, "edge of the bank")


@pytest.mark.parametrize("n", [1, 300, 200_000])
def test_the_legend_stands_above_the_highest_bar(n: int) -> None:
    ax = range_histogram(with_offsets(np.append(np.full(n, 67.5), -1.0)), limit_m=26.6)
    ax.figure.draw_without_rendering()
    box = ax.get_legend().get_window_extent()
    assert len(ax.get_legend().get_texts()) == 4
    assert ax.transData.transform((67.5, n))[1] < box.y0


def test_right_flank_is_a_straight_line_over_the_bars() -> None:
    rng = np.random.default_rng(1)
    offsets_m = 4.0 + rng.exponential(1.2, 50_000)
    ax = range_histogram(with_offsets(offsets_m), right_flank=RightFlank(start_m=4.0, scale_m=1.2, events=50_000))
    (line,) = ax.lines
    (x0, x1), (y0, y1) = line.get_data()
    assert x0 == 4.0
    assert np.log(y0 / y1) == pytest.approx((x1 - x0) / 1.2)
    left, height = bars(ax)
    for start, count in zip(left, height, strict=True):
        if count > 200 and start > 4.0:
            middle = start + 0.25
            expected = y0 * np.exp(-(middle - x0) / 1.2)
            assert count == pytest.approx(expected, abs=5 * np.sqrt(expected) + 0.02 * expected)


def test_right_flank_fitted_from_an_offset() -> None:
    offsets_m = 2.0 + np.random.default_rng(2).exponential(1.2, 20_000)
    flank = RightFlank.fitted(offsets_m, 5.0)
    assert flank is not None
    assert flank.events == np.sum(offsets_m > 5.0)
    assert flank.scale_m == pytest.approx(1.2, abs=5 * 1.2 / np.sqrt(flank.events))
    (line,) = range_histogram(with_offsets(offsets_m), right_flank=5).lines
    assert line.get_xdata()[0] == 5.0
    assert line.get_label() == f"exponential, {flank.scale_m:.2f} m"


def test_no_flank_where_nothing_is() -> None:
    assert not range_histogram(with_offsets(np.zeros(5)), right_flank=5).lines
    with pytest.raises(ValueError, match="0 events"):
        RightFlank(start_m=1.0, scale_m=1.0, events=0)
    with pytest.raises(ValueError, match="scale of 0"):
        RightFlank(start_m=1.0, scale_m=0.0, events=3)
