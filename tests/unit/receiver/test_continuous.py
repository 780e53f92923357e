from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, GAMMA_E1_E6, SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.e1_loop import E1Loop
from vestige.receiver.errors.multipath import RayBlock
from vestige.receiver.samples.continuous import ContinuousTruth
from vestige.receiver.samples.sampled_epoch import arrival
from vestige.receiver.sky.elevation import SatelliteGeometry
from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.signal_generator.range_model import RangeModel
from vestige.signals.definitions import CARRIER_HZ
from vestige.spoofer.spoofer import NO_SPOOFER

PATH = RangeModel(s0_m=2.5e7, v_mps=51.0, amplitude_m=0.5, omega_radps=3.1)
TIMES = np.array([3.0, 4.0, 5.0, 6.0])
DIFFERENCE_M = np.array([1.0, -2.0, 4.0, 0.5])


def truth(e1_multipath: bool = False, *, sky: bool = False) -> ContinuousTruth:
    rng = np.random.default_rng(1)
    strength = rng.normal(size=(4, 2)) + 1j * rng.normal(size=(4, 2))
    block = TruthBlock(
        time_s=TIMES,
        range_m=PATH.range_m(TIMES),
        rate_mps=PATH.rate_mps(TIMES),
        acceleration_mps2=PATH.acceleration_mps2(TIMES),
        clock_m=np.array([10.0, 12.5, 11.0, 14.0]),
        clock_drift_mps=np.array([2.0, 1.0, -1.0, 4.0]),
        iono_diff_m=DIFFERENCE_M,
        ionosphere_e1_m=DIFFERENCE_M / (GAMMA_E1_E6 - 1) if sky else np.zeros(4),
        broadcast_ionosphere_e1_m=np.zeros(4),
        iono_on_carrier=np.ones(4),
        bias_m=np.array([0.1, 0.2, 0.3, 0.4]),
        e1_noise_m=np.zeros(4),
        e1_phase_noise_m=np.zeros(4),
        e1_rate_noise_mps=np.zeros(4),
        e1=E1Loop(NO_SPOOFER, 11, interval_s=1.0, cn0_dbhz=35.0).advance(0, 4),
        e1_attack=NO_SPOOFER.effects(Band.E1, 11, TIMES),
        e6=NO_SPOOFER.effects(Band.E6, 11, TIMES),
        rays=RayBlock(
            delay_m=rng.uniform(1, 50, (4, 2)),
            amplitude=strength,
            amplitude_e1=1j * strength,
            doppler_hz=rng.normal(size=(4, 2)),
        ),
        geometry=SatelliteGeometry.single(4),
    )
    return ContinuousTruth(line_of_sight=PATH, truth=block, e1_multipath=e1_multipath, sky=sky)


def test_goes_through_the_epochs_with_their_drift() -> None:
    one = truth()
    assert one.range_m(TIMES) - PATH.range_m(TIMES) == pytest.approx(one.truth.clock_m, abs=1e-8)
    assert one.rate_mps(TIMES) - PATH.rate_mps(TIMES) == pytest.approx(one.truth.clock_drift_mps, abs=1e-9)


def test_rate_and_acceleration_are_the_derivatives() -> None:
    one, t, h = truth(), np.linspace(2.8, 6.2, 40) + 0.001, 1e-3
    slope = (one.range_m(t + h) - one.range_m(t - h)) / (2 * h)
    assert one.rate_mps(t) == pytest.approx(slope, abs=2e-5)
    assert one.acceleration_mps2(t) == pytest.approx((one.rate_mps(t + h) - one.rate_mps(t - h)) / (2 * h), abs=1e-4)


def test_a_chip_sent_at_the_epoch_arrives_when_it_is_said_to() -> None:
    one = truth()
    t = one.received_s()
    delay_s = (one.range_m(t) + one.truth.iono_diff_m + one.truth.bias_m) / SPEED_OF_LIGHT_MPS
    assert t - delay_s == pytest.approx(TIMES, abs=1e-14)


def test_is_what_the_epoch_says_while_its_recs_arrives() -> None:
    one = truth(e1_multipath=True)
    middle = one.received_s() + 0.008
    for band, ratio in ((Band.E1, E1_CARRIER_HZ / E6_CARRIER_HZ), (Band.E6, 1.0)):
        strength = one.truth.rays.amplitude_e1 if band is Band.E1 else one.truth.rays.amplitude
        for row in range(4):
            found = one.propagation(band, 0.016)(float(middle[row]))
            assert found.delay_m == pytest.approx(one.delay_m(band)[row], abs=1e-9)
            assert found.delay_rate_mps == pytest.approx(0, abs=1e-9)
            assert found.ray_delay_m == pytest.approx(one.truth.rays.delay_m[row])
            assert found.ray_doppler_hz == pytest.approx(ratio * one.truth.rays.doppler_hz[row])
            # the phase of the epoch is that of the RECS's first chip
            back = np.exp(-2j * np.pi * found.ray_doppler_hz * 0.008)
            assert found.ray_amplitude * back == pytest.approx(strength[row])


