from __future__ import annotations

import numpy as np
import pytest

from vestige.errors import VestigeError
from vestige.sample_processor.tracking.loop_gains import loop_gains, noise_bandwidth_hz


def _run(gains: tuple[float, float, float], phases: np.ndarray) -> np.ndarray:
    """Run a loop step by step; return the phase of its oscillator at the middle of each integration."""
    phase, rate, frequency, acceleration = 0.0, 0.0, 0.0, 0.0
    followed = np.empty(phases.size)
    for k, sent in enumerate(phases):
        followed[k] = phase
        error = sent - phase
        acceleration += gains[2] * error
        frequency += acceleration + gains[1] * error
        before, rate = rate, frequency + gains[0] * error
        phase += (before + rate) / 2
    return followed


@pytest.mark.parametrize(
    ("order", "bandwidth_hz", "interval_s"),
    [(1, 1.0, 0.004), (1, 10.0, 0.004), (2, 15.0, 0.004), (3, 15.0, 0.004), (3, 25.0, 0.004), (3, 6.0, 0.02)],
)
def test_noise_bandwidth_is_that_of_the_impulse_response(order: int, bandwidth_hz: float, interval_s: float) -> None:
    """B = Σ h² / 2T, with h measured on a loop that is run; exact to the length of the response."""
    gains = loop_gains(order, bandwidth_hz, interval_s)
    impulse = np.zeros(20_000)
    impulse[0] = 1.0
    response = _run(gains, impulse)
    assert np.sum(response**2) / (2 * interval_s) == pytest.approx(bandwidth_hz, rel=1e-6)


def test_order_three_follows_an_acceleration_and_order_two_lags_by_it() -> None:
    t = np.arange(5000) * 0.004
    parabola = 0.5 * 25.0 * t**2  # 25 Hz/s, 5 m/s² on E1
    third = _run(loop_gains(3, 15.0, 0.004), parabola) - parabola
    second_gains = loop_gains(2, 15.0, 0.004)
    second = _run(second_gains, parabola) - parabola
    assert abs(third[-1]) < 1e-9
    assert second[-1] == pytest.approx(-25.0 * 0.004**2 / second_gains[1], rel=1e-6)


def test_a_loop_that_rings_has_no_bandwidth() -> None:
    assert noise_bandwidth_hz((2.5, 0.0, 0.0), 0.004) == float("inf")


def test_too_wide_a_loop_is_refused() -> None:
    with pytest.raises(VestigeError, match=r"loop of order 3 with 100 Hz cannot be updated every 20 ms"):
        loop_gains(3, 100.0, 0.02)
