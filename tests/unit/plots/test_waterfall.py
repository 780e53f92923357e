from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.axes import Axes

from results_builder import campaign_results
from vestige.plots.attacks.waterfall import LABELLED_TAPS, MAP_COLUMNS, SLICES, waterfall, waterfall_map
from vestige.plots.figure import new_axes


def test_the_map_is_the_magnitude_of_every_tap() -> None:
    results = campaign_results(30, unavailable=slice(7, 9))
    ax = waterfall_map(results)
    (mesh,) = ax.collections
    sigma = np.sqrt(results["noise_power"].values / 2)
    expected = (np.abs(results["taps"].values[:, 0]) / sigma).T
    drawn = np.ma.filled(mesh.get_array(), np.nan)
    np.testing.assert_allclose(drawn, expected, rtol=1e-6)
    assert np.isnan(drawn[:, 7:9]).all()
    assert np.isfinite(np.delete(drawn, [7, 8], axis=1)).all()
    corners = mesh.get_coordinates()
    np.testing.assert_allclose(corners[0, :, 0], np.arange(31) - 0.5)
    np.testing.assert_allclose(corners[:, 0, 1], np.arange(-82.5, 83, 15))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time (s)", "correlator offset (m)")
    assert ax.figure.axes[1].get_ylabel() == "magnitude (σ)"


def test_the_triangle_stands_where_the_signal_is() -> None:
    (mesh,) = waterfall_map(campaign_results(500, cn0_dbhz=50.0)).collections
    mean = np.asarray(mesh.get_array()).mean(axis=1)
    assert np.argmax(mean) == 5
    assert mean[5] == pytest.approx(np.sqrt(2 * 1e5 * 0.016), rel=0.1)
    assert mean[0] < 0.05 * mean[5]  # 75 m are more than a chip


def test_the_landscape_is_the_magnitude_of_every_tap() -> None:
    results = campaign_results(20)
    ax = waterfall(results)
    (surface,) = ax.collections
    sigma = np.sqrt(results["noise_power"].values / 2)
    z = np.abs(results["taps"].values[:, 0]) / sigma
    facets = (z[:-1, :-1] + z[1:, :-1] + z[:-1, 1:] + z[1:, 1:]) / 4
    np.testing.assert_allclose(np.asarray(surface.get_array()), facets.ravel(), rtol=1e-5)
    assert ax.get_zlim()[1] >= z.max()
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_zlabel()) == ("offset (m)", "time (s)", "magnitude (σ)")


def test_long_runs_are_thinned_to_what_can_be_seen() -> None:
    results = campaign_results(5000)
    (surface,) = waterfall(results).collections
    (mesh,) = waterfall_map(results).collections
    rows = surface.get_array().size / (results.sizes["tap"] - 1) + 1
    assert SLICES / 2 <= rows <= SLICES
    assert MAP_COLUMNS / 2 <= mesh.get_array().shape[1] <= MAP_COLUMNS
    every = results["taps"].values[::4, 0] / np.sqrt(results["noise_power"].values[::4] / 2)
    np.testing.assert_allclose(np.asarray(mesh.get_array()), np.abs(every).T, rtol=1e-6)


def test_epochs_without_recs_are_not_drawn() -> None:
    results = campaign_results(301, unavailable=slice(90, 91))
    with_recs = np.arange(301) % 30 == 0
    results["recs"] = ("epoch", with_recs)
    results["taps"].values[~with_recs] = np.nan
    (mesh,) = waterfall_map(results).collections
    drawn = np.ma.filled(mesh.get_array(), np.nan)
    assert drawn.shape == (11, 11)
    np.testing.assert_array_equal(np.isnan(drawn).any(axis=0), np.arange(11) == 3)  # E1 was not tracked at 90 s
    np.testing.assert_allclose(mesh.get_coordinates()[0, :, 0], np.arange(-15, 316, 30))
    (surface,) = waterfall(results).collections
    assert np.asarray(surface.get_array()).size == 10 * 10


@pytest.mark.parametrize(("n_early", "step_m"), [(5, 30.0), (6, 30.0), (20, 75.0), (40, 150.0), (100, 300.0)])
@pytest.mark.parametrize("draw", [waterfall, waterfall_map], ids=lambda draw: draw.__name__)
def test_ticks_stand_at_taps_and_do_not_overlap(draw: Callable[..., Axes], n_early: int, step_m: float) -> None:
    results = campaign_results(3)
    n_taps = n_early + 6
    results = results.isel(tap=np.resize(np.arange(11), n_taps)).assign_coords(
        tap_offset_m=("tap", 15.0 * np.arange(-n_early, 6))
    )
    ax = draw(results)
    axis = ax.xaxis if draw is waterfall else ax.yaxis
    low, high = axis.get_view_interval()
    ticks = [tick for tick in axis.get_majorticklocs() if low <= tick <= high]
    assert 0.0 in ticks
    assert len(ticks) <= LABELLED_TAPS
    np.testing.assert_allclose(np.diff(ticks), step_m)


def test_a_single_epoch_has_a_map() -> None:
    (mesh,) = waterfall_map(campaign_results(1)).collections
    assert mesh.get_array().shape == (11, 1)


def test_a_landscape_needs_space() -> None:
    with pytest.raises(ValueError, match="3d"):
        waterfall(campaign_results(5), ax=new_axes())
    space = new_axes(projection="3d")
    assert waterfall(campaign_results(5), ax=space) is space
