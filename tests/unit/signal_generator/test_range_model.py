from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.signal_generator.range_model import RangeModel

PAPER = RangeModel(v_mps=51.023, amplitude_m=0.5012, omega_radps=2 * np.pi * 0.5012)

numbers = st.floats(-1e3, 1e3)


@given(numbers, numbers, st.floats(-50, 50), st.floats(-10, 10), st.floats(0, 10), st.floats(-20, 20))
def test_derivatives(s0: float, v: float, a: float, amplitude: float, omega: float, t: float) -> None:
    model = RangeModel(s0_m=s0, v_mps=v, a_mps2=a, amplitude_m=amplitude, omega_radps=omega)
    h = 1e-4
    around = np.array([t - h, t, t + h])
    s, rate = model.range_m(around), model.rate_mps(around)
    assert (s[2] - s[0]) / (2 * h) == pytest.approx(model.rate_mps(np.array([t]))[0], abs=2e-4)
    assert (rate[2] - rate[0]) / (2 * h) == pytest.approx(model.acceleration_mps2(np.array([t]))[0], abs=2e-3)


def test_the_paper_parameters() -> None:
    """Range rate 49.445 to 52.601 m/s, 4.970 m/s² = 0.507 g (the paper says 9 g)."""
    t = np.linspace(0, 10, 100_001)
    assert PAPER.rate_mps(t).min() == pytest.approx(49.445, abs=5e-4)
    assert PAPER.rate_mps(t).max() == pytest.approx(52.601, abs=5e-4)
    assert np.abs(PAPER.acceleration_mps2(t)).max() == pytest.approx(4.970, abs=5e-4)
