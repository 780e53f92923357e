from __future__ import annotations

import numpy as np
import pytest

from vestige.navigation.elevation_model import obliquity, relative_ray_amplitude
from vestige.receiver.errors.error_process import named_streams
from vestige.receiver.errors.ionosphere import HeavyTailedIonosphere
from vestige.receiver.errors.tracking_noise import BetzTrackingNoise, noise_growth
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.receiver.sky.elevation import SatelliteRange
from vestige.receiver.sky.trajectory import CircularTrajectory
from vestige.time import GalileoTime


def test_rays_have_the_power_of_the_model_at_each_elevation() -> None:
    power_db = 20 * np.log10(relative_ray_amplitude(np.radians(np.array([5.0, 16.0, 30.0, 60.0]))))
    assert power_db == pytest.approx([-14 + 15.8, -14 - 4 * 11 / 25 + 15.8, -18 + 15.8, -22 + 15.8], abs=0.05)


def test_obliquity_is_that_of_a_thin_shell() -> None:
    zenith, low = obliquity(np.radians(np.array([90.0, 5.0])))
    assert low / zenith == pytest.approx(1 / np.sqrt(1 - (np.cos(np.radians(5)) * 6371 / 6721) ** 2))
    assert obliquity(np.radians(np.array([17.5]))) == pytest.approx(1.0)


def test_range_rate_and_acceleration_are_derivatives() -> None:
    start = GalileoTime.parse("2026-11-21T23:59:50 GST")
    circle = CircularTrajectory(latitude_deg=10.0, longitude_deg=20.0, radius_m=50.0, speed_mps=20.0)
    path = SatelliteRange(ephemeris=walker_ephemerides(start)[4], start=start, trajectory=circle)
    t, h = np.linspace(0, 20, 9), 1e-2
    assert path.rate_mps(t) == pytest.approx((path.range_m(t + h) - path.range_m(t - h)) / (2 * h), abs=1e-3)
    assert path.acceleration_mps2(t) == pytest.approx((path.rate_mps(t + h) - path.rate_mps(t - h)) / (2 * h), abs=1e-3)


def test_the_range_has_the_same_bits_whether_the_line_of_sight_is_known_or_not() -> None:
    start = GalileoTime.parse("2026-11-21T23:59:50 GST")
    circle = CircularTrajectory(latitude_deg=10.0, longitude_deg=20.0, radius_m=50.0, speed_mps=20.0)
    paths = [SatelliteRange(ephemeris=walker_ephemerides(start)[4], start=start, trajectory=circle) for _ in range(2)]
    for begin_s in range(7):
        t_s = begin_s + np.linspace(0, 20, 9)
        paths[1].rate_mps(t_s)
        np.testing.assert_array_equal(paths[1].range_m(t_s), paths[0].range_m(t_s))


def test_the_common_ionosphere_correlates_satellites_and_leaves_their_distribution() -> None:
    model, n, share = HeavyTailedIonosphere.average_2017(), 20_000, 0.64
    times_s = np.arange(float(n))
    z = []
    for svid in (1, 2):
        own = model.process(named_streams(7, svid))
        values = own.shared(named_streams(7), share).advance(times_s)
        tail = np.count_nonzero(np.abs(values) > 3.0)
        expected = 2 * float(model.exceedance(np.array([3.0]))[0]) * n
        assert abs(tail - expected) < 4.9 * np.sqrt(expected)
        z.append(np.clip(values, -0.7, 0.7))  # the core, nearly Gaussian
    assert np.corrcoef(z)[0, 1] == pytest.approx(share, abs=0.08)


def test_noise_grows_as_the_loops_say() -> None:
    model = BetzTrackingNoise()
    gain_db = np.array([-9.0, -8.5, -3.3, 0.0])
    code, doppler = noise_growth(model, 45.0, gain_db)
    for gain, c, d in zip(gain_db.tolist(), code, doppler, strict=True):
        assert c == pytest.approx(model.code_sigma_m(45 + gain) / model.code_sigma_m(45), rel=2e-3)
        assert d == pytest.approx(model.doppler_sigma_hz(45 + gain) / model.doppler_sigma_hz(45), rel=2e-3)
