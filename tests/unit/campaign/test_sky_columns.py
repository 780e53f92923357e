"""A sky: satellites with streams of their own on one clock, fixes that are unbiased and consistent.

Error budgets: statistics of fixed seeds are compared two-sided at 1e-6 each.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sky_builder import CLEAN, SCENARIO, columns_of, sky_scenario
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.recording.navigation.rinex_navigation import write_rinex_navigation
from vestige.records import Status
from vestige.time import GalileoTime

PUSH = (
    'attack=[{kind="position-push", svids=[7, 13], start_s=30, '
    'delay_m={kind="ramp", first=0, last=90, start_s=60, stop_s=150}, power_db=6}]'
)
HALF_MINUTES = ("epochs=8", "interval_s=30.0", "recs.every=1")
NO_ERRORS = (*CLEAN, "receiver.e1_tracking=none")
AUTHENTIC, NOT_AVAILABLE = (list(Status).index(one) for one in (Status.AUTHENTIC, Status.NOT_AVAILABLE))


@pytest.fixture(scope="module")
def clean() -> dict[str, np.ndarray]:
    """An hour at 4 s: the noise of the loops has forgotten the epoch before."""
    return columns_of(sky_scenario(*CLEAN, "epochs=900", "interval_s=4.0", "recs.every=8"))


@pytest.mark.parametrize(
    ("fidelity", "epochs", "chunk"), [("correlators", 40, 17), pytest.param("samples", 12, 5, marks=pytest.mark.slow)]
)
def test_any_cut_gives_the_same_bits(fidelity: str, epochs: int, chunk: int) -> None:
    scenario = sky_scenario(f"epochs={epochs}", "interval_s=4.0", "recs.every=8", f'fidelity="{fidelity}"', PUSH)
    whole, pieces = columns_of(scenario), columns_of(scenario, chunk=chunk)
    for name, values in whole.items():
        assert values.tobytes() == pieces[name].tobytes(), name


def test_two_workers_and_a_store(tmp_path: Path) -> None:
    scenario = sky_scenario("epochs=40", "recs.every=10")
    expected = columns_of(scenario)
    results = run(ScenarioPlan(scenario=scenario), tmp_path / "sky", workers=2, executor="threads", chunk_epochs=14)
    for name, values in expected.items():
        assert results[name].values.tobytes() == values.tobytes(), name
    assert list(results["svid"].values) == [6, 7, 8, 12, 13, 14, 23, 24]


@pytest.mark.parametrize(
    "trajectory",
    [
        '{kind="static", latitude_deg=48.1, longitude_deg=11.6}',
        '{kind="circle", latitude_deg=-33.9, longitude_deg=18.4, radius_m=2000, speed_mps=60}',
    ],
)
def test_without_errors_the_fix_is_the_truth_through_a_weeks_end(trajectory: str) -> None:
    start = 'start="2026-11-21T23:59:40 GST"'  # week 1422 begins 20 s later
    settings = ("epochs=40", "recs.every=10", "constellation.svids=none", f"trajectory={trajectory}")
    found = columns_of(sky_scenario(*NO_ERRORS, start, *settings))
    assert GalileoTime.parse("2026-11-21T23:59:40 GST").second == 604_780
    assert np.all(found["fix_satellites"][0] >= 5)
    assert np.max(np.abs(found["fix_error_m"][0])) < 1e-3
    assert np.max(np.abs(found["fix_clock_error_m"][0])) < 1e-3
    assert np.max(np.abs(found["fix_drift_error_mps"][0])) < 1e-4
    assert np.max(np.abs(np.diff(found["truth_clock_m"]))) > 0.01


def test_the_ionosphere_of_e1_belongs_to_that_of_the_difference() -> None:
    """I1 = (I6 − I1)/(γ − 1) with γ = (154/125)², and as much of it as the satellite is low."""
    settings = [one for one in NO_ERRORS if "ionosphere" not in one]
    found = columns_of(sky_scenario(*settings, "epochs=5"))
    error_m = found["e1_pseudorange_m"] - found["truth_range_m"] - found["truth_clock_m"][:, None]
    assert np.min(np.abs(error_m)) > 1e-3
    assert error_m == pytest.approx(found["truth_iono_diff_m"] / ((154 / 125) ** 2 - 1), abs=1e-6)


def test_a_clock_that_is_far_off_moves_only_the_clock() -> None:
    bad = ("receiver.clock.h0_s=1e-17", "receiver.clock.h_minus_2_hz=1e-15")
    found = columns_of(sky_scenario(*NO_ERRORS, *bad, "epochs=300"))
    assert np.max(np.abs(found["truth_clock_m"])) > 10_000  # 30 microseconds: 0.1 m of satellite motion
    assert np.max(np.abs(found["fix_error_m"][0])) < 2e-3
    assert np.max(np.abs(found["fix_clock_error_m"][0])) < 2e-3


def test_recs_come_every_so_many_epochs(clean: dict[str, np.ndarray]) -> None:
    recs = np.arange(900) % 8 == 0
    assert np.array_equal(clean["recs"], recs)
    assert np.array_equal(np.isfinite(clean["noise_power"]).all(axis=1), recs)
    assert not np.isfinite(clean["noise_power"][~recs]).any()
    assert np.all(clean["status"][~recs] == NOT_AVAILABLE)
    assert np.all(clean["status"][recs] == AUTHENTIC)
    assert np.array_equal(np.isfinite(clean["fix_clock_m"][1]), recs)
    late_s = clean["available_at_s"][1] - clean["time_s"]
    assert np.all(
        (late_s[recs] > 30) & (late_s[recs] <= 62)
    )  # the key of the next subframe, 1 s after it has been sent
    assert np.array_equal(clean["available_at_s"][0], clean["time_s"])


def test_a_satellite_that_rises_is_not_there_before() -> None:
    found = columns_of(sky_scenario("constellation.svids=none", "epochs=180", "interval_s=20.0", "recs.every=2"))
    elevation_deg = found["elevation_deg"]
    there = np.isfinite(elevation_deg)
    partly = there.any(axis=0) & ~there.all(axis=0)
    assert partly.any()
    assert np.nanmin(elevation_deg) >= 5.0
    for name in ("e1_pseudorange_m", "e1_doppler_hz", "e1_sigma_m", "e1_cn0_dbhz"):
        assert np.array_equal(np.isfinite(found[name]), there), name
    assert not np.isfinite(found["noise_power"][~there]).any()
    assert np.all(found["status"][~there] == NOT_AVAILABLE)
    assert np.array_equal(found["fix_satellites"][0], there.sum(axis=1))


def test_a_push_of_some_satellites_moves_the_position_and_is_seen_by_raim() -> None:
    found = columns_of(sky_scenario(*CLEAN, *HALF_MINUTES, PUSH))
    svids = np.array([6, 7, 8, 12, 13, 14, 23, 24])
    assert np.array_equal(found["truth_e1_captured"][-1], np.isin(svids, [7, 13]))
    assert found["truth_e1_error_m"][-1] == pytest.approx(np.where(np.isin(svids, [7, 13]), 90.0, 0.0), abs=10)
    assert np.linalg.norm(found["fix_error_m"][0, -1]) > 20
    assert found["raim_statistic"][0, -1] > 1000
    assert found["separation_sigmas"][0, -1].max() > 6
    assert found["separation_modes"][0, -1] == 8
    assert np.all(found["raim_statistic"][0, :2] < 40)


def test_a_push_of_all_satellites_moves_the_clock_and_is_not_seen_by_raim() -> None:
    attack = PUSH.replace("position-push", "time-push").replace("svids=[7, 13], ", "")
    found, calm = (columns_of(sky_scenario(*CLEAN, *HALF_MINUTES, one)) for one in (attack, "attack=[]"))
    assert found["fix_clock_error_m"][0, -1] - calm["fix_clock_error_m"][0, -1] == pytest.approx(90.0, abs=10)
    assert np.linalg.norm(found["fix_error_m"][0, -1]) < 5
    assert found["raim_statistic"][0, -1] < 40


def test_the_authenticated_fix_leaves_out_what_is_not_authentic() -> None:
    """Pulled to the early side E1 comes before E6, so nobody knows the true range."""
    e1_only = PUSH.replace("power_db=6", 'power_db=6, bands=["E1"]').replace("last=90", "last=-90")
    found = columns_of(sky_scenario(*CLEAN, *HALF_MINUTES, e1_only))
    last = 7
    assert found["recs"][last]
    assert found["fix_satellites"][:, last].tolist() == [8, 6]
    assert np.linalg.norm(found["fix_error_m"][0, last]) > 20
    assert np.linalg.norm(found["fix_error_m"][1, last]) < 5


def test_the_authenticated_fix_uses_e6_where_it_is_earlier_than_e1() -> None:
    found = columns_of(sky_scenario(*CLEAN, *HALF_MINUTES, PUSH.replace("power_db=6", 'power_db=6, bands=["E1"]')))
    last = 7
    assert found["fix_satellites"][:, last].tolist() == [8, 8]
    assert np.linalg.norm(found["fix_error_m"][0, last]) > 20
    assert np.linalg.norm(found["fix_error_m"][1, last]) < 5


def test_ephemerides_of_a_file_are_as_good_as_those_they_were_written_from(tmp_path: Path) -> None:
    start = GalileoTime.parse("2026-11-21T16:00:00 GST")
    write_rinex_navigation(tmp_path / "sky.rnx", walker_ephemerides(start))
    (tmp_path / "sky.toml").write_text(
        SCENARIO.read_text(encoding="utf-8").replace('kind = "walker"', 'kind = "rinex"\npath = "sky.rnx"'),
        encoding="utf-8",
    )
    settings = (*NO_ERRORS, "epochs=3")
    read, made = (columns_of(sky_scenario(*settings, path=path)) for path in (tmp_path / "sky.toml", SCENARIO))
    assert read["truth_range_m"] == pytest.approx(made["truth_range_m"], abs=1e-3)  # RINEX has 12 digits
    assert np.max(np.abs(read["fix_error_m"][0])) < 1e-3


def test_meaconing_of_a_second_moves_the_clock_by_a_second() -> None:
    attack = 'attack=[{kind="meaconing", delay_s=1.0, power_db=20, start_s=10}]'
    found: dict[str, Any] = columns_of(sky_scenario(*NO_ERRORS, "epochs=31", "recs.every=10", attack))
    assert found["fix_clock_error_m"][0, -1] == pytest.approx(SPEED_OF_LIGHT_MPS, rel=1e-5)


def test_without_phases_all_other_columns_keep_their_bits() -> None:
    attack = "attack=[{kind='meaconing', start_s=10, delay_s=1e-6, power_db=3.0}]"
    scenario = sky_scenario("epochs=61", "fidelity='correlators'", attack)
    whole, rest = (direct_results(ScenarioPlan(scenario=scenario, with_phases=phases)) for phases in (True, False))
    assert set(whole) - set(rest) == {"truth_phase_rad"}
    assert not set(rest) - set(whole)
    for name in rest:
        assert rest[name].values.tobytes() == whole[name].values.tobytes(), name
