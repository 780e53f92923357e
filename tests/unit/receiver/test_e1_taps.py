"""E1 correlators against what they are made of: shape, noise, a spoofing signal, gain control."""

from __future__ import annotations

import numpy as np
import pytest

from sky_builder import CLEAN, e1_of, sky_scenario
from vestige.receiver.correlators.e1_taps import TAP_CHIPS
from vestige.receiver.correlators.sky_e1_model import passed_components, strangers_covariance_s
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1B, E1C
from vestige.signals.pulse import BOC11, band_limited_autocorrelation, spectrum

SVIDS = (6, 7, 8, 12, 13, 14, 23, 24)  # of `scenarios/sky.toml`
# CBOC(−) with BOC(1,1): √(10/11) (1 − 3 d), less √(1/11) of BOC(6,1) with BOC(1,1), a sawtooth of 1/12 at most
ON_AIR = np.array([0.5194, 0.7954, 0.9535, 0.7954, 0.5194])
PROMPT = TAP_CHIPS.index(0.0)


@pytest.fixture(scope="module")
def clean() -> dict[str, np.ndarray]:
    return _found("epochs=1000")


def _found(*settings: str) -> dict[str, np.ndarray]:
    return e1_of(sky_scenario(*CLEAN, "receiver.e1_tracking=none", *settings))


def _means(taps: np.ndarray, cn0_dbhz: np.ndarray) -> np.ndarray:
    return (taps / np.sqrt(2 * 10 ** (cn0_dbhz / 10) * 0.1)[..., None]).mean(axis=0)


def test_means_are_the_correlation_of_cboc_with_boc(clean: dict[str, np.ndarray]) -> None:
    assert _means(clean["taps"], clean["cn0_dbhz"]) == pytest.approx(np.tile(ON_AIR, (8, 1)), abs=0.01)


def test_noise_is_that_of_the_receiver_and_of_all_codes(clean: dict[str, np.ndarray]) -> None:
    """1 in each dimension, as the replicas are alike; other satellites; E1-B in phase, of the shape of the signal."""
    strength_hz = 10 ** (clean["cn0_dbhz"] / 10)
    noise = clean["taps"] - np.sqrt(2 * strength_hz * 0.1)[..., None] * ON_AIR
    noise = noise.reshape(-1, len(TAP_CHIPS))
    others_hz = (strength_hz.sum(axis=1, keepdims=True) - strength_hz).mean()
    codes = [[primary_code(one, svid).astype(int) for one in (E1B, E1C)] for svid in SVIDS]
    aligned = np.array([(own @ pilot) ** 2 / 4092 for own, pilot in codes])
    own = np.mean(2 * strength_hz * aligned) / 1.023e6 * np.outer(ON_AIR, ON_AIR)
    white = 1 - 3 * np.abs(np.subtract.outer(TAP_CHIPS, TAP_CHIPS)) + others_hz * strangers_covariance_s(12.5e6)
    assert white[0, 0] > 1.03
    assert own[2, 2] > 0.03
    n = noise.shape[0]
    for part, expected in ((noise.real, white + own), (noise.imag, white)):
        assert part.T @ part / n == pytest.approx(expected, abs=5.5 * np.sqrt(2 / n))


def test_the_noise_of_strangers_is_the_integral_over_both_spectra() -> None:
    """∫ (S_B + S_C) S cos(2πfδ) df in continuous time."""
    f_hz = np.linspace(-80e6, 80e6, 320_001)
    received = sum(spectrum(one.pulse, f_hz, one.chip_rate_hz) for one in (E1B, E1C))
    both = received * spectrum(BOC11, f_hz, E1C.chip_rate_hz) * (f_hz[1] - f_hz[0])
    lags_s = (np.array(TAP_CHIPS) - TAP_CHIPS[0]) / E1C.chip_rate_hz
    expected = np.cos(2 * np.pi * np.multiply.outer(lags_s, f_hz)) @ both
    assert strangers_covariance_s(1e9)[0] == pytest.approx(expected, rel=1e-3)


def test_the_power_that_passes_is_the_integral_over_the_spectrum() -> None:
    """And at 6.2 MHz BOC(6,1) is folded onto the carrier."""
    expected = sum(
        band_limited_autocorrelation(
            one.pulse, np.array([0.0, 0.4, 1.3]), chip_rate_hz=one.chip_rate_hz, bandwidth_hz=2e6
        )
        for one in (E1B, E1C)
    )
    found = passed_components(np.array([0.0, 0.4, 1.3]), bandwidth_hz=2e6, sample_rate_hz=1e9)
    assert found == pytest.approx(expected, abs=2e-3)
    folded = passed_components(np.zeros(1), bandwidth_hz=2e6, sample_rate_hz=6.2e6)[0]
    assert folded - found[0] == pytest.approx(2 / 11, rel=0.15)


def test_a_spoofing_signal_is_there_and_the_gain_holds_the_power() -> None:
    attack = 'attack=[{kind="time-push", delay_m=0, power_db=10, phase={kind="locked"}, bands=["E1"]}]'
    found = _found("epochs=200", attack)
    signals = 1.16 * np.sum(10 ** (found["cn0_dbhz"] / 10), axis=1) / 2e6  # of both components in 2 MHz
    rise_db = 10 * np.log10((1 + (1 + 10**0.5) ** 2 * signals) / (1 + signals))  # in phase: amplitudes add
    assert found["power_db"] == pytest.approx(rise_db, abs=0.2)  # 5.6 sigma of the reading
    prompt = _means(found["taps"] * 10 ** (rise_db / 20)[:, None, None], found["cn0_dbhz"])[:, PROMPT]
    assert np.abs(prompt) == pytest.approx(np.full(8, np.sqrt(10 / 11) * (1 + 10**0.5)), rel=0.02)


def test_wideband_jamming_raises_power_and_noise_alike() -> None:
    attack = 'attack=[{kind="jamming", j_over_n_db=10, waveform={kind="wideband"}, bands=["E1"]}]'
    found = _found("epochs=300", attack)
    assert found["power_db"].mean() == pytest.approx(10.0, abs=0.6)  # 10.4 dB less the satellites' own share
    apart = found["taps"][..., 0] - found["taps"][..., -1]
    gain = 10 ** (found["power_db"] / 10)
    assert np.mean(np.abs(apart) ** 2 * gain[:, None]) == pytest.approx(11 * 3.6, rel=0.1)
