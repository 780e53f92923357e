from __future__ import annotations

import numpy as np
import pytest

from vestige.acas_processor.checks.power.power_distortion import (
    distortion_variance,
    mean_distortion,
    power_rise_db,
)
from vestige.campaign.statistics import binomial_test
from vestige.signals.pulse import BOC11, BPSK, autocorrelation
from vestige.streams import stream
from vestige.theory.marcum_q import marcum_q

LEVEL = 1e-4


@pytest.mark.parametrize(("half_spacing", "threshold"), [(0.1, 2.351), (0.15, 2.879), (0.25, 3.717), (0.5, 5.257)])
def test_thresholds(half_spacing: float, threshold: float) -> None:
    """The 99.9 % point of the distortion of a clean triangle [WESSON18]."""
    assert np.sqrt(-2 * distortion_variance(half_spacing) * np.log(1e-3)) == pytest.approx(threshold, abs=5e-4)


def test_variance() -> None:
    assert distortion_variance(0.15) == pytest.approx(0.6)
    assert distortion_variance(0.1, BOC11) == pytest.approx(2 * 3 * 0.2)


ADVANTAGE_DB = np.array([0.4, 1.3, 3.0, 6.0, 10.0, 13.0, 20.0])


@pytest.mark.parametrize(
    ("bandwidth_hz", "rise_db"),
    [
        (2e6, [0.61, 0.73, 1.05, 1.89, 3.74, 5.71, 11.66]),
        (4e6, [0.34, 0.41, 0.59, 1.11, 2.39, 3.91, 9.20]),
        (20e6, [0.07, 0.09, 0.13, 0.26, 0.63, 1.17, 4.08]),
    ],
)
def test_rise_of_the_power(bandwidth_hz: float, rise_db: list[float]) -> None:
    """Ten satellites at 45 dBHz."""
    r = 10 * 10**4.5 / bandwidth_hz
    found = power_rise_db(10 ** (ADVANTAGE_DB / 10), np.zeros(7), signals_to_noise=r)
    np.testing.assert_allclose(found, rise_db, atol=5.1e-3)


def test_a_second_signal_on_top_does_not_bend() -> None:
    np.testing.assert_allclose(mean_distortion(np.zeros((2, 3)), 0.15), np.zeros((2, 3)))
    np.testing.assert_allclose(mean_distortion(np.array([0.1, -0.1]), 0.15), [0.2, 0.2])


@pytest.mark.parametrize("eta_db", [-300.0, -20.0, -14.0])
def test_rate_of_alarms(eta_db: float) -> None:
    """Taps with correlated noise and a second signal of any phase."""
    n, p_fa, spacing, offset, cn0, integration = 100_000, 0.01, 0.25, 0.4, 42.0, 0.02
    rng = stream(9, "distortion", str(eta_db))
    correlation = autocorrelation(BPSK, np.array([2 * spacing]))[0]
    z = rng.standard_normal((2, n)) + 1j * rng.standard_normal((2, n))
    noise = np.stack((z[0], correlation * z[0] + np.sqrt(1 - correlation**2) * z[1]))
    s = np.sqrt(2 * 10 ** (cn0 / 10) * integration)
    phasor = np.sqrt(10 ** (eta_db / 10)) * np.exp(2j * np.pi * rng.random(n))
    own = autocorrelation(BPSK, np.array([spacing]))[0]
    other = autocorrelation(BPSK, np.array([-spacing - offset, spacing - offset]))
    early, late = (s * (own + phasor * other[k]) + noise[k] for k in range(2))
    spread = np.sqrt(distortion_variance(spacing))
    threshold = spread * np.sqrt(-2 * np.log(p_fa))
    alarms = np.abs(early - late) > threshold
    mean = s * np.sqrt(10 ** (eta_db / 10)) * mean_distortion(np.array([offset]), spacing)
    expected = marcum_q(mean / spread, threshold / spread)
    assert binomial_test(int(alarms.sum()), n, float(expected[0])) > LEVEL
