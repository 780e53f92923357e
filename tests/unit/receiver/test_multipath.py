from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from vestige.receiver.errors.error_process import named_streams
from vestige.receiver.errors.multipath import LmsLiteMultipath, RayBlock

C_MPS, F1_HZ, F6_HZ = 299_792_458.0, 1575.42e6, 1278.75e6

FOREVER = LmsLiteMultipath(power_db=-10.0, mean_excess_m=40.0, n_rays=4, speed_mps=5.0, mean_life_m=inf)


def run(model: LmsLiteMultipath, times_s: np.ndarray) -> RayBlock:
    return model.process(named_streams(1, 3)).advance(times_s)


def test_a_lasting_ray_turns_with_its_doppler() -> None:
    times_s = 100 + np.array([0.0, 0.01, 0.5, 0.5, 3.0])
    rays = run(FOREVER, times_s)
    assert np.array_equal(rays.delay_m, np.broadcast_to(rays.delay_m[0], rays.delay_m.shape))
    assert np.array_equal(rays.doppler_hz, np.broadcast_to(rays.doppler_hz[0], rays.doppler_hz.shape))
    cycles = rays.doppler_hz * (times_s - times_s[0])[:, None]
    assert rays.amplitude / rays.amplitude[0] == pytest.approx(np.exp(2j * np.pi * cycles), abs=1e-9)
    on_e1 = np.exp(2j * np.pi * cycles * F1_HZ / F6_HZ)
    assert rays.amplitude_e1 / rays.amplitude_e1[0] == pytest.approx(on_e1, abs=1e-9)


def test_a_new_ray_is_the_same_reflection_on_both_carriers() -> None:
    """A delay τ turns a carrier by −f τ cycles, so two carriers differ by (f1 − f6) τ."""
    rays = run(LmsLiteMultipath.elevation_5_30(), np.arange(50.0))
    apart = np.exp(-2j * np.pi * (F1_HZ - F6_HZ) * rays.delay_m / C_MPS)
    assert rays.amplitude_e1 / rays.amplitude == pytest.approx(apart, abs=1e-9)


def test_doppler_is_at_most_that_of_driving_towards_the_reflector() -> None:
    rays = run(replace(FOREVER, n_rays=500), np.zeros(1))
    assert 0.999 < np.max(np.abs(rays.doppler_hz)) / (5.0 * F6_HZ / C_MPS) <= 1


def test_a_life_of_zero_makes_every_epoch_new() -> None:
    for model in (replace(FOREVER, mean_life_m=0.0), replace(FOREVER, mean_life_s=0.0)):
        for speed_mps in (0.0, 5.0):
            rays = run(replace(model, speed_mps=speed_mps), np.zeros(50))
            assert np.unique(rays.delay_m).size == rays.delay_m.size


def test_a_standing_receiver_keeps_its_rays() -> None:
    rays = run(LmsLiteMultipath(power_db=-10.0, mean_excess_m=40.0, speed_mps=0.0), np.arange(50.0))
    assert np.unique(rays.amplitude).size == 1
    assert np.all(rays.doppler_hz == 0)


def test_a_ray_changes_as_a_whole() -> None:
    rays = run(replace(FOREVER, mean_life_m=5.0), np.arange(200.0))
    changed = np.diff(rays.delay_m, axis=0) != 0
    assert 0 < np.mean(changed) < 1
    assert np.array_equal(changed, np.diff(rays.doppler_hz, axis=0) != 0)
    magnitude = np.abs(rays.amplitude)
    assert np.array_equal(changed, np.abs(np.diff(magnitude, axis=0)) > 1e-9)


def test_power_falls_with_delay() -> None:
    flat, falling = (run(replace(FOREVER, slope_db_per_us=slope), np.zeros(1)) for slope in (0.0, 20.0))
    loss_db = 20 * np.log10(np.abs(falling.amplitude / flat.amplitude))
    assert loss_db == pytest.approx(-20 * flat.delay_m / (C_MPS * 1e-6))


def test_the_rays_share_the_power() -> None:
    one, four = (run(replace(FOREVER, mean_rays=mean_rays), np.zeros(1)) for mean_rays in (1000.0, None))
    assert np.abs(four.amplitude / one.amplitude) == pytest.approx(np.sqrt(1000 / 4))


@pytest.mark.parametrize(
    ("model", "power_db", "mean_excess_m"),
    [
        (LmsLiteMultipath.elevation_5_30(), -15.8, 40),
        (LmsLiteMultipath.open_sky(), -22, 20),
        (LmsLiteMultipath.at_elevation(5), -14, 40),
        (LmsLiteMultipath.at_elevation(17.5), -16, 40),
        (LmsLiteMultipath.at_elevation(30), -18, 40),
        (LmsLiteMultipath.at_elevation(2), -14, 40),
        (LmsLiteMultipath.at_elevation(60), -22, 20),
    ],
)
def test_presets(model: LmsLiteMultipath, power_db: float, mean_excess_m: float) -> None:
    assert (model.power_db, model.mean_excess_m, model.n_rays) == pytest.approx((power_db, mean_excess_m, 1))
    assert model.death_rate_hz == inf


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"n_rays": 0}, "one reflection"),
        ({"mean_rays": 0.0}, "one reflection"),
        ({"mean_excess_m": 0.0}, "positive"),
        ({"max_excess_m": -1.0}, "positive"),
        ({"speed_mps": -1.0}, "negative"),
        ({"mean_life_m": -1.0}, "negative"),
        ({"mean_life_s": np.nan}, "negative"),
    ],
)
def test_parameters_must_make_sense(wrong: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(FOREVER, **wrong)
