"""What the receiver of a campaign knows beforehand: its configuration, not the truth."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sky_builder import sky_scenario
from vestige.acas_processor.monitoring.alarm_budget import Cadence
from vestige.acas_processor.monitoring.baseline import Antenna
from vestige.errors import InputFileError, VestigeError
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.scenario.scenario_processor import processor_of
from vestige.scenario.stored import stored_scenario

QUICK = Path(__file__).resolve().parents[3] / "scenarios" / "quick.toml"
TRUTH = (
    'receiver.clock={kind="two-state", h0_s=1e-20, h_minus_2_hz=1e-19}',
    'receiver.accelerometers={kind="bias-and-walk", sigma_bias_mps2=1.0, walk_mps_per_sqrt_s=1.0}',
    'receiver.multipath={kind="lms-lite", power_db=-3.0, mean_excess_m=20.0}',
    'receiver.ionosphere={kind="heavy-tailed", core_sigma_m=9.0, tail_start_m=20.0, tail_scale_m=9.0}',
    'receiver.bias={kind="bias", bgd_sigma_m=9.0}',
    'attack=[{kind="jamming", j_over_n_db=20.0}]',
    "receiver.signal=false",
    "seed=99",
)


def _quick(*settings: str) -> CampaignScenario:
    scenario = load_scenario(QUICK, settings)
    assert isinstance(scenario, CampaignScenario)
    return scenario


@pytest.mark.parametrize("setting", TRUTH)
def test_what_is_true_does_not_reach_the_processor(setting: str) -> None:
    assert repr(processor_of(sky_scenario("processor.level=3", setting))) == repr(
        processor_of(sky_scenario("processor.level=3"))
    )


def test_a_receiver_under_a_sky_knows_antenna_orbits_and_cadence() -> None:
    settings = processor_of(sky_scenario("processor.level=3", "processor.search_s=600")).monitoring
    assert settings.cadence == Cadence(satellites=8, observation_s=1.0, recs_s=30.0, search_s=600.0)
    assert settings.exhaustive_period_s == 600.0
    assert settings.levels.antenna == Antenna(e1_dbhz=45.0, e6_dbhz=45.0, fall_db=9.0)
    assert (settings.levels.e1_power_db, settings.levels.e6_power_db) == (0.0, 0.0)
    assert {one.svid for one in settings.fix.ephemerides} == {6, 7, 8, 12, 13, 14, 23, 24}
    assert math.isinf(settings.fix.fit_interval_s)
    errors = settings.fix.errors
    assert (errors.ionosphere_m, errors.multipath_m, errors.floor_m, errors.ionosphere_common) == (2.0, 1.8, 0.1, 0.5)
    # 9 dB from zenith to horizon: eight satellites in view are all between 36 and 45 dBHz
    assert 37.0 < settings.power_distortion.hypotheses.sky_cn0_dbhz < 44.0


def test_the_receiver_counts_the_satellites_of_the_first_epoch() -> None:
    """Eight satellites are above the mask at the start; two remain after half a day."""
    scenario = sky_scenario("epochs=721", "interval_s=60.0", "recs.every=1")
    views = [one.truth().advance(0, 721).geometry.in_view for one in scenario.simulations]
    in_view = np.sum(views, axis=0)
    assert (in_view[0], in_view[-1]) == (8, 2)
    settings = processor_of(scenario).monitoring
    assert settings.cadence.satellites == 8
    assert settings.power_distortion.hypotheses.n_satellites == 8
    stated = processor_of(sky_scenario("processor.expected_satellites=5")).monitoring
    assert (stated.cadence.satellites, stated.power_distortion.hypotheses.n_satellites) == (5, 5)


def test_without_a_satellite_in_view_one_at_the_mask_is_expected() -> None:
    """SVID 2 is below the horizon at the start, and rises within the 20 hours of the run."""
    scenario = sky_scenario("constellation.svids=[2]", "epochs=1200", "interval_s=60.0", "recs.every=1")
    assert not scenario.simulations[0].truth().advance(0, 1).geometry.in_view[0]
    settings = processor_of(scenario).monitoring
    assert settings.cadence.satellites == 1
    at_mask_dbhz = 45 - 9 * (1 - math.sin(math.radians(5)))
    assert settings.power_distortion.hypotheses.sky_cn0_dbhz == pytest.approx(at_mask_dbhz)


def test_the_receiver_expects_the_strength_that_its_settings_state() -> None:
    stated = sky_scenario("processor.expected_cn0_e1_dbhz=42", "processor.expected_cn0_e6_dbhz=41.5")
    assert processor_of(stated).monitoring.levels.antenna == Antenna(e1_dbhz=42.0, e6_dbhz=41.5, fall_db=9.0)
    assert stated.simulations[0].cn0_dbhz == sky_scenario().simulations[0].cn0_dbhz
    of_stated, of_known = (
        processor_of(one).monitoring.power_distortion.hypotheses.sky_cn0_dbhz for one in (stated, sky_scenario())
    )
    assert of_known - of_stated == pytest.approx(3.0)


def test_what_is_expected_of_e6_over_e1_is_stated_or_follows_from_the_two_strengths() -> None:
    def expected_db(*settings: str) -> float:
        return processor_of(_quick(*settings)).e6_over_e1_db

    assert expected_db("receiver.cn0_dbhz=37") == pytest.approx(2.0)
    assert expected_db() == 0.0  # quick.toml has 35 dBHz on both
    assert expected_db("processor.expected_cn0_e6_dbhz=38", "processor.expected_cn0_e1_dbhz=36.5") == pytest.approx(1.5)
    assert expected_db("receiver.cn0_dbhz=37", "processor.e6_over_e1_db=-1.5") == -1.5


def test_a_receiver_on_one_line_of_sight_knows_no_elevation() -> None:
    settings = processor_of(_quick("receiver.cn0_dbhz=37")).monitoring
    assert settings.levels.antenna == Antenna(e1_dbhz=35.0, e6_dbhz=37.0, fall_db=0.0)
    assert settings.fix.ephemerides == ()
    assert settings.cadence.satellites == 1


def test_front_end_and_data_sheets_are_the_processors() -> None:
    scenario = _quick(
        "receiver.front_end={bandwidth_hz=8e6}",
        "recs.duration_ms=8",
        "processor.oscillator={h0_s=2e-21, h_minus_2_hz=3e-20}",
        "processor.inertial.sigma_bias_mps2=0.5",
        "processor.ray_power_db=-20",
    )
    settings = processor_of(scenario).monitoring
    assert settings.second_signal_filtered
    assert settings.e6_power.band is Band.E6
    assert settings.e6_power.bandwidth_hz * settings.e6_power.averaging_s == pytest.approx(8e6 * 0.008)
    assert settings.clock.white_s == pytest.approx(1e-21)
    assert settings.clock.walk_hz == pytest.approx(2 * math.pi**2 * 3e-20)
    assert settings.inertial.clock_walk_hz == settings.clock.walk_hz
    assert settings.inertial.sigma_bias_mps2 == 0.5
    assert settings.second_signal.ray_power_db == -20
    assert not processor_of(_quick()).monitoring.second_signal_filtered


def test_alarms_a_day_and_e6_over_e1_reach_the_processor() -> None:
    found = processor_of(sky_scenario("processor.alarms_per_day=2", "processor.e6_over_e1_db=-1.5"))
    assert found.monitoring.alarms_per_day == 2.0
    assert (found.e6_over_e1_db, found.miss_prediction.e6_over_e1_db) == (-1.5, -1.5)
    assert found.range_kappa > found.kappa == 3.0
    assert found.range_limit_m == pytest.approx(found.range_kappa * found.budget.sigma_m)


def test_results_with_alarms_a_day_can_be_read() -> None:
    """What is stored of such a scenario has no κ beside it; κ alone is stored as before."""
    stored = sky_scenario("processor.alarms_per_day=2").model_dump_json(by_alias=True)
    assert stored_scenario(stored).processor.alarms_per_day == 2.0
    assert stored_scenario(sky_scenario("processor.kappa=2.5").model_dump_json(by_alias=True)).processor.kappa == 2.5


def test_kappa_beside_alarms_a_day_is_refused() -> None:
    with pytest.raises(InputFileError, match=r"kappa: found 3 beside alarms_per_day, expected one of the two"):
        sky_scenario("processor.alarms_per_day=1", "processor.kappa=3")


def test_fewer_alarms_a_day_than_noise_brings_are_refused() -> None:
    with pytest.raises(VestigeError, match=r"alarms_per_day: found 0\.05, expected more than 0\.1"):
        processor_of(sky_scenario("processor.alarms_per_day=0.05"))
