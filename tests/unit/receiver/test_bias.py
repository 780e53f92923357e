from __future__ import annotations

import numpy as np
import pytest

from vestige.receiver.errors.bias import BiasResiduals
from vestige.receiver.errors.error_process import named_streams

MODEL = BiasResiduals(bgd_sigma_m=1.5, hardware_sigma_m=3.0, hardware_drift_mps=1e-3)


def run(model: BiasResiduals, svid: int, times_s: np.ndarray, seed: int = 1) -> np.ndarray:
    return model.process(named_streams(seed, svid), receiver=named_streams(seed)).advance(times_s)


def test_it_is_a_straight_line() -> None:
    found = run(MODEL, 3, np.array([0.0, 10.0, 30.0]))
    assert found[2] - found[0] == pytest.approx(3 * (found[1] - found[0]))
    assert found[1] != found[0]


def test_hardware_is_common_and_group_delay_is_not() -> None:
    times_s = np.array([0.0, 1000.0])
    one, two = run(MODEL, 3, times_s), run(MODEL, 4, times_s)
    assert one[1] - one[0] == pytest.approx(two[1] - two[0])
    assert one[0] != two[0]
    hardware = BiasResiduals(hardware_sigma_m=3.0)
    assert np.array_equal(run(hardware, 3, times_s), run(hardware, 4, times_s))


def test_standard_deviations_over_runs() -> None:
    """2000 runs: 5 standard deviations of a standard deviation are 8 %."""
    for model, time_s, sigma in (
        (BiasResiduals(bgd_sigma_m=1.5), 0.0, 1.5),
        (BiasResiduals(hardware_sigma_m=3.0), 0.0, 3.0),
        (BiasResiduals(hardware_drift_mps=1e-3), 1e3, 1.0),
        (MODEL, 1e3, np.sqrt(1.5**2 + 3.0**2 + 1.0**2)),
    ):
        values = [run(model, 3, np.array([time_s]), seed)[0] for seed in range(2000)]
        assert np.std(values) == pytest.approx(sigma, rel=0.08)
        assert abs(np.mean(values)) < 5 * sigma / np.sqrt(2000)


@pytest.mark.parametrize("name", ["bgd_sigma_m", "hardware_sigma_m", "hardware_drift_mps"])
def test_standard_deviations_are_not_negative(name: str) -> None:
    with pytest.raises(ValueError, match="negative"):
        BiasResiduals(**{name: -1.0})
