"""E1 correlators against what they are made of: shape, noise, a counterfeit, gain control."""

from __future__ import annotations

import numpy as np
import pytest

from sky_builder import CLEAN, e1_of, sky_scenario
from vestige.receiver.correlators.e1_taps import TAP_CHIPS

PROMPT = TAP_CHIPS.index(0.0)


@pytest.fixture(scope="module")
def clean() -> dict[str, np.ndarray]:
    return _found("epochs=1000")


def _found(*settings: str) -> dict[str, np.ndarray]:
    return e1_of(sky_scenario(*CLEAN, "receiver.e1_tracking=none", *settings))


def _means(taps: np.ndarray, cn0_dbhz: np.ndarray) -> np.ndarray:
    return (taps / np.sqrt(2 * 10 ** (cn0_dbhz / 10) * 0.1)[..., None]).mean(axis=0)


def test_means_are_the_autocorrelation_of_boc(clean: dict[str, np.ndarray]) -> None:
    triangle = 1 - 3 * np.abs(np.array(TAP_CHIPS))  # BOC(1,1) within half a chip
    assert _means(clean["taps"], clean["cn0_dbhz"]) == pytest.approx(np.tile(triangle, (8, 1)), abs=0.01)


def test_noise_is_one_in_each_dimension_and_correlated_as_the_replicas(clean: dict[str, np.ndarray]) -> None:
    noise = clean["taps"] - np.sqrt(2 * 10 ** (clean["cn0_dbhz"] / 10) * 0.1)[..., None] * (
        1 - 3 * np.abs(np.array(TAP_CHIPS))
    )
    noise = noise.reshape(-1, len(TAP_CHIPS))
    expected = 1 - 3 * np.abs(np.subtract.outer(TAP_CHIPS, TAP_CHIPS))
    n = noise.shape[0]
    for part in (noise.real, noise.imag):
        assert part.T @ part / n == pytest.approx(expected, abs=5.5 * np.sqrt(2 / n))


def test_a_counterfeit_is_there_and_the_gain_holds_the_power() -> None:
    attack = 'attack=[{kind="time-push", delay_m=0, power_db=10, phase={kind="locked"}, bands=["E1"]}]'
    found = _found("epochs=200", attack)
    signals = np.sum(10 ** (found["cn0_dbhz"] / 10), axis=1) / 2e6
    rise_db = 10 * np.log10((1 + (1 + 10**0.5) ** 2 * signals) / (1 + signals))  # in phase: amplitudes add
    assert found["power_db"] == pytest.approx(rise_db, abs=0.2)  # 5.6 sigma of the reading
    prompt = _means(found["taps"] * 10 ** (rise_db / 20)[:, None, None], found["cn0_dbhz"])[:, PROMPT]
    assert np.abs(prompt) == pytest.approx(np.full(8, 1 + 10**0.5), rel=0.02)


def test_wideband_jamming_raises_power_and_noise_alike() -> None:
    attack = 'attack=[{kind="jamming", j_over_n_db=10, waveform={kind="wideband"}, bands=["E1"]}]'
    found = _found("epochs=300", attack)
    assert found["power_db"].mean() == pytest.approx(10.0, abs=0.6)  # 10.4 dB less the satellites' own share
    apart = found["taps"][..., 0] - found["taps"][..., -1]
    gain = 10 ** (found["power_db"] / 10)
    assert np.mean(np.abs(apart) ** 2 * gain[:, None]) == pytest.approx(11 * 3.6, rel=0.1)
