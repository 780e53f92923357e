from __future__ import annotations

import numpy as np
import pytest

from builders import received_batch, satellite
from vestige.records import Band


def test_noise_has_unit_power_and_no_colour() -> None:
    x = received_batch(Band.E6, [], rate_hz=5e6, duration_s=0.1).samples
    n = x.size
    assert np.mean(np.abs(x) ** 2) == pytest.approx(1.0, abs=5 / np.sqrt(n))
    assert abs(np.mean(x[1:] * x[:-1].conj())) < 5 / np.sqrt(n)
    assert abs(np.mean(x**2)) < 6 / np.sqrt(n)  # circular


def test_power_of_the_components() -> None:
    """E6-B and E6-C of 67 dBHz each at 5 MHz add two unit powers to the noise."""
    cn0 = 10 * np.log10(5e6)
    x = received_batch(Band.E6, [satellite(5, 2.4e7, 10.0, cn0, cn0)], rate_hz=5e6, duration_s=0.02).samples
    assert np.mean(np.abs(x) ** 2) == pytest.approx(3.0, abs=0.1)


def test_same_seed_same_bits() -> None:
    sky = [satellite(5, 2.4e7, 10.0, 45.0, 45.0)]
    a, b, c = (received_batch(Band.E1, sky, duration_s=0.01, seed=seed).samples for seed in (1, 1, 2))
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)
