"""The tables of a sky: what they describe, and one line with its place for whatever does not fit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sky_builder import SCENARIO, sky_scenario
from vestige.errors import VestigeError
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.receiver.sky.trajectory import WaypointTrajectory
from vestige.recording.navigation.rinex_navigation import write_rinex_navigation
from vestige.scenario.warnings import scenario_warnings
from vestige.time import GalileoTime

WAYPOINTS = "time_s,latitude_deg,longitude_deg,height_m\n"


@pytest.mark.parametrize(
    ("setting", "place"),
    [
        ("trajectory=none", "trajectory"),
        ("constellation=none", "trajectory"),
        ("constellation.svids=[30]", "constellation.svids"),
        ("line_of_sight.v_mps=3.0", "line_of_sight"),
        ('trajectory={kind="static", latitude_deg=91, longitude_deg=0}', "latitude_deg"),
        ('trajectory={kind="circle", latitude_deg=1, longitude_deg=0, radius_m=1, speed_mps=900}', "speed_mps"),
        ('constellation.kind="kepler"', "constellation.kind"),
        ('constellation={kind="rinex", path="no.rnx"}', "no.rnx"),
        ('trajectory={kind="waypoints", path="no.csv"}', "no.csv"),
        ("recs.every=0", "recs.every"),
    ],
)
def test_what_does_not_fit_is_one_line_with_its_place(setting: str, place: str) -> None:
    with pytest.raises((VestigeError, OSError)) as caught:
        sky_scenario(setting)
    assert place in str(caught.value)
    assert "\n" not in str(caught.value)


def test_recs_between_epochs_belong_to_a_sky() -> None:
    with pytest.raises(VestigeError, match=r"recs\.every"):
        sky_scenario("recs.every=30", path=SCENARIO.with_name("quick.toml"))


def test_no_satellite_is_in_view() -> None:
    with pytest.raises(VestigeError, match="no satellite in view"):
        sky_scenario("constellation.svids=[1]", "epochs=3")


def test_a_chosen_satellite_below_the_mask_gives_a_warning() -> None:
    night = SCENARIO.with_name("night.toml")
    (line,) = scenario_warnings(sky_scenario("constellation.svids=[6, 7, 1, 2]", path=night))
    assert line == (
        "constellation.svids: E01, E02 left out, because never above mask_deg = 9 in this run; "
        "the scenario has E06, E07"
    )
    assert scenario_warnings(sky_scenario("constellation.svids=[6, 7]", path=night)) == ()


@pytest.mark.parametrize(("last_s", "fits"), [(59.0, False), (60.0, False), (61.0, True)])
def test_waypoints_reach_over_the_whole_run(tmp_path: Path, last_s: float, fits: bool) -> None:
    (tmp_path / "way.csv").write_text(f"{WAYPOINTS}0,48.1,11.6,500\n{last_s},48.2,11.7,600\n", encoding="utf-8")
    (tmp_path / "sky.toml").write_text(SCENARIO.read_text(encoding="utf-8"), encoding="utf-8")
    settings = ("epochs=60", 'trajectory={kind="waypoints", path="way.csv"}')
    if not fits:
        with pytest.raises(VestigeError, match=r"trajectory\.path"):
            sky_scenario(*settings, path=tmp_path / "sky.toml")
        return
    scenario = sky_scenario(*settings, path=tmp_path / "sky.toml")
    effects = scenario.simulations[0].elevation
    assert effects is not None
    assert isinstance(effects.path.trajectory, WaypointTrajectory)


@pytest.mark.parametrize(
    ("rows", "found"),
    [
        ("-10,48.1,11.6,500\n70,-48.1,11.6,500\n", "speed 1.18e+05 m/s at waypoint 1"),
        (
            "-10,48,11,0\n30,48,11,0\n31,48,11.01,0\n32,48,11,0\n70,48,11,0\n",
            "acceleration 2.28e+03 m/s² at waypoint 3",
        ),
    ],
)
def test_waypoints_that_no_receiver_passes(tmp_path: Path, rows: str, found: str) -> None:
    """The first is a chord of nearly 1.5 radii of the Earth in 80 s, the second 746 m to the east for a moment.

    With legs of 40, 1, 1 and 38 s the equations of the natural spline give −12.15/3.975 of that as the middle's bend.
    """
    (tmp_path / "way.csv").write_text(WAYPOINTS + rows, encoding="utf-8")
    (tmp_path / "sky.toml").write_text(SCENARIO.read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(VestigeError) as caught:
        sky_scenario("epochs=60", 'trajectory={kind="waypoints", path="way.csv"}', path=tmp_path / "sky.toml")
    assert f"trajectory.path: found {found}, expected at most" in str(caught.value)


def test_a_satellite_out_of_service_is_left_out(tmp_path: Path) -> None:
    start = GalileoTime.parse("2026-11-21T16:00:00 GST")
    ephemerides = [replace(one, e1b_health=int(one.svid == 7)) for one in walker_ephemerides(start)]
    write_rinex_navigation(tmp_path / "sky.rnx", ephemerides)
    (tmp_path / "sky.toml").write_text(SCENARIO.read_text(encoding="utf-8"), encoding="utf-8")
    table = 'constellation={kind="rinex", path="sky.rnx", mask_deg=5.0}'
    scenario = sky_scenario(table, path=tmp_path / "sky.toml")
    svids = [one.svid for one in scenario.simulations]
    assert 7 not in svids
    assert {6, 8, 12, 13, 14, 23, 24} <= set(svids)


def test_each_satellite_has_the_strength_of_its_elevation_at_the_first_epoch() -> None:
    scenario = sky_scenario()
    assert [one.svid for one in scenario.simulations] == [6, 7, 8, 12, 13, 14, 23, 24]
    for one in scenario.simulations:
        assert one.elevation is not None
        assert one.cn0_e1_dbhz == pytest.approx(45 - 9 * (1 - np.sin(one.elevation.first_rad)))
        assert (one.n_epochs, one.interval_s, one.truth_interval_s) == (120, 30.0, 1.0)


def test_a_run_that_outlasts_the_orbits_of_a_file_gets_a_word(tmp_path: Path) -> None:
    """The toe is an hour before the start: three hours are left of four. Walker's orbits hold for ever."""
    write_rinex_navigation(tmp_path / "day.rnx", walker_ephemerides(GalileoTime.parse("2026-11-21T15:00:00 GST")))
    text = SCENARIO.read_text(encoding="utf-8").replace('kind = "walker"', 'kind = "rinex"\npath = "day.rnx"')
    (tmp_path / "day.toml").write_text(text, encoding="utf-8")
    step = "interval_s=30.0"
    assert scenario_warnings(sky_scenario("epochs=360", step, path=tmp_path / "day.toml")) == ()
    (line,) = scenario_warnings(sky_scenario("epochs=1440", step, path=tmp_path / "day.toml"))
    assert line.startswith("constellation.path: the run ends 13.0 h after the toe of 2026-11-21T15:00:00")
    assert scenario_warnings(sky_scenario("epochs=1440", step)) == ()
