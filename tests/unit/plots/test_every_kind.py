"""What every figure of a campaign must do, whatever the campaign held."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray
from matplotlib.axes import Axes
from PIL import Image

from results_builder import campaign_results, lift_off
from vestige import plots
from vestige.errors import VestigeError
from vestige.plots.figure import figure_of

OF_A_CAMPAIGN: tuple[Callable[..., Axes], ...] = (
    plots.detecting_correlator,
    plots.waterfall,
    plots.waterfall_map,
    plots.magnitude_histogram,
    plots.range_histogram,
    plots.range_offset,
)


def _spoilt() -> xarray.Dataset:
    results = campaign_results(30)
    for name in ("magnitude_sigma", "phase_rad", "range_offset_m", "noise_power"):
        results[name].values[..., 3:9, :] = np.array([np.inf, -np.inf, np.nan, 0.0, -1.0, 1e30])[:, None]
    results["taps"].values[4] = np.inf
    return results


CAMPAIGNS: dict[str, Callable[[], xarray.Dataset]] = {
    "gaps": lambda: campaign_results(200, cn0_dbhz=31.0, unavailable=slice(50, 90)),
    "all missed": lambda: campaign_results(100, cn0_dbhz=5.0),
    "none available": lambda: campaign_results(20, unavailable=slice(0, 20)),
    "one epoch": lambda: campaign_results(1),
    "spoofer": lambda: campaign_results(300, spoofer=lift_off),
    "spoilt": _spoilt,
    "no attributes": lambda: campaign_results(20).assign_attrs({}).drop_attrs(),
}
QUICK = ("gaps", "spoilt")


@pytest.mark.parametrize(
    "campaign", [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in CAMPAIGNS if name not in QUICK)]
)
@pytest.mark.parametrize("draw", OF_A_CAMPAIGN, ids=lambda draw: draw.__name__)
def test_any_campaign_can_be_drawn(draw: Callable[..., Axes], campaign: str) -> None:
    figure_of(draw(CAMPAIGNS[campaign]())).savefig(io.BytesIO(), dpi=60)  # warnings are errors here


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["pdf", "svg"])
@pytest.mark.parametrize("draw", OF_A_CAMPAIGN, ids=lambda draw: draw.__name__)
def test_every_format(tmp_path: Path, draw: Callable[..., Axes], suffix: str) -> None:
    plots.write(draw(campaign_results(50)), tmp_path / f"figure.{suffix}")
    assert (tmp_path / f"figure.{suffix}").stat().st_size > 1000


@pytest.mark.parametrize("draw", OF_A_CAMPAIGN, ids=lambda draw: draw.__name__)
def test_every_axis_has_a_unit_and_the_title_is_short(draw: Callable[..., Axes]) -> None:
    ax = draw(campaign_results(50))
    for one in figure_of(ax).axes:
        for label in filter(None, (one.get_xlabel(), one.get_ylabel())):
            assert label.endswith(("(s)", "(m)", "(σ)", "(rad)")) or label.startswith("epochs per"), label
    assert 0 < len(ax.get_title()) <= 60
    assert "E11" in ax.get_title()


@pytest.mark.slow
@pytest.mark.parametrize("width_cm", [8.0, 12.0])
@pytest.mark.parametrize("draw", OF_A_CAMPAIGN, ids=lambda draw: draw.__name__)
def test_nothing_is_cut_off(tmp_path: Path, draw: Callable[..., Axes], width_cm: float) -> None:
    plots.write(draw(campaign_results(1400, spoofer=lift_off)), tmp_path / "figure.png", width_cm=width_cm)
    with Image.open(tmp_path / "figure.png") as image:
        pixels = np.asarray(image.convert("L"))
    border = np.concatenate([pixels[:2].ravel(), pixels[-2:].ravel(), pixels[:, :2].ravel(), pixels[:, -2:].ravel()])
    assert border.min() == 255


@pytest.fixture(scope="module")
def long_run() -> xarray.Dataset:
    return campaign_results(100_000)


@pytest.mark.slow
@pytest.mark.parametrize("draw", OF_A_CAMPAIGN, ids=lambda draw: draw.__name__)
@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_a_long_run_takes_seconds_and_little_space(
    tmp_path: Path, long_run: xarray.Dataset, draw: Callable[..., Axes], suffix: str
) -> None:
    begin = time.process_time()
    plots.write(draw(long_run), tmp_path / f"figure.{suffix}")
    assert time.process_time() - begin < 5.0  # some 0.3 s
    assert (tmp_path / f"figure.{suffix}").stat().st_size < 1_500_000


@pytest.mark.parametrize("draw", OF_A_CAMPAIGN, ids=lambda draw: draw.__name__)
def test_foreign_results_are_refused(draw: Callable[..., Axes]) -> None:
    with pytest.raises(VestigeError, match="found no"):
        draw(xarray.Dataset({"temperature": ("time", [1.0])}))
