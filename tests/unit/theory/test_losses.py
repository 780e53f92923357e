from __future__ import annotations

import numpy as np
import pytest

from vestige.theory import losses

T_S = 16e-3


@pytest.mark.parametrize(("step", "worst", "mean"), [(15 / 58.6105, 1.19, 0.57), (0.5, 2.50, 1.13), (1.0, 6.02, 2.34)])
def test_code_grid(step: float, worst: float, mean: float) -> None:
    assert losses.code_grid_loss(step) == pytest.approx((worst, mean), abs=0.005)


@pytest.mark.parametrize(("bins", "worst", "mean"), [(1 / 2, 0.91, 0.29), (2 / 3, 1.65, 0.51), (1.0, 3.92, 1.11)])
def test_doppler_grid(bins: float, worst: float, mean: float) -> None:
    assert losses.doppler_grid_loss(bins / T_S, T_S) == pytest.approx((worst, mean), abs=0.005)


def test_grid_means_are_means() -> None:
    error = (np.arange(10_000) + 0.5) / 10_000 / 2  # 0 … half a step
    mean = -10 * np.log10(np.mean((1 - 0.5 * error) ** 2))
    assert losses.code_grid_loss(0.5).mean_db == pytest.approx(mean, rel=1e-6)
    mean = -10 * np.log10(np.mean(np.sinc(error) ** 2))
    assert losses.doppler_grid_loss(1 / T_S, T_S).mean_db == pytest.approx(mean, rel=1e-6)


def test_acceleration_is_the_variance_of_its_phase() -> None:
    # small: loss = var φ, φ = k t², var = k² T⁴ / 180
    for acceleration in (4.970, 9 * 9.80665):
        k = np.pi * acceleration / 299_792_458 * 1278.75e6
        expected = 10 / np.log(10) * k**2 * T_S**4 / 180
        assert losses.acceleration_loss_db(acceleration, T_S) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("doppler", "time_s", "loss"), [(5e3, 16e-3, 0.72), (-2.5e3, 16e-3, 0.35), (1e3, 16e-3, 0.14), (5e3, 4e-3, 0.18)]
)
def test_code_doppler(doppler: float, time_s: float, loss: float) -> None:
    assert losses.code_doppler_loss_db(doppler, time_s) == pytest.approx(loss, abs=0.005)


@pytest.mark.parametrize(("mhz", "loss"), [(10.23, 0.44), (20.46, 0.22), (40.92, 0.11)])
def test_front_end(mhz: float, loss: float) -> None:
    assert losses.front_end_loss_db(mhz * 1e6) == pytest.approx(loss, abs=0.005)


def test_quantisation() -> None:
    assert losses.quantisation_loss_db(1) == pytest.approx(-10 * np.log10(2 / np.pi))
    assert losses.quantisation_loss_db(2) == pytest.approx(0.55, abs=0.005)
    with pytest.raises(ValueError, match="1 and 2 bits"):
        losses.quantisation_loss_db(3)
