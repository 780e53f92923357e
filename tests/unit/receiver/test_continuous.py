from __future__ import annotations

import numpy as np
import pytest

from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.e1_loop import E1Loop
from vestige.receiver.errors.multipath import RayBlock
from vestige.receiver.samples.continuous import ContinuousTruth
from vestige.receiver.sky.elevation import SatelliteGeometry
from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.signal_generator.range_model import RangeModel
from vestige.spoofer.spoofer import NO_SPOOFER

PATH = RangeModel(s0_m=2.5e7, v_mps=51.0, amplitude_m=0.5, omega_radps=3.1)
TIMES = np.array([3.0, 4.0, 5.0, 6.0])


def truth(e1_multipath: bool = False) -> ContinuousTruth:
    rng = np.random.default_rng(1)
    strength = rng.normal(size=(4, 2)) + 1j * rng.normal(size=(4, 2))
    block = TruthBlock(
        time_s=TIMES,
        range_m=PATH.range_m(TIMES),
        rate_mps=PATH.rate_mps(TIMES),
        acceleration_mps2=PATH.acceleration_mps2(TIMES),
        clock_m=np.array([10.0, 12.5, 11.0, 14.0]),
        clock_drift_mps=np.array([2.0, 1.0, -1.0, 4.0]),
        iono_diff_m=np.array([1.0, -2.0, 4.0, 0.5]),
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
        view=SatelliteGeometry.single(4),
    )
    return ContinuousTruth(line_of_sight=PATH, truth=block, e1_multipath=e1_multipath)


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


def test_holds_what_belongs_to_the_nearest_recs() -> None:
    one = truth()
    held = one.propagation(Band.E6, 0.016)
    middle = one.received_s() + 0.008
    for row, t in ((0, 0.0), (0, middle[0] + 0.49), (1, middle[1] - 0.49), (2, middle[2]), (3, 99.0)):
        found = held(t)
        assert found.delay_m == one.truth.iono_diff_m[row] + one.truth.bias_m[row]
        assert found.at_s == one.received_s()[row]
        assert np.array_equal(found.ray_delay_m, one.truth.rays.delay_m[row])
        assert np.array_equal(found.ray_amplitude, one.truth.rays.amplitude[row])


def test_e1_has_no_group_delay_and_rays_only_if_wanted() -> None:
    without = truth().propagation(Band.E1, 0.016)(4.1)
    assert (without.delay_m, without.ray_delay_m.size) == (0.0, 0)
    one = truth(e1_multipath=True)
    found = one.propagation(Band.E1, 0.016)(4.1)
    assert found.delay_m == 0.0
    assert np.array_equal(found.ray_amplitude, one.truth.rays.amplitude_e1[1])
    assert found.ray_doppler_hz == pytest.approx(one.truth.rays.doppler_hz[1] * E1_CARRIER_HZ / E6_CARRIER_HZ)
