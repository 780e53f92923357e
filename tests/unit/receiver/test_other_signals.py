"""All other signals of a sky are noise behind a correlator: by integral, and as samples of the sum have it."""

from __future__ import annotations

import numpy as np
import pytest

from sky_builder import CLEAN, sky_scenario, whole_block
from vestige.acas_processor.detectors import MaximumDetector
from vestige.acas_processor.processor import AcasProcessor
from vestige.receiver.correlators.other_signals import other_signals_density
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.front_end.front_end_correlation import code_noise_density_s

FRONT_END = FrontEnd(sample_rate_hz=12.5e6)


def test_the_density_is_the_integral_over_both_spectra() -> None:
    """∫ S² df with S = sinc²(f/R_c)/R_c in continuous time; sampling folds what is beyond f_s/2."""
    f_hz = np.arange(-400 * 5.115e6, 400 * 5.115e6, 1e4)
    spectrum = np.sinc(f_hz / 5.115e6) ** 2 / 5.115e6
    assert code_noise_density_s(FrontEnd(sample_rate_hz=1e9)) == pytest.approx(np.sum(spectrum**2) * 1e4, rel=1e-4)
    folded = np.sum([np.interp(f_hz[np.abs(f_hz) <= 6.25e6] + k * 12.5e6, f_hz, spectrum) for k in range(-80, 81)], 0)
    assert code_noise_density_s(FRONT_END) == pytest.approx(np.sum(folded**2) * 1e4, rel=2e-3)


@pytest.mark.parametrize("oversampling", [1, 4])
def test_a_filter_passes_more_of_a_code_than_of_noise(oversampling: int) -> None:
    """Steep edges at ±4 MHz: ∫ S² over ∫ S."""
    rate_hz = 50e6 / oversampling
    front_end = FrontEnd(sample_rate_hz=rate_hz, bandwidth_hz=8e6, oversampling=oversampling, transition_hz=2e5)
    f_hz = np.arange(-4e6, 4e6, 1e3)
    spectrum = np.sinc(f_hz / 5.115e6) ** 2 / 5.115e6
    assert code_noise_density_s(front_end) == pytest.approx(np.sum(spectrum**2) / np.sum(spectrum), rel=0.02)


def test_both_components_of_all_satellites_but_ones_own_pilot() -> None:
    cn0_dbhz, relative_power = np.array([[40.0, 50.0]]), np.array([[1.0, 3.0]])
    found = other_signals_density(cn0_dbhz, relative_power, FRONT_END)
    k, aligned = 2 * code_noise_density_s(FRONT_END), 1 / 5.115e6
    assert found == pytest.approx(np.array([[aligned * 1e4 + k * 3e5, k * 1e4 + aligned * 3e5]]))
    assert np.all(other_signals_density(np.full((2, 3), -np.inf), np.ones((2, 3)), FRONT_END) == 0)


def _banks(fidelity: str, cn0_dbhz: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return prompt taps and measured noise floor for noise of density 1."""
    settings = (*CLEAN, f"epochs={n}", "recs.every=1", "receiver.e1_tracking=none", "constellation.cn0_fall_db=0")
    scenario = sky_scenario(*settings, f"receiver.cn0_dbhz={cn0_dbhz}", f'fidelity="{fidelity}"')
    block, _ = whole_block(scenario)
    banks = AcasProcessor(detector=MaximumDetector()).measure(block, scenario.simulated_receiver.assistance).banks
    prompt = banks.taps[..., int(np.argmin(np.abs(banks.offsets_m)))]
    density = (12.5e6 if fidelity == "samples" else 10 ** (cn0_dbhz / 10)) * 0.016
    return np.abs(prompt) * np.sqrt(density), banks.noise_power * density


@pytest.mark.slow
@pytest.mark.parametrize("cn0_dbhz", [45.0, 58.0])
def test_samples_of_the_sum_have_the_noise_of_the_model(cn0_dbhz: float) -> None:
    """Eight satellites at 45 dBHz, which raise the noise by 6 %, and at 58 dBHz, where they are more than the noise.

    160 measured floors scatter by 0.35 % each. The noise in the tap at the line of sight has 160 degrees of
    freedom: 11 % (1σ) in power, so 45 % is 4 σ; without other signals its power would be 2.2 times less at 58 dBHz.
    """
    (sampled, sampled_floor), (drawn, drawn_floor) = (
        _banks("samples", cn0_dbhz, 20),
        _banks("correlators", cn0_dbhz, 160),
    )
    assert np.mean(sampled_floor) == pytest.approx(np.mean(drawn_floor), rel=0.005)
    assert np.mean(drawn_floor) > (1.05 if cn0_dbhz < 50 else 2.2)
    assert np.var(sampled) == pytest.approx(np.var(drawn), rel=0.45)
