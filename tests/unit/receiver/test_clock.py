from __future__ import annotations

import numpy as np
import pytest

from vestige.receiver.errors.clock import TwoStateClock
from vestige.receiver.errors.error_process import named_streams

C_MPS = 299_792_458.0


def test_noise_of_the_paper_in_a_second() -> None:
    clock = TwoStateClock()
    assert clock.white_s * C_MPS**2 == pytest.approx(3.19732e-7, rel=1e-5)
    assert clock.walk_hz * C_MPS**2 == pytest.approx(7.64802e-3, rel=1e-5)
    expected = np.array([[2.83688e-20, 4.25479e-20], [4.25479e-20, 8.50957e-20]])
    assert clock.covariance(1.0) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    ("step_s", "bias_m", "drift_mps"),
    [(16e-3, 0.125e-3, 1.11e-2), (1.0, 5.05e-2, 8.745e-2), (30.0, 8.30, 0.479), (1e5, 1.60e6, 27.66)],
)
def test_growth_of_the_clock_of_the_paper(step_s: float, bias_m: float, drift_mps: float) -> None:
    deviations = C_MPS * np.sqrt(np.diag(TwoStateClock().covariance(step_s)))
    assert deviations == pytest.approx([bias_m, drift_mps], rel=5e-3)  # the printed digits


def test_allan_deviation_of_the_paper() -> None:
    tau_s = np.array([0.01, 0.1, 1, 10, 100, 1000])
    expected = [2.5286e-11, 5.3592e-11, 1.6843e-10, 5.3259e-10, 1.6842e-9, 5.3259e-9]
    clock = TwoStateClock()
    assert np.sqrt(clock.h0_s / (2 * tau_s) + clock.walk_hz * tau_s / 3) == pytest.approx(expected, rel=5e-5)


def test_two_steps_are_one() -> None:
    clock, first, second = TwoStateClock(h0_s=1e-3, h_minus_2_hz=1e-3), 0.7, 1.9
    transition = np.array([[1.0, second], [0.0, 1.0]])
    total = transition @ clock.covariance(first) @ transition.T + clock.covariance(second)
    assert clock.covariance(first + second) == pytest.approx(total, rel=1e-14)


def test_starts_right_and_keeps_still_in_no_time() -> None:
    process = TwoStateClock().process(named_streams(1))
    bias_m, drift_mps = process.advance(np.array([0.0, 0.0, 2.0, 2.0]))
    assert (bias_m[:2].tolist(), drift_mps[:2].tolist()) == ([0.0, 0.0], [0.0, 0.0])
    assert bias_m[2] == bias_m[3] != 0
    assert drift_mps[2] == drift_mps[3] != 0


def test_without_noise_in_between_the_drift_carries_the_bias() -> None:
    """Over a step that is short against the one before, the bias moves by drift times time."""
    process = TwoStateClock(h0_s=0.0).process(named_streams(1))
    (before,), (drift,) = process.advance(np.array([1e4]))
    (after,), _ = process.advance(np.array([1e4 + 1e-2]))
    assert after - before == pytest.approx(drift * 1e-2, rel=1e-2)


@pytest.mark.parametrize("clock", [{"h0_s": -1.0}, {"h_minus_2_hz": -1.0}, {"h0_s": np.nan}])
def test_noise_is_not_negative(clock: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="negative"):
        TwoStateClock(**clock)
