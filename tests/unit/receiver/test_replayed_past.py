"""A replay under a sky: each signal comes from where its satellite was, in the model as in the samples."""

from __future__ import annotations

import numpy as np
import pytest

from sky_builder import CLEAN, sky_scenario, whole_block
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import ecef_from_geodetic
from vestige.receiver.sky.replayed_past import SpooferUnderSky
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.records import Band, Status
from vestige.scenario.campaign import CampaignScenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.threats.scenes import read_threats, scene_scenario

EXACT = (*CLEAN, "receiver.clock=none", "receiver.e1_tracking=none", "constellation.svids=[6, 24]")
ALL = "constellation.svids=[6, 7, 8, 12, 13, 14, 23, 24]"
CIRCLE = (
    'trajectory={kind="circle", latitude_deg=48.1, longitude_deg=11.6, height_m=500.0, radius_m=400.0, speed_mps=20.0}'
)
ANTENNA = {"latitude_deg": 48.11, "longitude_deg": 11.62, "height_m": 520.0}
ELSEWHERE = ", antenna={latitude_deg=48.11, longitude_deg=11.62, height_m=520.0}"
LATE_CLOCK_S = -45.00137


def _meaconer(delay_s: float, more: str = "") -> str:
    return f'attack=[{{kind="meaconing", delay_s={delay_s}, power_db=20.0, reception_gain_db=40.0{more}}}]'


@pytest.mark.parametrize("settings", [(), (CIRCLE,)], ids=["standing", "moving"])
@pytest.mark.parametrize("delay_s", [0.05, 45.0])
def test_e1_observes_the_geometry_of_the_past(settings: tuple[str, ...], delay_s: float) -> None:
    """Range, Doppler and its rate are those of `delay_s` ago; those of now differ by up to 36 km, 5 m/s, 1 mm/s²."""
    scenario = sky_scenario(*EXACT, *settings, "epochs=4", _meaconer(delay_s))
    block, truth = whole_block(scenario)
    to_hz = -E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS
    for column, one in enumerate(scenario.simulations):
        then_s = truth[column].time_s - delay_s
        assert one.elevation is not None
        path = one.elevation.path
        expected_m = path.range_m(then_s) + delay_s * SPEED_OF_LIGHT_MPS
        assert block.e1.pseudorange_m[:, column] == pytest.approx(expected_m, abs=0.01, rel=0)
        assert block.e1.doppler_hz[:, column] == pytest.approx(to_hz * path.rate_mps(then_s), abs=0.01, rel=0)
        assert one.repeated_later_m(truth[column]) == pytest.approx(
            np.full(4, delay_s * SPEED_OF_LIGHT_MPS), abs=100.0 if delay_s < 0.1 else 0.01, rel=0
        )
        if delay_s > 0.1:
            rate_hz_per_s = to_hz * path.acceleration_mps2(then_s)
            assert block.e1.doppler_rate_hz_per_s[:, column] == pytest.approx(rate_hz_per_s, abs=1e-7, rel=0)
        assert np.array_equal(truth[column].e6.delay_m, truth[column].e1_attack.delay_m)


@pytest.mark.parametrize(
    ("settings", "delay_s", "more", "within_m"),
    [
        ((), 0.05, "", 0.05),
        ((), 7.0, "", 0.05),
        ((), 7.0, ELSEWHERE, 0.05),
        ((CIRCLE,), 0.05, "", 0.05),
        ((CIRCLE,), 7.0, "", 0.05),
        # profiles of samples run on the time of transmission: a way that changes by up to 40 m/s, for 76 ms
        ((CIRCLE,), 7.0, ELSEWHERE, 3.1),
    ],
)
def test_e1_observes_what_the_samples_hold(
    settings: tuple[str, ...], delay_s: float, more: str, within_m: float
) -> None:
    scenario = sky_scenario(*EXACT, *settings, "epochs=4", "recs.every=1", _meaconer(delay_s, more))
    observed = whole_block(scenario)[0].e1
    case = AcasTestCase(scenario=scenario, first=0, end=4)
    t_s = np.arange(4.0)[1:]  # what was sent before the run began has the first value of the profiles
    spoofing_signals = case.sky(Band.E1)[1::2]
    assert len(spoofing_signals) == 2
    for column, signal in enumerate(spoofing_signals):
        range_m, rate_mps = signal.pseudorange.range_m(t_s), signal.pseudorange.rate_mps(t_s)
        assert observed.pseudorange_m[1:, column] == pytest.approx(range_m, abs=within_m, rel=0)
        doppler_hz = -rate_mps * E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS
        assert observed.doppler_hz[1:, column] == pytest.approx(doppler_hz, abs=within_m, rel=0)


def test_the_phase_has_the_rate_of_the_doppler() -> None:
    simulation = sky_scenario(*EXACT, "epochs=12", _meaconer(5.0)).simulations[0]
    t_s = np.linspace(3.0, 3.01, 11)
    for band in Band:
        effects = simulation.spoofer_as_received.effects(band, simulation.svid, t_s)
        turned_hz = np.diff(np.unwrap(effects.phase_rad[:, 0])) / np.diff(t_s) / (2 * np.pi)
        assert np.abs(effects.doppler_hz[:, 0]).min() > 0.1
        assert turned_hz == pytest.approx(effects.doppler_hz[1:, 0], abs=0.02, rel=0)


