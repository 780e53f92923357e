"""The C/N0 that tracking reports fades with the rays on E1: against the time integral, and beside the correlators."""

from __future__ import annotations

import numpy as np
import pytest

from sky_builder import sky_scenario, whole_block
from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.e1_taps import power_with_rays
from vestige.receiver.snapshots.cn0_estimate import CN0_INTEGRATION_S, PROMPTS
from vestige.receiver.snapshots.e1 import tracked_cn0_dbhz
from vestige.receiver.truth import TruthBlock
from vestige.signals.definitions import E1C
from vestige.signals.pulse import BOC11, autocorrelation

AVERAGING_S = PROMPTS * CN0_INTEGRATION_S
STRONG = (
    'receiver.multipath={kind="lms-lite", power_db=-9.0, mean_excess_m=20.0, n_rays=3, '
    "speed_mps=0.05, mean_life_m=1.0}",
    "receiver.e1_multipath=true",
)


def _mean_prompt_power(truth: TruthBlock, multipath_m: np.ndarray, row: int) -> float:
    """Return the same straightforwardly: |Σ a e^{j2πft} R|² at 2000 times of the second."""
    times_s = (np.arange(2000) + 0.5) * AVERAGING_S / 2000
    chips_a_metre = E1C.chip_rate_hz / SPEED_OF_LIGHT_MPS
    correlator = np.ones(times_s.size, np.complex128) * autocorrelation(BOC11, multipath_m[[row]] * chips_a_metre)
    for amplitude, delay_m, doppler_hz in zip(
        truth.rays.amplitude_e1[row], truth.rays.delay_m[row], truth.rays.doppler_hz[row], strict=True
    ):
        overlap = autocorrelation(BOC11, np.array([(multipath_m[row] - delay_m) * chips_a_metre]))
        correlator += amplitude * overlap * np.exp(2j * np.pi * doppler_hz * E1_CARRIER_HZ / E6_CARRIER_HZ * times_s)
    return float(np.mean(np.abs(correlator) ** 2))


def test_the_power_is_the_time_integral_of_the_prompt_correlator() -> None:
    """To 1e-4 of the direct signal; the rays of the scenario move it by more than 1 dB both ways."""
    scenario = sky_scenario("epochs=60", *STRONG)
    _, truths = whole_block(scenario)
    for simulation, truth in zip(scenario.simulations[:3], truths[:3], strict=True):
        multipath_m = simulation.e1_multipath_m(truth)
        found = power_with_rays(truth, multipath_m, averaging_s=AVERAGING_S)
        expected = [_mean_prompt_power(truth, multipath_m, row) for row in range(60)]
        assert found == pytest.approx(expected, abs=1e-4)
        assert found.max() > 1.25
        assert found.min() < 0.8


def test_without_rays_the_power_is_the_gain_of_the_loop() -> None:
    scenario = sky_scenario("epochs=40", "receiver.multipath=none", "receiver.e1_multipath=false")
    truth = scenario.simulations[0].truth().advance(0, 40)
    assert power_with_rays(truth, np.zeros(40), averaging_s=1.0) == pytest.approx(truth.e1.gain)


def test_the_reported_cn0_fades_as_the_prompt_correlators_do() -> None:
    """Slow rays: C/N0 over what it is without rays goes with the prompt's power, r > 0.8; without rays r is about 0."""

    def correlation(*settings: str) -> float:
        scenario = sky_scenario("epochs=300", "receiver.cn0_e1_dbhz=48.0", *settings)
        block, truths = whole_block(scenario)
        undisturbed = np.stack(
            [tracked_cn0_dbhz(one, truth) for one, truth in zip(scenario.simulations, truths, strict=True)], axis=1
        )
        assert block.e1.taps is not None
        prompt = np.abs(block.e1.taps[..., block.e1.tap_chips.index(0.0)])
        prompt_db = 20 * np.log10(prompt) - undisturbed
        change_db = block.e1.cn0_dbhz - undisturbed
        known = np.isfinite(change_db) & np.isfinite(prompt_db)
        return float(np.corrcoef(change_db[known], prompt_db[known])[0, 1])

    assert correlation(*STRONG) > 0.8
    assert abs(correlation("receiver.multipath=none", "receiver.e1_multipath=false")) < 0.1
