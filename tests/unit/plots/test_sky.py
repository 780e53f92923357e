from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray
from click.testing import CliRunner

from sky_builder import sky_scenario
from vestige import plots
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import proportion
from vestige.cli.campaigns.plot import command
from vestige.errors import VestigeError


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sky") / "sky.zarr"
    run(ScenarioPlan(scenario=sky_scenario("epochs=61")), path)
    return path


@pytest.mark.parametrize("kind", ["sky", "position", "monitors", "decision-map"])
def test_each_figure_is_one_command(store: Path, tmp_path: Path, kind: str) -> None:
    result = CliRunner().invoke(command, [kind, str(store), "-o", str(tmp_path / "a.png")], catch_exceptions=False)
    assert result.exit_code == 0
    assert (tmp_path / "a.png").stat().st_size > 5000


@pytest.mark.parametrize(
    ("kind", "settings", "options", "text"),
    [
        ("position", ("constellation.svids=[7]",), [], "found no position fix"),
        ("decision-map", (), ["--svid", "1"], "found no 1, expected one of 6, 7"),
    ],
)
def test_what_cannot_be_drawn_is_one_line(
    tmp_path: Path, kind: str, settings: tuple[str, ...], options: list[str], text: str
) -> None:
    run(ScenarioPlan(scenario=sky_scenario("epochs=5", *settings)), tmp_path / "sky")
    with pytest.raises(VestigeError, match=text):
        CliRunner().invoke(
            command,
            [kind, str(tmp_path / "sky"), "-o", str(tmp_path / "a.png"), *options],
            catch_exceptions=False,
        )


def test_a_check_that_was_not_run_says_so() -> None:
    never, always = np.zeros(3, bool), np.ones(3, bool)
    lines = [plots.MonitorLine(name=name, run=run, failed=never) for name, run in (("a", never), ("b", always))]
    ax = plots.monitor_timeline(np.arange(3.0), lines)
    assert [(text.get_text(), text.get_position()[1]) for text in ax.texts] == [("not run", 0)]


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


def test_no_name_crosses_the_circle_of_the_horizon() -> None:
    azimuth_deg, elevation_deg = np.meshgrid(np.arange(0.0, 360.0, 15.0), [0.0, 5.0, 15.0, 30.0])
    results = xarray.Dataset(
        {
            "elevation_deg": (("epoch", "satellite"), elevation_deg.reshape(1, -1)),
            "azimuth_deg": (("epoch", "satellite"), azimuth_deg.reshape(1, -1)),
        },
        coords={"svid": ("satellite", np.arange(azimuth_deg.size) % 36 + 1)},
    )
    ax = plots.sky_plot(results)
    ax.figure.draw_without_rendering()
    centre, radius = ax.transAxes.transform((0.5, 0.5)), np.ptp(ax.transAxes.transform([(0, 0), (1, 0)])[:, 0]) / 2
    for name, low in zip(ax.texts, elevation_deg.ravel(), strict=True):
        corners = name.get_window_extent().corners() - centre
        if low > 0:
            assert np.hypot(*corners.T).max() < radius


def test_each_axis_of_the_error_has_a_panel() -> None:
    error = np.arange(12.0).reshape(2, 2, 3)
    results = xarray.Dataset(
        {
            "time_s": ("epoch", np.array([0.0, 30.0])),
            "fix_error_m": (("fix", "epoch", "local_axis"), error),
            "fix_clock_error_m": (("fix", "epoch"), np.array([[20.0, 21.0], [22.0, 23.0]])),
        },
        coords={"fix": ["all", "authenticated"], "local_axis": ["east", "north", "up"]},
    )
    panels = plots.position_error(results).figure.axes
    assert [ax.get_ylabel() for ax in panels] == ["east (m)", "north (m)", "up (m)", "clock (m)"]
    for number, ax in enumerate(panels[:3]):
        every, authenticated = ax.lines[:2]
        assert every.get_ydata() == pytest.approx(error[0, :, number])
        assert authenticated.get_ydata() == pytest.approx(error[1, :, number])
    assert panels[3].lines[1].get_ydata() == pytest.approx([22.0, 23.0])


def test_curves_of_checks_stand_at_their_strengths() -> None:
    seen = {"RAIM": [proportion(0, 10), proportion(10, 10)], "range": [proportion(5, 10), proportion(9, 10)]}
    ax = plots.check_curves((1.0, 100.0), seen, title="pull", label="m", log=True)
    assert [line.get_label() for line in ax.lines] == ["RAIM", "range"]
    assert ax.lines[1].get_ydata() == pytest.approx([0.5, 0.9])
    assert ax.lines[0].get_xdata() == pytest.approx([1.0, 100.0], rel=0.05)
    assert len(ax.collections) == 2


def test_failures_are_marked_where_they_are() -> None:
    line = plots.MonitorLine(name="RAIM", run=np.ones(4, bool), failed=np.array([False, True, False, True]))
    ax = plots.monitor_timeline(np.arange(4.0), [line])
    assert ax.lines[-1].get_xdata() == pytest.approx(np.array([1.0, 3.0]))


def test_results_without_a_sky_are_refused() -> None:
    for draw in (plots.sky_plot, plots.position_error):
        with pytest.raises(VestigeError, match="constellation"):
            draw(xarray.Dataset())