def test_no_bit_changes_for_delays_of_microseconds() -> None:
    """Nor for an attack that is not on."""
    attack = (
        'attack=[{kind="nulling", gain_db=-1.0}, {kind="meaconing", delay_s=9e-6, power_db=3.0}, '
        '{kind="meaconing", delay_s=5.0, power_db=3.0, start_s=60.0}]'
    )
    simulation = sky_scenario(*EXACT, "epochs=12", attack).simulations[0]
    assert isinstance(simulation.spoofer_as_received, SpooferUnderSky)
    times_s = np.arange(12.0)
    plain, seen = (
        one.effects(Band.E1, simulation.svid, times_s)
        for one in (simulation.spoofer, simulation.spoofer_as_received)
    )  # fmt: skip
    for name in ("delay_m", "delay_rate_mps", "phase_rad", "doppler_hz"):
        assert getattr(plain, name).tobytes() == getattr(seen, name).tobytes(), name


@pytest.mark.parametrize("settings", [(), (CIRCLE,)], ids=["standing", "moving"])
def test_a_recorder_elsewhere_brings_the_past_of_its_own_place(settings: tuple[str, ...]) -> None:
    scenario = sky_scenario(*EXACT, *settings, "epochs=12", _meaconer(10.0, ELSEWHERE))
    fixed = StaticTrajectory(**ANTENNA)
    t_s = np.linspace(0.0, 11.0, 23)
    sent_m = ecef_from_geodetic(*np.radians([[48.11], [11.62]]), np.array([520.0]))
    assert np.linalg.norm(fixed.motion(t_s).position_m - sent_m, axis=1).max() < 1e-6
    for one in scenario.simulations:
        assert one.elevation is not None
        path = one.elevation.path
        late_m = one.spoofer_as_received.effects(Band.E1, one.svid, t_s).delay_m[:, 0]
        there_m = path.trajectory.motion(t_s - 10.0).position_m
        onward_m = np.linalg.norm(fixed.motion(t_s).position_m - there_m, axis=1)
        received_m = path.range_m(t_s) + late_m - onward_m - 10.0 * SPEED_OF_LIGHT_MPS
        expected_m = type(path)(ephemeris=path.ephemeris, start=path.start, trajectory=fixed).range_m(t_s - 10.0)
        assert received_m == pytest.approx(expected_m, abs=0.05)


def _said(scenario: CampaignScenario) -> tuple[dict[str, set[int]], set[Status]]:
    """Return the outcomes of the checks of the position, 0 for passed and 1 for failed, and the verdicts."""
    results = direct_results(ScenarioPlan(scenario=scenario))
    status = results["status"].values[::10]
    outcomes = np.moveaxis(results["check_result"].values, results["check_result"].dims.index("check"), 0)
    names = results["check"].values.tolist()
    return {
        name: set(outcomes[names.index(name)][outcomes[names.index(name)] >= 0].tolist())
        for name in ("RAIM", "solution separation")
    }, {list(Status)[one] for one in np.unique(status[status >= 0])}


def test_the_ranges_of_a_replay_fit_together() -> None:
    """No range of a loud recorder of 5 s contradicts another one: with the geometry of now RAIM failed at once."""
    scenario = sky_scenario("epochs=11", "recs.every=10", "processor.level=2", ALL, _meaconer(5.0))
    found, _ = _said(scenario)
    assert found == {"RAIM": {0}, "solution separation": {0}}


(A17,) = (threat for threat in read_threats() if threat.id == "A17")


def _a17(*settings: str) -> CampaignScenario:
    return scene_scenario(A17, A17.scene[0], 0, settings=("epochs=31", "attack.0.power_db=3.0", *settings))


@pytest.mark.parametrize("clock_offset_s", [0.0, LATE_CLOCK_S], ids=["right", "45 s late"])
def test_the_ranges_of_a_forged_past_fit_together(clock_offset_s: float) -> None:
    scenario = _a17(f"receiver.clock_offset_s={clock_offset_s}", "processor.level=2")
    found, verdicts = _said(scenario)
    assert found == {"RAIM": {0}, "solution separation": {0}}
    assert (Status.AUTHENTIC in verdicts) == (clock_offset_s != 0.0), verdicts


def test_a_late_clock_alone_makes_no_range_contradict_another() -> None:
    scenario = _a17("attack=[]", "processor.level=2")
    assert _said(scenario)[0]["RAIM"] == {0}
    one, (truth, *_) = scenario.simulations[0], whole_block(scenario)[1]
    assert one.elevation is not None
    assert truth.range_m == pytest.approx(
        one.elevation.path.range_m(truth.time_s - LATE_CLOCK_S - truth.clock_m / SPEED_OF_LIGHT_MPS), abs=1e-3, rel=0
    )
