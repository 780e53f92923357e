"""Detection and range offset on correlators drawn from their exact model, against theory and reference numbers.

Model: c_k = A Tri(d_k − δ) e^{jφ} + w_k, w complex Gaussian, unit variance per dimension, covariance Tri(d_i − d_j); 11
taps 15 m apart, 16 ms, P_fa 1e-7. Counts are compared two-sided at 4.4 standard deviations (an error of 1e-5 each).
"""

from __future__ import annotations

import numpy as np
import pytest

from vestige.acas_processor.detectors import EarlyDetector, MaximumDetector
from vestige.theory.hypotheses import effective_taps
from vestige.theory.range_offset import range_offset_m
from vestige.theory.thresholds import miss_probability, threshold

CHIP_M = 299_792_458 / 5.115e6
BANK_M = 15.0 * (np.arange(11) - 5)
T_S, PFA = 16e-3, 1e-7
EPOCHS = 200_000
SIGMAS = 4.4


def magnitudes(seed: int, amplitude: float, peak_m: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(seed)
    covariance = np.clip(1 - np.abs(BANK_M[:, None] - BANK_M) / CHIP_M, 0, None)
    white = rng.standard_normal((peak_m.size, 11)) + 1j * rng.standard_normal((peak_m.size, 11))
    phase = np.exp(2j * np.pi * rng.random(peak_m.size))
    signal = amplitude * np.clip(1 - np.abs(BANK_M - peak_m[:, None]) / CHIP_M, 0, None)
    return np.abs(signal * phase[:, None] + white @ np.linalg.cholesky(covariance).T)


def amplitude_at(cn0_dbhz: float) -> float:
    return float(np.sqrt(2 * 10 ** (cn0_dbhz / 10) * T_S))


def expect(count: int, probability: float, trials: int) -> None:
    spread = np.sqrt(trials * probability * (1 - probability))
    assert abs(count - trials * probability) < SIGMAS * spread


@pytest.mark.judged(by="theory", what="misses of an aligned correlator", figure="200,000 epochs, within 4.4 σ")
@pytest.mark.parametrize(("seed", "cn0"), [(1, 33.0), (2, 32.0)])
def test_an_aligned_tap_is_missed_as_often_as_theory_says(seed: int, cn0: float) -> None:
    c = magnitudes(seed, amplitude_at(cn0), np.zeros(EPOCHS))
    missed = int(np.count_nonzero(c[:, 5] <= threshold(PFA)))
    expect(missed, miss_probability(cn0, T_S, PFA), EPOCHS)


def test_noise_alone_raises_false_alarms_as_often_as_the_effective_number_of_taps_says() -> None:
    # At 1e-3 the count of pairs is an upper bound of 9.43 taps; the triples that it neglects take 1 % off.
    pfa = 1e-3
    c = magnitudes(3, 0.0, np.zeros(EPOCHS))
    alarms = int(np.count_nonzero((c > threshold(pfa)).any(axis=1)))
    expected = effective_taps(pfa, 11, 1 - 15 / CHIP_M) * pfa
    spread = np.sqrt(expected / EPOCHS)
    assert 0.97 * expected - SIGMAS * spread < alarms / EPOCHS < expected + SIGMAS * spread


@pytest.mark.judged(by="theory", what="misses of a bank of correlators at 34 dBHz", figure="9e-4, within 5 % and 4.4 σ")
def test_bank_misses_at_34_dbhz() -> None:
    # Reference 9.0e-4, itself rounded to 5 %
    peak_m = 2.0 * np.random.default_rng(4).standard_normal(EPOCHS)
    c = magnitudes(5, amplitude_at(34.0), peak_m)
    missed = np.count_nonzero(MaximumDetector().detect(c, threshold(PFA)) < 0) / EPOCHS
    assert abs(missed - 9.0e-4) < 0.05 * 9.0e-4 + SIGMAS * np.sqrt(9.0e-4 / EPOCHS)


@pytest.mark.parametrize(("seed", "cn0", "rms_m"), [(6, 35.0, 2.5), (7, 34.0, 2.8)])
def test_noise_of_the_range_offset(seed: int, cn0: float, rms_m: float) -> None:
    # Rounding of the reference 0.05 m; the rms of 2e5 near-Gaussian errors is good to 0.004 m.
    peak_m = 2.0 * np.random.default_rng(seed).standard_normal(EPOCHS)
    c = magnitudes(seed + 100, amplitude_at(cn0), peak_m)
    for detector in (MaximumDetector(), EarlyDetector()):
        tap = detector.detect(c, threshold(PFA))
        error_m = (range_offset_m(c, tap, 1, BANK_M) - peak_m)[tap >= 0]
        assert np.sqrt(np.mean(error_m**2)) == pytest.approx(rms_m, abs=0.05 + SIGMAS * 0.004)
        assert abs(np.mean(error_m)) < SIGMAS * rms_m / np.sqrt(EPOCHS) + 0.02  # the cluster pulls the early mean


def test_the_early_detector_has_a_cluster_on_the_left_flank_and_the_maximum_detector_has_not() -> None:
    # Reference: 1.5e-4 of the epochs, from 60 events of 4e5, so known to 13 %
    peak_m = 2.0 * np.random.default_rng(8).standard_normal(EPOCHS)
    c = magnitudes(9, amplitude_at(35.0), peak_m)
    flank = {}
    for detector in (EarlyDetector(), MaximumDetector()):
        offset_m = range_offset_m(c, detector.detect(c, threshold(PFA)), 1, BANK_M)
        flank[type(detector)] = np.count_nonzero((offset_m > -27) & (offset_m < -18))
    assert 10 <= flank[EarlyDetector] <= 70
    assert flank[MaximumDetector] <= 8