@pytest.mark.parametrize("band", list(Band))
@pytest.mark.parametrize("sky", [False, True])
def test_nothing_steps_between_the_epochs(band: Band, sky: bool) -> None:
    """Delays, strengths and phases change with the rates that go with them."""
    one = truth(e1_multipath=True, sky=sky)
    geometry = replace(one.truth.geometry, amplitude=np.array([1.0, 0.8, 1.1, 0.9]))
    one = replace(one, truth=replace(one.truth, geometry=geometry))
    held, h = one.propagation(band, 0.016), 1e-4
    for t in np.concatenate([np.linspace(2.5, 6.9, 441), one.received_s() + 0.008]):
        before, here, after = (held(float(t + shift)) for shift in (-h, 0.0, h))
        assert (after.delay_m - before.delay_m) / (2 * h) == pytest.approx(here.delay_rate_mps, abs=2e-2)
        assert abs(abs(after.amplitude) - abs(before.amplitude)) < 1e-3
        turn = np.angle(after.amplitude / before.amplitude) / (4 * np.pi * h)
        assert turn == pytest.approx(here.doppler_hz, abs=0.3)
        strength = np.abs(after.ray_amplitude) - np.abs(before.ray_amplitude)
        assert np.abs(strength).max() < 2e-3
        turns = np.angle(after.ray_amplitude / before.ray_amplitude) / (4 * np.pi * h)
        assert turns == pytest.approx(here.ray_doppler_hz, abs=2e-2)


def test_an_ionosphere_delays_the_code_and_advances_the_carrier() -> None:
    """Under a sky E1 has the residual e/(γ − 1), and E6 the difference e more."""
    one, line = truth(sky=True), truth()
    e1_m = one.truth.iono_diff_m / (GAMMA_E1_E6 - 1)
    for row, t in enumerate(one.received_s() + 0.008):
        for band, code_m, carrier_m in (
            (Band.E1, e1_m[row], e1_m[row]),
            (Band.E6, GAMMA_E1_E6 * e1_m[row] + one.truth.bias_m[row], GAMMA_E1_E6 * e1_m[row]),
        ):
            found = one.propagation(band, 0.016)(float(t))
            assert found.delay_m == pytest.approx(code_m)
            turn = 2 * np.pi * carrier_m * CARRIER_HZ[band] / SPEED_OF_LIGHT_MPS
            assert found.amplitude == pytest.approx(np.exp(1j * turn), abs=1e-6)
    without = line.propagation(Band.E1, 0.016)(4.1)
    assert (without.delay_m, without.ray_delay_m.size, without.amplitude) == (0.0, 0, 1.0)


@pytest.mark.parametrize("sky", [False, True])
def test_a_campaign_has_the_carrier_of_the_recording(sky: bool) -> None:
    """At the first chip of a RECS both have one phase on E6, however long bias and ionosphere are in wavelengths.

    Under a sky an epoch's line of sight is taken on system time, so the block says how far the clock is ahead.
    """
    one = truth(sky=sky)
    # a clock with a constant drift, which epochs and recordings carry on alike between two epochs
    block = replace(one.truth, clock_m=10.0 + 2.0 * TIMES, clock_drift_mps=np.full(4, 2.0))
    if sky:
        block = replace(block, geometry=replace(block.geometry, clock_offset_s=block.clock_m / SPEED_OF_LIGHT_MPS))
    one = replace(one, truth=block)
    found = arrival(PATH, one.truth)
    to_cycles = E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS
    for row, (t_s, dt_s) in enumerate(zip(one.received_s(), found.dt_s, strict=True)):
        # the campaign shifts time tags by the part of the ionosphere that both bands share, and not dt
        later_s = t_s - TIMES[row] - dt_s
        range_m = one.range_m(np.array([t_s]))[0] - later_s * one.rate_mps(np.array([t_s]))[0]
        held = one.propagation(Band.E6, 0.0)(float(t_s))
        assert found.carrier[row] == pytest.approx(held.amplitude * np.exp(-2j * np.pi * to_cycles * range_m), abs=2e-3)
    # the bias alone moves the code and not the carrier
    later = arrival(PATH, replace(one.truth, bias_m=one.truth.bias_m + 0.1))
    assert (later.dt_s - found.dt_s) * SPEED_OF_LIGHT_MPS == pytest.approx(np.full(4, 0.1), abs=1e-5)
    assert later.carrier == pytest.approx(found.carrier, abs=1e-4)
    assert later.rate_mps == pytest.approx(found.rate_mps, abs=1e-6)
