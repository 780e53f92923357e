from __future__ import annotations

import numpy as np
import pytest
import xarray

from results_builder import campaign_results
from vestige.errors import VestigeError
from vestige.plots.epochs import between, is_detected, is_missed, magnitudes_sigma, select, thinned, title_of


@pytest.fixture(scope="module")
def results() -> xarray.Dataset:
    return campaign_results(60, svids=(11, 2), cn0_dbhz=31.0, unavailable=slice(10, 14))


@pytest.mark.parametrize(("svid", "place"), [(11, 0), (2, 1)])
@pytest.mark.parametrize(("detector", "row"), [("early", 0), ("maximum", 1)])
def test_one_satellite_and_one_detector(
    results: xarray.Dataset, svid: int, place: int, detector: str, row: int
) -> None:
    shown = select(results, detector=detector, svid=svid)
    np.testing.assert_array_equal(shown["range_offset_m"], results["range_offset_m"].values[row, :, place])
    np.testing.assert_array_equal(shown["taps"], results["taps"].values[:, place])
    assert title_of("Magnitude", shown) == f"Magnitude, {detector} detector, E{svid:02d}, 31 dBHz"


def test_the_order_of_axes_does_not_matter(results: xarray.Dataset) -> None:
    turned = results.transpose("tap", "satellite", "epoch", "detector")
    np.testing.assert_array_equal(magnitudes_sigma(select(turned, svid=2)), magnitudes_sigma(select(results, svid=2)))


def test_the_only_satellite_needs_no_choice() -> None:
    assert select(campaign_results(3, svids=(7,)))["svid"] == 7


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({}, "no choice of satellite, expected one of 11, 2"),
        ({"svid": 5}, "no satellite 5, expected one of 11, 2"),
        ({"svid": 2, "detector": "late"}, "no detector late, expected early or maximum"),
    ],
)
def test_what_is_not_there_is_named(results: xarray.Dataset, choice: dict[str, object], message: str) -> None:
    with pytest.raises(VestigeError, match=message):
        select(results, **choice)


@pytest.mark.parametrize(
    "name",
    [
        "time_s",
        "taps",
        "noise_power",
        "tap_offset_m",
        "tap_index",
        "magnitude_sigma",
        "phase_rad",
        "range_offset_m",
        "svid",
    ],
)
def test_foreign_results_are_refused(results: xarray.Dataset, name: str) -> None:
    text = xarray.DataArray(np.full(results[name].shape, "text"), dims=results[name].dims)
    for foreign in (
        results.drop_vars(name),
        results.drop_vars(name).assign({name: 1.0}),
        results.drop_vars(name).assign({name: text}),
    ):
        with pytest.raises(VestigeError, match=rf"found.*{name}.*, expected {name}\("):
            select(foreign, svid=2)


@pytest.mark.parametrize("times", [[0.0, 2.0, 1.0], [0.0, np.nan, 2.0], [0.0, 0.0, 1.0]])
def test_times_must_ascend(times: list[float]) -> None:
    with pytest.raises(VestigeError, match="found time_s of 3, expected ascending"):
        select(campaign_results(3).assign(time_s=("epoch", times)))


def test_magnitude_is_in_sigma_per_dimension() -> None:
    results = campaign_results(4)
    results["taps"].values[:] = 3 + 4j
    results["noise_power"].values[:, 0] = [2.0, 8.0, 0.0, np.nan]
    np.testing.assert_allclose(magnitudes_sigma(select(results))[:, 0], [5.0, 2.5, np.nan, np.nan])


def test_every_epoch_is_detected_missed_or_not_available(results: xarray.Dataset) -> None:
    shown = select(results, svid=11)
    detected, missed = is_detected(shown), is_missed(shown)
    assert detected.sum() > 10
    assert missed.sum() > 5
    np.testing.assert_array_equal(np.flatnonzero(~(detected | missed)), np.arange(10, 14))
    assert not (detected & missed).any()


@pytest.mark.parametrize(
    ("start_s", "stop_s", "expected"),
    [(None, None, range(60)), (5.0, None, range(5, 60)), (None, 5.0, range(5)), (4.5, 7.5, range(5, 8))],
)
def test_between(results: xarray.Dataset, start_s: float | None, stop_s: float | None, expected: range) -> None:
    assert between(results, start_s, stop_s)["time_s"].values.tolist() == list(expected)


def test_an_empty_stretch_is_refused(results: xarray.Dataset) -> None:
    with pytest.raises(VestigeError, match="found 0 to 59 s, expected an epoch from 100 s to 200 s"):
        between(results, 100.0, 200.0)
    with pytest.raises(VestigeError, match="found 0 to 59 s, expected an epoch to 0 s"):
        between(results, None, 0.0)


@pytest.mark.parametrize("n", [1, 89, 90, 91, 180, 181, 100_000])
def test_thinning_keeps_the_limit_and_more_than_half_of_it(n: int) -> None:
    kept = np.arange(n)[thinned(n, 90)]
    assert min(n, 45) <= kept.size <= 90
    assert kept[0] == 0
    assert np.unique(np.diff(kept)).size <= 1
