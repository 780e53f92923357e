"""OSNMA and inertial checks over a sky: silent without an attack, and each sees what it is for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
import xarray

from campaign_checks import checks_of
from sky_builder import CLEAN, sky_scenario
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.osnma_reception import of_mask
from vestige.records import Status
from vestige.records.checks import CheckName, CheckSeries

AVAILABILITY, RECEPTION = CheckName.OSNMA_AVAILABILITY, CheckName.OSNMA_RECEPTION
AGREEMENT, INERTIAL = CheckName.OSNMA_AGREEMENT, CheckName.INERTIAL_RANGE_RATE
SOUND = (
    "receiver.clock=none",
    "receiver.accelerometers.sigma_bias_mps2=0.0",
    "receiver.accelerometers.walk_mps_per_sqrt_s=0.0",
    "processor.oscillator={h0_s=0.0, h_minus_2_hz=0.0}",
    "processor.inertial={sigma_bias_mps2=0.0, walk_mps_per_sqrt_s=0.0}",
)
CIRCLE = 'trajectory={kind="circle", latitude_deg=48.1, longitude_deg=11.6, radius_m=800, speed_mps=30}'


def jamming(j_over_n_db: float, start_s: float = 100.0) -> str:
    return f'attack=[{{kind="jamming", bands=["E1"], start_s={start_s}, j_over_n_db={j_over_n_db}}}]'


def judged(*settings: str) -> tuple[xarray.Dataset, Mapping[CheckName, CheckSeries]]:
    results = direct_results(ScenarioPlan(scenario=sky_scenario(*CLEAN, *settings)))
    return results, checks_of(results)


def test_a_calm_sky_has_all_pages_and_keys() -> None:
    results, found = judged("epochs=301")
    assert np.array_equal(results["osnma_key"].values, results["recs"].values)
    due, pages = results["osnma_due"].values, results["osnma_pages"].values
    assert np.array_equal(pages, np.broadcast_to(due[:, None], pages.shape))
    assert np.count_nonzero(of_mask(due)) == 150
    made = np.flatnonzero(found[RECEPTION].run)
    assert made.tolist() == [31 + 30 * k for k in range(9)]  # 16:00:00 begins a subframe
    assert np.flatnonzero(found[AVAILABILITY].run).tolist() == made[2:].tolist()  # two alone would prove nothing
    for name in (AVAILABILITY, RECEPTION, INERTIAL, AGREEMENT):
        assert not found[name].failed.any(), name
    assert np.array_equal(found[AGREEMENT].run, found[RECEPTION].run)


def lift_off(svids: str, forged_nav_data: str) -> str:
    return (
        f'attack=[{{kind="lift-off", {svids} bands=["E1"], forged_nav_data={forged_nav_data}, start_s=60, power_db=3, '
        'delay_m={kind="ramp", first=0, last=20, start_s=90, stop_s=400}}]'
    )


def test_data_of_a_spoofing_signal_that_tracking_leaves_alone_are_not_demodulated() -> None:
    weak = lift_off("svids=[7, 13],", "true").replace("power_db=3", "power_db=-3")
    results, found = judged("epochs=161", weak)
    assert not results["osnma_differs"].values.any()
    assert not found[AGREEMENT].failed.any()


@pytest.mark.parametrize("forged_nav_data", ["false", "true"])
def test_data_of_the_attackers_own_are_not_what_a_second_channel_has(forged_nav_data: str) -> None:
    """On top of the true signals and 3 dB stronger from 60 s on: 15 pages a subframe of each of the two satellites."""
    results, found = judged("epochs=301", lift_off("svids=[7, 13],", forged_nav_data))
    made = found[AGREEMENT].run
    expected = np.where(np.flatnonzero(made) > 61, 30.0 * (forged_nav_data == "true"), 0.0)
    assert found[AGREEMENT].statistic[made][2:] == pytest.approx(expected[2:])
    assert found[AGREEMENT].failed[made][2:].all() == (forged_nav_data == "true")
    assert not found[AVAILABILITY].failed.any()  # the others bring the keys
    assert not found[RECEPTION].failed.any()
    late = results["time_s"].values >= 61
    assert (
        results["osnma_data"].values[late].sum(axis=1).tolist() == [6 if forged_nav_data == "true" else 8] * late.sum()
    )
    assert results["osnma_differs"].values[late].any() == (forged_nav_data == "true")


def test_with_data_of_the_attackers_own_alone_no_key_validates() -> None:
    results, found = judged("epochs=301", "recs.every=10", lift_off("", "true"))
    late = results["time_s"].values >= 61
    assert not results["osnma_key"].values[late].any()
    assert np.all(results["status"].values[results["recs"].values & late] == list(Status).index(Status.NOT_AVAILABLE))
    assert found[AVAILABILITY].failed[300 - 29 :].any()
    assert not found[RECEPTION].failed.any()


def test_a_weak_jammer_is_seen_by_comparison_alone() -> None:
    """From 45 dBHz at the zenith 18 dB take the satellites to 19 to 26 dBHz: the high ones still bring the keys."""
    results, found = judged("epochs=700", jamming(18.0))
    assert np.array_equal(results["osnma_key"].values, results["recs"].values)
    assert not found[AVAILABILITY].failed.any()
    after = found[RECEPTION].run & (np.arange(700) > 140)
    assert found[RECEPTION].failed[after].all()
    assert not found[RECEPTION].failed[:100].any()


def test_denial_takes_the_keys_and_so_the_authentication() -> None:
    denial = 'attack=[{kind="osnma-denial", start_s=300, j_over_n_db=10.0}]'
    results, found = judged("epochs=700", denial)
    recs = results["recs"].values
    late = np.arange(700) >= 300
    assert not results["osnma_key"].values[late].any()
    assert np.all(results["status"].values[recs & late] == list(Status).index(Status.NOT_AVAILABLE))
    assert found[RECEPTION].failed[331]
    assert found[AVAILABILITY].failed[300:].any()
    assert found[AVAILABILITY].statistic[691] == 14.0  # since the subframe that ended at 300 s; 20 are looked at


def test_a_fix_whose_data_are_not_authenticated_is_not_called_so() -> None:
    """The jammer takes pages of low satellites, whose ranges are still authentic on E6."""
    results, _ = judged("epochs=700", jamming(17.0))
    rows = results["recs"].values & (np.arange(700) >= 180)
    authentic = results["status"].values == list(Status).index(Status.AUTHENTIC)
    used = results["fix_satellites"].sel(fix="authenticated").values
    with_data = authentic & results["osnma_data"].values
    assert np.array_equal(used[rows], with_data[rows].sum(axis=1) * (with_data[rows].sum(axis=1) >= 4))
    assert np.all(authentic[rows].sum(axis=1) == 8)
    assert np.all(used[rows] < 8)
    before = results["recs"].values & (np.arange(700) < 30)
    assert np.all(used[before] == 8)


@pytest.mark.parametrize("key_delay", [0, 1])
def test_an_authenticated_fix_is_known_when_its_key_is(key_delay: int) -> None:
    """Keys end 31 s after the start of their subframe; a RECS of KDI 0 must come before its key goes on air at 22 s."""
    results, _ = judged("epochs=130", "recs.every=7", f"recs.key_delay={key_delay}")
    time_s = results["time_s"].values
    known_s = results["available_at_s"].sel(fix="authenticated").values
    due = results["recs"].values & ((time_s % 30 < 20) | (key_delay == 1))
    assert np.array_equal(np.isfinite(known_s), due)
    assert known_s[due] == pytest.approx(30 * (time_s[due] // 30 + key_delay) + 31)


@pytest.mark.parametrize("interval_s", [0.5, *(pytest.param(one, marks=pytest.mark.slow) for one in (7.0, 30.0, 90.0))])
def test_pages_of_any_interval_make_subframes(interval_s: float) -> None:
    _, found = judged(f"epochs={round(400 / interval_s)}", f"interval_s={interval_s}", "recs.every=1")
    assert found[RECEPTION].run.any()
    assert np.nanmax(found[RECEPTION].statistic) == 0.0


def test_range_rates_on_a_circle_are_explained_by_the_accelerometers() -> None:
    moving = ("epochs=1201", "recs.every=10", CIRCLE)
    results, found = judged(*moving)
    check = found[INERTIAL]
    assert check.run.any(axis=1).sum() == 120
    assert not check.failed.any()
    scatter = check.statistic[check.run] / check.threshold[check.run] * 4.417  # K of 1e-5
    assert 0.5 < np.std(scatter) < 1.5
    rate = results["e1_doppler_hz"].values[::10] * SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ
    assert np.max(np.abs(np.diff(rate, axis=0))) > 10.0  # which without them would be alarms


@pytest.mark.parametrize("radius_m", [20_000, 1_000_000])
def test_an_aircraft_turns_lines_of_sight_and_local_axes(radius_m: int) -> None:
    """250 m/s for a minute: satellites turn by up to 9 mrad, the vertical by 2 mrad, each of them some 0.5 m/s."""
    flight = f'trajectory={{kind="circle", latitude_deg=48.1, longitude_deg=11.6, radius_m={radius_m}, speed_mps=250}}'
    _, found = judged(*SOUND, "epochs=601", "recs.every=60", flight)
    check = found[INERTIAL]
    assert check.run.sum() == 80
    assert not check.failed.any()
    scatter = check.statistic[check.run] / check.threshold[check.run] * 4.417  # K of 1e-5
    assert abs(np.mean(scatter)) < 0.5  # 4.5 σ, satellites of their own
    assert 0.7 < np.std(scatter) < 1.4


def test_a_tight_turn_between_two_recs_is_followed() -> None:
    """43° in a minute: the path bends by 1.4 km, and the mean velocity is not the mean of those at both ends."""
    flight = 'trajectory={kind="circle", latitude_deg=48.1, longitude_deg=11.6, radius_m=20000, speed_mps=250}'
    _, found = judged(*SOUND, "receiver.e1_tracking=none", "epochs=181", "recs.every=60", flight)
    statistic = found[INERTIAL].statistic[[60, 120, 180]]
    assert np.max(np.abs(statistic)) < 0.005  # 0.1 m/s along a straight line


def test_a_pull_of_the_range_rate_is_seen_and_nothing_without_sensors() -> None:
    pull = (
        'attack=[{kind="position-push", svids=[7], start_s=100, power_db=6, '
        'delay_m={kind="ramp", first=0, last=900, start_s=205, stop_s=295}}]'
    )
    _, found = judged("epochs=301", "recs.every=10", pull)
    failed = found[INERTIAL].failed
    assert failed[[210], 1].all()
    assert not np.delete(failed, 1, axis=1).any()
    _, blind = judged("epochs=301", "recs.every=10", pull, "receiver.accelerometers=none")
    assert not blind[INERTIAL].run.any()
