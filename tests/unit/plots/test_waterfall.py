from __future__ import annotations

import numpy as np
import pytest

from results_builder import campaign_results
from vestige.plots.attacks.waterfall import MAP_COLUMNS, SLICES, waterfall, waterfall_map
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


def test_a_single_epoch_has_a_map() -> None:
    (mesh,) = waterfall_map(campaign_results(1)).collections
    assert mesh.get_array().shape == (11, 1)


def test_a_landscape_needs_space() -> None:
    with pytest.raises(ValueError, match="3d"):
        waterfall(campaign_results(5), ax=new_axes())
    space = new_axes(projection="3d")
    assert waterfall(campaign_results(5), ax=space) is space
