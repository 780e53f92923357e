"""The truth of the receiver in a test case: a fix out of the observations is where the files say that it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import ecef_from_geodetic
from vestige.navigation.position_fix import position_fix, transmission, velocity_fix
from vestige.recording.observations.observation_file import open_observations
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase, with_default_range
from vestige.simulated.exported_case_folder import write_companions

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
CIRCLE = 'trajectory={kind="circle", latitude_deg=48.1, longitude_deg=11.6, radius_m=100.0, speed_mps=20.0}'


def test_an_exact_fix_of_the_observations_is_the_truth_of_the_receiver(tmp_path: Path) -> None:
    """A car on a circle: what is 86 ms away is 1.7 m away. Its clock walks."""
    scenario = load_scenario(SCENARIOS / "night.toml", ("receiver.e1_tracking=none", CIRCLE))
    assert isinstance(scenario, CampaignScenario)
    write_companions(AcasTestCase(scenario=scenario, first=28, end=33), tmp_path)
    truth = np.genfromtxt(tmp_path / "receiver_truth.csv", delimiter=",", names=True)
    assert truth["epoch"].tolist() == [28, 29, 30, 31, 32]
    place_m = np.stack([truth[name] for name in ("x_m", "y_m", "z_m")], axis=1)
    geodetic = np.radians(truth["latitude_deg"]), np.radians(truth["longitude_deg"]), truth["height_m"]
    assert np.allclose(ecef_from_geodetic(*geodetic), place_m, rtol=0, atol=1e-6)

    start = scenario.start_time
    orbits = {one.svid: one.elevation.path.ephemeris for one in scenario.simulations if one.elevation is not None}
    epochs = list(open_observations(tmp_path / "observations.csv"))
    assert [epoch.time.week for epoch in epochs] == truth["gst_week"].tolist()
    assert [epoch.time.second + epoch.time.fraction for epoch in epochs] == pytest.approx(truth["gst_second"], abs=1e-9)
    tag_s = np.array([epoch.time - start for epoch in epochs])
    seen = [[epoch.observations[svid] for svid in orbits] for epoch in epochs]
    range_m = np.array([[one.pseudorange_m for one in row] for row in seen])
    rate_mps = -SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ * np.array([[one.doppler_hz for one in row] for row in seen])
    sent = transmission(tuple(orbits.values()), start, tag_s, range_m)
    fix = position_fix(sent, range_m, np.ones_like(range_m))
    assert np.allclose(fix.position_m, place_m, rtol=0, atol=1e-3)
    assert np.allclose(fix.clock_m, truth["clock_m"], rtol=0, atol=1e-3)
    velocity_mps, drift_mps = velocity_fix(sent, fix, rate_mps)
    moved_mps = np.stack([truth[name] for name in ("vx_mps", "vy_mps", "vz_mps")], axis=1)
    assert np.allclose(np.linalg.norm(moved_mps, axis=1), 20.0)
    assert np.allclose(velocity_mps, moved_mps, rtol=0, atol=1e-3)
    assert np.allclose(drift_mps, truth["clock_drift_mps"], rtol=0, atol=1e-3)

    lines = (tmp_path / "rinex" / "observations.rnx").read_text().splitlines()
    (header,) = [line for line in lines if line[60:].startswith("APPROX POSITION XYZ")]
    assert [float(header[at : at + 14]) for at in (0, 14, 28)] == pytest.approx(place_m[0], abs=1e-4)
    assert "  receiver_truth.csv   " in (tmp_path / "README.txt").read_text()


def test_a_single_line_of_sight_has_no_place(tmp_path: Path) -> None:
    scenario = load_scenario(SCENARIOS / "quick.toml", ("recs.duration_ms=1",))
    assert isinstance(scenario, CampaignScenario)
    case = AcasTestCase(scenario=with_default_range(scenario), first=0, end=1)
    assert not list(case.receivers())
    write_companions(case, tmp_path)
    assert not (tmp_path / "receiver_truth.csv").exists()
    assert "receiver_truth" not in (tmp_path / "README.txt").read_text()
    lines = (tmp_path / "rinex" / "observations.rnx").read_text().splitlines()
    assert [line[:42].split() for line in lines if "APPROX POSITION" in line] == [["0.0000"] * 3]
