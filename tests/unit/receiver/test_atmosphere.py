"""Troposphere and broadcast ionosphere of a sky, in the pseudorange and beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sky_builder import CLEAN, sky_scenario, whole_block
from vestige.acas_processor.detectors import MaximumDetector
from vestige.acas_processor.processor import AcasProcessor
from vestige.constants import GAMMA_E1_E6
from vestige.navigation.inav.ionosphere import NO_IONOSPHERE, BroadcastIonosphere
from vestige.navigation.troposphere import SaastamoinenTroposphere
from vestige.receiver.samples.continuous import ContinuousTruth
from vestige.receiver.sky.atmosphere import Atmosphere, AtmosphericDelay, through_atmosphere
from vestige.receiver.sky.elevation import SatelliteRange
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.records import Band
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_satellite import ExportedSatellite

WAVELENGTH_M = 299_792_458.0 / 1575.42e6
BOTH = Atmosphere(troposphere=SaastamoinenTroposphere(), ionosphere=BroadcastIonosphere(ai0_sfu=150.0))


def satellite(atmosphere: Atmosphere = BOTH, number: int = 0) -> ExportedSatellite:
    simulation = sky_scenario("epochs=60", "seed=3").simulations[number]
    assert simulation.elevation is not None
    effects = through_atmosphere(simulation.elevation, atmosphere)
    simulation = replace(simulation, elevation=effects, line_of_sight=effects.line_of_sight)
    return ExportedSatellite(simulation=simulation, interval_s=1.0, first=10, end=20)


def path_of(one: ExportedSatellite) -> SatelliteRange:
    assert one.simulation.elevation is not None
    return one.simulation.elevation.path


def test_the_troposphere_is_in_the_pseudorange_and_its_rates() -> None:
    with_it, without = satellite().path, satellite(Atmosphere()).path
    t_s = np.linspace(10.0, 19.9, 40)
    added_m = with_it.range_m(t_s) - without.range_m(t_s)
    assert added_m == pytest.approx(with_it.troposphere_m(t_s), abs=1e-7)
    assert np.all((added_m > 2.0) & (added_m < 30.0))
    h = 0.5
    slope = (with_it.troposphere_m(t_s + h) - with_it.troposphere_m(t_s - h)) / (2 * h)
    assert with_it.rate_mps(t_s) - without.rate_mps(t_s) == pytest.approx(slope, abs=1e-7)
    assert np.abs(slope).max() > 1e-5
    bend = with_it.acceleration_mps2(t_s) - without.acceleration_mps2(t_s)
    assert np.abs(bend).max() < 1e-4


def test_the_ionosphere_delays_the_code_and_advances_the_carrier() -> None:
    with_it, without = satellite().path, satellite(Atmosphere()).path
    e1_m = with_it.truth.broadcast_ionosphere_e1_m
    assert np.all(e1_m > 0.5)
    for band, ratio in ((Band.E1, 1.0), (Band.E6, GAMMA_E1_E6)):
        assert with_it.ionosphere_m(band) - without.ionosphere_m(band) == pytest.approx(ratio * e1_m, rel=1e-9)
        assert with_it.delay_m(band) - without.delay_m(band) == pytest.approx(ratio * e1_m, rel=1e-9)
    t_s = float(with_it.received_s()[4]) + 0.3
    after, before = (one.propagation(Band.E1, 0.016)(t_s) for one in (with_it, without))
    turned = np.angle(after.amplitude / before.amplitude) / (2 * np.pi)
    advance_m = after.delay_m - before.delay_m
    assert (turned - advance_m / WAVELENGTH_M + 0.5) % 1.0 - 0.5 == pytest.approx(0.0, abs=1e-6)


def test_without_an_atmosphere_not_a_bit_changes() -> None:
    plain = satellite(Atmosphere())
    bare = ContinuousTruth(
        line_of_sight=plain.path.line_of_sight,
        truth=plain.path.truth,
        e1_multipath=plain.path.e1_multipath,
        group_delay_m=plain.path.group_delay_m,
        sky=True,
    )
    t_s = np.linspace(10.0, 19.9, 40)
    for name in ("range_m", "rate_mps", "acceleration_mps2"):
        assert np.array_equal(getattr(plain.path, name)(t_s), getattr(bare, name)(t_s))
    for band in Band:
        assert np.array_equal(plain.path.delay_m(band), bare.delay_m(band))
    assert "troposphere_m" not in plain.truth_table()


def test_nothing_steps_at_midnight() -> None:
    """The last second of a day and the first one of the next differ as much as any two neighbours."""
    path = path_of(satellite())
    midnight = path.start + (86_400.0 + 18.0 - path.start.second % 86_400)  # UTC, which is 18 s behind
    start = midnight + -30.0
    moved = AtmosphericDelay(atmosphere=BOTH, path=replace(path, start=start))
    steps_m = np.diff(moved.ionosphere_e1_m(np.arange(0.0, 60.0)))
    assert np.ptp(steps_m) < 1e-5


def test_a_receiver_high_up_has_less_troposphere() -> None:
    path = path_of(satellite())
    t_s = np.zeros(1)
    delays = [
        AtmosphericDelay(
            atmosphere=BOTH,
            path=replace(path, trajectory=StaticTrajectory(latitude_deg=48.1, longitude_deg=11.6, height_m=height_m)),
        ).troposphere_m(t_s)[0]
        for height_m in (0.0, 5500.0)
    ]
    assert delays[1] / delays[0] == pytest.approx(0.5, abs=0.03)  # half of the air is below 5.5 km


def test_no_model_is_no_delay() -> None:
    t_s = np.zeros(2)
    assert (Atmosphere().there, Atmosphere().broadcast) == (False, NO_IONOSPHERE)
    nothing = AtmosphericDelay(atmosphere=Atmosphere(), path=path_of(satellite()))
    assert not nothing.troposphere_m(t_s).any()
    assert not nothing.ionosphere_e1_m(t_s).any()
    assert not any(one.any() for one in nothing.troposphere_rates(t_s))


TABLE = 'atmosphere={troposphere={kind="saastamoinen"}, ionosphere={kind="ntcm-g", ai0_sfu=150.0}}'
ONE_SKY = ("epochs=12", "seed=3", "recs.every=4", "constellation.svids=[6, 24]")


def test_a_campaign_has_the_ranges_of_its_recording() -> None:
    """At each epoch to 10 nm. Both have T + I more than without the table, as the models say of the direction."""
    scenario = sky_scenario(*ONE_SKY, TABLE)
    (with_it, _), (without, _) = (whole_block(one) for one in (scenario, sky_scenario(*ONE_SKY)))
    added_m = with_it.e1.pseudorange_m - without.e1.pseudorange_m
    for column, one in enumerate(AcasTestCase(scenario=scenario, first=0, end=12).satellites):
        t_s, truth = one.truth.time_s, one.truth
        ionosphere_m = one.path.ionosphere_m(Band.E1)[: t_s.size]
        recorded_m = one.path.range_m(t_s) + ionosphere_m + one.e1_error_m
        assert with_it.e1.pseudorange_m[:, column] == pytest.approx(recorded_m, abs=1e-8)
        carried_m = one.path.range_m(t_s) - ionosphere_m + truth.e1.error_m + truth.e1_phase_noise_m
        assert with_it.e1.carrier_phase_cycles is not None
        assert with_it.e1.carrier_phase_cycles[:, column] * WAVELENGTH_M == pytest.approx(carried_m, abs=1e-7)
        rates_mps = -WAVELENGTH_M * with_it.e1.doppler_hz[:, column]
        moved_mps = one.path.rate_mps(t_s) + truth.e1_rate_noise_mps + truth.e1.rate_error_mps
        assert rates_mps == pytest.approx(moved_mps, abs=1e-8)
        delay = AtmosphericDelay(atmosphere=BOTH, path=path_of(one))
        system_s = t_s - truth.clock_m / 299_792_458.0
        expected_m = delay.troposphere_m(system_s) + delay.ionosphere_e1_m(system_s)
        assert added_m[:, column] == pytest.approx(expected_m, abs=1e-7)
        assert np.all(expected_m > 3.0)


@pytest.mark.parametrize("fidelity", ["correlators", "samples"])
def test_a_campaign_predicts_the_ionosphere_on_e6(fidelity: str) -> None:
    """E6 is (γ − 1) I later; with the prediction the range offset is that of a sky without the table."""
    settings = (*ONE_SKY, *CLEAN[:2], "receiver.e1_tracking=none", "receiver.cn0_dbhz=75", f'fidelity="{fidelity}"')
    processor, offsets_m = AcasProcessor(detector=MaximumDetector()), []
    for table in (TABLE, "atmosphere={}"):
        scenario = sky_scenario(*settings, table)
        receiver = replace(scenario.simulated_receiver, with_taps=False)
        block = receiver.snapshots(0, tuple(one.advance(0, 12) for one in receiver.truth()))
        offsets_m.append(processor.measure(block, receiver.assistance).detected.range_offset_m[::4])
    assert np.all(np.isfinite(offsets_m))
    assert offsets_m[0] == pytest.approx(offsets_m[1], abs=0.5)  # the two satellites disturb each other


def test_a_satellite_may_set() -> None:
    """The models hold above the horizon; below the mask nothing is received, and all numbers stay numbers."""
    scenario = sky_scenario("epochs=4", "interval_s=3600.0", "recs.every=1", "constellation.svids=[6, 8]", TABLE)
    block, truth = whole_block(scenario)
    assert np.array_equal(block.e1.seen, np.stack([one.geometry.in_view for one in truth], axis=1))
    assert all(np.isfinite(one.range_m + one.broadcast_ionosphere_e1_m).all() for one in truth)
