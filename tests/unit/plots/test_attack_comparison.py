from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import xarray
from PIL import Image

from results_builder import campaign_results, lift_off
from vestige import plots
from vestige.errors import VestigeError
from vestige.plots.attacks.attack_comparison import attack_comparison
from vestige.plots.figure import BLUE, GREEN, ORANGE, RED, figure_of


def test_each_detector_has_its_axes_and_the_truth_lies_over_both() -> None:
    results = campaign_results(1400, cn0_dbhz=33.0, spoofer=lift_off)
    results["truth_spoofer_power_db"].values[:100] = -np.inf
    power, *offsets = figure_of(attack_comparison(results)).axes
    assert power.get_ylabel() == "power (dB)"
    assert [ax.get_title() for ax in offsets] == ["early detector", "maximum detector"]
    delay_m, amplitude = lift_off(results["time_s"].values)
    true_m = results["truth_prediction_error_m"].values[:, 0]
    for number, ax in enumerate(offsets):
        lines = {line.get_color(): np.asarray(line.get_ydata()) for line in ax.lines}
        np.testing.assert_array_equal(lines[BLUE], results["range_offset_m"].values[number, :, 0])
        np.testing.assert_array_equal(lines[GREEN], true_m)
        assert np.isnan(lines[ORANGE][:100]).all()
        np.testing.assert_allclose(lines[ORANGE][100:], (true_m + delay_m)[100:])
        assert lines[RED].size == np.count_nonzero(results["tap_index"].values[number, :, 0] < 0)
    (power_db,) = (np.asarray(line.get_ydata()) for line in power.lines if line.get_color() == ORANGE)
    np.testing.assert_allclose(power_db[100:], 20 * np.log10(amplitude[100:]), atol=1e-5)


def test_what_lies_beyond_the_correlators_is_not_in_view() -> None:
    results = campaign_results(50, cn0_dbhz=50.0, spoofer=lambda t: (np.full(t.shape, 3e5), np.ones(t.shape)))
    low_m, high_m = figure_of(attack_comparison(results)).axes[1].get_ylim()
    assert -40 < low_m < -10
    assert 10 < high_m < 40


def test_the_edge_of_the_bank_explains_offsets_that_no_longer_change() -> None:
    results = campaign_results(50, cn0_dbhz=50.0, spoofer=lambda t: (np.full(t.shape, 90.0), np.full(t.shape, 4.0)))
    _, *offsets = figure_of(attack_comparison(results)).axes
    for ax in offsets:
        (edge,) = (line for line in ax.lines if line.get_label() == "edge of the bank")
        assert edge.get_ydata()[0] == 75.0
        assert ax.get_ylim()[1] > 80.0
    labels = [text.get_text() for text in figure_of(offsets[0]).legends[0].get_texts()]
    assert labels == ["true signal", "spoofer", "measured", "not detected", "edge of the bank"]


def test_units_width_and_borders(tmp_path: Path) -> None:
    ax = attack_comparison(campaign_results(1400, spoofer=lift_off))
    for one in figure_of(ax).axes:
        for label in filter(None, (one.get_xlabel(), one.get_ylabel())):
            assert label.endswith(("(s)", "(m)", "(dB)"))
    plots.write(ax, tmp_path / "a.png", width_cm=8.0)
    with Image.open(tmp_path / "a.png") as image:
        pixels = np.asarray(image.convert("L"))
    border = np.concatenate([pixels[:2].ravel(), pixels[-2:].ravel(), pixels[:, :2].ravel(), pixels[:, -2:].ravel()])
    assert border.min() == 255


@pytest.mark.parametrize(
    "results",
    [
        campaign_results(2, spoofer=lift_off).isel(epoch=slice(0, 1)),
        campaign_results(20, spoofer=lift_off, unavailable=slice(0, 20)),
        campaign_results(20, spoofer=lambda t: (np.zeros(t.shape), np.full(t.shape, 1e-9))),
    ],
    ids=["one epoch", "none available", "nearly nothing"],
)
def test_any_attack_can_be_drawn(results: xarray.Dataset) -> None:
    figure_of(attack_comparison(results)).savefig(io.BytesIO(), dpi=60)


def test_a_campaign_without_an_attack_is_refused() -> None:
    with pytest.raises(VestigeError, match="found no attack"):
        attack_comparison(campaign_results(5))


def test_the_phase_is_against_that_of_e1_if_it_is_stored() -> None:
    known = campaign_results(60, cn0_dbhz=50.0, spoofer=lambda t: (np.zeros(t.shape), np.full(t.shape, 1e-6)))
    right = figure_of(plots.detecting_correlator(known)).axes[1]
    assert np.max(np.abs(right.lines[0].get_ydata())) < 0.5
    assert [text.get_text() for text in right.texts] == ["phase against the carrier phase of E1"]
    plain = campaign_results(60, cn0_dbhz=50.0)
    right = figure_of(plots.detecting_correlator(plain)).axes[1]
    np.testing.assert_array_equal(right.lines[0].get_ydata(), plain["phase_rad"].values[0, :, 0])
    assert not right.texts


def test_a_detector_of_the_users_is_drawn_too(tmp_path: Path) -> None:
    results = campaign_results(12, spoofer=lift_off)
    own = results.isel(detector=[0]).assign_coords(detector=["my_detector:First"])
    of_detector = [name for name in results.data_vars if "detector" in results[name].dims]
    three = results.drop_dims("detector").merge(xarray.concat([results[of_detector], own[of_detector]], "detector"))
    three.attrs = results.attrs
    titles = [ax.get_title() for ax in figure_of(attack_comparison(three)).axes[1:]]
    assert titles == ["early detector", "maximum detector", "my_detector:First detector"]
    assert plots.write_animation(three, tmp_path / "three.gif") == 12
