from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray
from click.testing import CliRunner
from tests.sky_builder import sky_scenario

from vestige import plots
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.cli.plot import command
from vestige.errors import VestigeError


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sky") / "sky.zarr"
    run(ScenarioPlan(scenario=sky_scenario("epochs=61")), path)
    return path


@pytest.mark.parametrize("kind", ["sky", "position", "monitors"])
def test_each_figure_is_one_command(store: Path, tmp_path: Path, kind: str) -> None:
    result = CliRunner().invoke(command, [kind, str(store), "-o", str(tmp_path / "a.png")], catch_exceptions=False)
    assert result.exit_code == 0
    assert (tmp_path / "a.png").stat().st_size > 5000


def test_satellites_stand_where_they_are() -> None:
    results = xarray.Dataset(
        {
            "elevation_deg": (("epoch", "satellite"), np.array([[30.0, np.nan], [60.0, np.nan]])),
            "azimuth_deg": (("epoch", "satellite"), np.array([[90.0, np.nan], [180.0, np.nan]])),
        },
        coords={"svid": ("satellite", np.array([7, 8]))},
    )
    ax = plots.sky_plot(results)
    path, dot = ax.lines
    assert path.get_xydata() == pytest.approx(np.array([[np.pi / 2, 60.0], [np.pi, 30.0]]))
    assert dot.get_xydata() == pytest.approx(np.array([[np.pi, 30.0]]))
    assert [text.get_text() for text in ax.texts] == ["E07"]


def test_failures_are_marked_where_they_are() -> None:
    line = plots.MonitorLine(name="RAIM", run=np.ones(4, bool), failed=np.array([False, True, False, True]))
    ax = plots.monitor_timeline(np.arange(4.0), [line])
    assert ax.lines[-1].get_xdata() == pytest.approx(np.array([1.0, 3.0]))


def test_results_without_a_sky_are_refused() -> None:
    for draw in (plots.sky_plot, plots.position_error):
        with pytest.raises(VestigeError, match="constellation"):
            draw(xarray.Dataset())
