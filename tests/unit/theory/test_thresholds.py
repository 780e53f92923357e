from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import i0e
from scipy.stats import chi2, ncx2

from vestige.theory.thresholds import (
    correlator_amplitude,
    miss_probability,
    overall_pfa,
    probability_of_detection,
    required_cn0_dbhz,
    single_event_pfa,
    swerling1_probability_of_detection,
    threshold,
)

pfas = st.floats(-15, -1).map(lambda exponent: 10.0**exponent)
cn0s = st.floats(20, 50)
times = st.floats(1e-3, 0.1)
sums = st.integers(1, 20)


@given(st.floats(-12, -0.01).map(lambda e: 10.0**e), st.floats(0, 12).map(lambda e: 10.0**e))
def test_single_and_overall_false_alarm_are_inverse(overall: float, n: float) -> None:
    assert overall_pfa(single_event_pfa(overall, n), n) == pytest.approx(overall, rel=1e-12)


def test_overall_false_alarm_of_two_tests() -> None:
    assert overall_pfa(0.25, 2) == pytest.approx(1 - 0.75**2)
    assert single_event_pfa(0.4375, 2) == pytest.approx(0.25)


@given(pfas, sums)
def test_noise_exceeds_the_threshold_with_the_false_alarm_probability(pfa: float, k: int) -> None:
    g = threshold(pfa, k)
    assert chi2.sf(g**2, 2 * k) == pytest.approx(pfa, rel=1e-9)  # the sum of 2K squared normal variables


@given(cn0s, times, pfas, sums)
def test_probability_of_detection_is_noncentral_chi_squared(cn0: float, time_s: float, pfa: float, k: int) -> None:
    strength = 2 * k * 10 ** (cn0 / 10) * time_s
    limit = chi2.isf(pfa, 2 * k)
    expected = ncx2.sf(limit, 2 * k, strength)
    assert probability_of_detection(cn0, time_s, pfa, k) == pytest.approx(expected, rel=1e-7)
    if (miss := ncx2.cdf(limit, 2 * k, strength)) > 1e-100:
        assert miss_probability(cn0, time_s, pfa, k) == pytest.approx(miss, rel=1e-7)


def test_miss_does_not_drown_in_the_subtraction() -> None:
    # Independently: the Rice density below the threshold, integrated with the exponential taken out.
    a, g = correlator_amplitude(37.8, 16e-3), threshold(1e-7)
    integral, _ = quad(lambda t: (g - t) * np.exp(-(a - g) * t - t**2 / 2) * i0e(a * (g - t)), 0, g, epsrel=1e-12)
    expected = np.exp(-((a - g) ** 2) / 2) * integral
    assert 1e-18 < expected < 1e-16  # 1 − P_d is 0 in floating point
    assert miss_probability(37.8, 16e-3, 1e-7) == pytest.approx(expected, rel=1e-10, abs=0)


@given(times, pfas, sums)
def test_a_signal_of_nothing_is_detected_as_often_as_noise(time_s: float, pfa: float, k: int) -> None:
    assert probability_of_detection(-200.0, time_s, pfa, k) == pytest.approx(pfa, rel=1e-9, abs=0)


@settings(max_examples=30)
@given(st.floats(0.01, 1 - 1e-9), times, st.floats(-15, -3).map(lambda e: 10.0**e), sums)
def test_required_cn0_inverts_the_probability_of_detection(pd: float, time_s: float, pfa: float, k: int) -> None:
    cn0 = required_cn0_dbhz(pd, time_s, pfa, k)
    assert probability_of_detection(cn0, time_s, pfa, k) == pytest.approx(pd, rel=1e-9)
    assert miss_probability(cn0, time_s, pfa, k) == pytest.approx(1 - pd, rel=1e-6)  # 1 − pd is itself rounded


def test_required_cn0_is_monotone_down_to_a_false_alarm_of_1e_15() -> None:
    pd = np.linspace(0.02, 0.999, 50)
    curves = [required_cn0_dbhz(pd, 4e-3, 10.0**exponent) for exponent in range(-2, -16, -1)]
    assert np.all(np.diff(curves, axis=1) > 0)  # more to detect more
    assert np.all(np.diff(curves, axis=0) > 0)  # more for fewer false alarms
    longer = [required_cn0_dbhz(0.9, time_s, 1e-15) for time_s in (1e-3, 4e-3, 16e-3)]
    np.testing.assert_allclose(np.diff(longer), -10 * np.log10(4), rtol=1e-12)  # only C/N0 · T_I counts


@given(cn0s, times, pfas)
def test_swerling_1_is_the_mean_over_a_rayleigh_amplitude(cn0: float, time_s: float, pfa: float) -> None:
    # signal plus noise is again complex Gaussian, of variance 1 + A²/2 per dimension
    spread = 1 + correlator_amplitude(cn0, time_s) ** 2 / 2
    expected = np.exp(-(threshold(pfa) ** 2) / (2 * spread))
    assert swerling1_probability_of_detection(cn0, time_s, pfa) == pytest.approx(expected, rel=1e-9)


def test_reference_values() -> None:
    assert swerling1_probability_of_detection(35.0, 16e-3, 1e-7) == pytest.approx(0.7317, abs=5e-5)
    assert probability_of_detection(35.0, 4e-3, 1e-7, 4) == pytest.approx(0.999808, abs=5e-7)
    assert correlator_amplitude(35.0, 16e-3) == pytest.approx(10.06, abs=0.005)
    for pd, expected in ((0.9, (37.720, 34.709, 31.699)), (0.999, (39.757, 36.746, 33.736))):
        found = [required_cn0_dbhz(pd, time_s, 1e-7) for time_s in (4e-3, 8e-3, 16e-3)]
        assert found == pytest.approx(expected, abs=5e-4)


def test_one_epoch_gives_the_same_bits_as_a_block() -> None:
    cn0 = np.linspace(25, 45, 37)
    alone = [probability_of_detection(cn0[i : i + 1], 16e-3, 1e-7)[0] for i in range(37)]
    np.testing.assert_array_equal(probability_of_detection(cn0, 16e-3, 1e-7), alone)


def test_an_array_gives_what_its_numbers_give() -> None:
    cn0 = np.array([[30.0, 33.0], [35.0, float("nan")]])
    pd = probability_of_detection(cn0, 16e-3, 1e-7)
    assert pd.shape == (2, 2)
    np.testing.assert_allclose(pd[0], [probability_of_detection(c, 16e-3, 1e-7) for c in (30.0, 33.0)], rtol=1e-14)
    assert np.isnan(pd[1, 1])
    np.testing.assert_allclose(
        required_cn0_dbhz(np.array([0.5, 0.9]), 16e-3, 1e-7), [required_cn0_dbhz(p, 16e-3, 1e-7) for p in (0.5, 0.9)]
    )


@pytest.mark.parametrize("pfa", [0.0, 1.0, -1e-7, float("nan")])
def test_refuses_what_is_no_probability(pfa: float) -> None:
    with pytest.raises(ValueError, match="between 0 and 1"):
        threshold(pfa)


def test_refuses_to_ask_for_less_than_false_alarms_give() -> None:
    with pytest.raises(ValueError, match="must exceed"):
        required_cn0_dbhz(1e-8, 16e-3, 1e-7)
    with pytest.raises(ValueError, match="at least 1"):
        single_event_pfa(1e-3, 0.5)
