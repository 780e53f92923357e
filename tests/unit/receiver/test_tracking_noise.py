from __future__ import annotations

from math import pi

import numpy as np
import pytest

from vestige.receiver.errors.error_process import named_streams
from vestige.receiver.errors.tracking_noise import BetzTrackingNoise, PulseName


@pytest.mark.parametrize(
    ("pulse", "chip_rate_hz", "mhz", "spacing", "expected"),
    [  # at 35 dBHz with 20 ms, 35 dBHz with 4 ms, 45 dBHz with 20 ms
        ("BOC(1,1)", 1.023e6, 14, 0.25, (1.069, 1.124, 0.334)),
        ("BOC(1,1)", 1.023e6, 24.552, 0.1, (0.561, 0.583, 0.176)),
        ("MBOC", 1.023e6, 24.552, 0.1, (0.403, 0.421, 0.126)),
        ("BPSK", 5.115e6, 20.46, 0.5, (0.417, 0.435, 0.131)),
        ("BPSK", 5.115e6, 20.46, 0.25, (0.372, 0.386, 0.117)),
        ("BPSK", 5.115e6, 40.92, 0.5, (0.570, 0.595, 0.179)),
        ("BPSK", 1.023e6, 24, 0.1, (0.969, 1.004, 0.304)),
    ],
)
def test_code_noise_table(
    pulse: PulseName, chip_rate_hz: float, mhz: float, spacing: float, expected: tuple[float, ...]
) -> None:
    found = [
        BetzTrackingNoise(
            pulse=pulse, chip_rate_hz=chip_rate_hz, bandwidth_hz=mhz * 1e6, spacing_chips=spacing, integration_s=time_s
        ).code_sigma_m(cn0_dbhz)
        for cn0_dbhz, time_s in ((35, 20e-3), (35, 4e-3), (45, 20e-3))
    ]
    assert found == pytest.approx(expected, abs=1.001e-3)  # the last printed digit


@pytest.mark.parametrize(
    ("bandwidth_hz", "time_s", "expected_deg"),
    [(18, 20e-3, (14.20, 7.78, 4.34, 2.43, 1.37)), (10, 4e-3, (12.04, 6.08, 3.29, 1.82, 1.02))],
)
def test_carrier_noise_table(bandwidth_hz: float, time_s: float, expected_deg: tuple[float, ...]) -> None:
    model = BetzTrackingNoise(pll_bandwidth_hz=bandwidth_hz, integration_s=time_s)
    wavelength_m = 299_792_458 / 1575.42e6
    found = [360 * model.carrier_sigma_m(cn0_dbhz) / wavelength_m for cn0_dbhz in (25, 30, 35, 40, 45)]
    assert found == pytest.approx(expected_deg, abs=5.1e-3)


def test_carrier_noise_in_metres() -> None:
    assert BetzTrackingNoise().carrier_sigma_m(35.0) == pytest.approx(2.29e-3, abs=5e-6)


def test_doppler_noise_table() -> None:
    found = [BetzTrackingNoise().doppler_sigma_hz(cn0_dbhz) for cn0_dbhz in (25, 30, 35, 40, 45)]
    assert found == pytest.approx([2.15, 1.15, 0.638, 0.357, 0.200], rel=3e-3)


def test_a_loop_forgets_with_its_bandwidth() -> None:
    """Noise of one-sided bandwidth B and variance σ² has σ² = S(0) B, S(0) the one-sided density at zero.

    A Gauss-Markov process has S(0) = 4 σ² τ, so that τ = 1/(4B).
    """
    step_s, tau_s = 0.1, 1 / (4 * 0.5)
    process = BetzTrackingNoise(loop_bandwidth_hz=0.5).process(named_streams(1, 3), cn0_dbhz=40.0)
    code_m, _, _ = process.advance(np.arange(20_000) * step_s)
    found = np.corrcoef(code_m[:-1], code_m[1:])[0, 1]
    rho = np.exp(-step_s / tau_s)
    assert found == pytest.approx(rho, abs=5 * np.sqrt((1 - rho**2) / 20_000))


def test_standard_deviations_come_out() -> None:
    model = BetzTrackingNoise()
    errors = model.process(named_streams(1, 3), cn0_dbhz=35.0).advance(np.arange(20_000.0))
    sigmas = (model.code_sigma_m(35.0), model.carrier_sigma_m(35.0), model.doppler_sigma_hz(35.0))
    assert [np.std(error) for error in errors] == pytest.approx(sigmas, rel=5 / np.sqrt(2 * 20_000))
    assert abs(np.corrcoef(errors[0], errors[1])[0, 1]) < 5 / np.sqrt(20_000)


def test_more_signal_less_noise() -> None:
    weak, strong = (
        BetzTrackingNoise().process(named_streams(1, 3), cn0_dbhz=cn0_dbhz).advance(np.arange(9.0))
        for cn0_dbhz in (30.0, 50.0)
    )
    for a, b in zip(weak, strong, strict=True):
        assert np.all(np.abs(b) < np.abs(a) / 9)  # 20 dB, and less squaring loss
        assert np.array_equal(np.sign(a), np.sign(b))


@pytest.mark.parametrize(
    "wrong",
    [{"integration_s": 0.0}, {"loop_bandwidth_hz": 0.0}, {"pll_bandwidth_hz": 200.0}, {"fll_bandwidth_hz": pi * 1e3}],
)
def test_a_loop_must_be_slower_than_its_updates(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="BT"):
        BetzTrackingNoise(**wrong)  # type: ignore[arg-type]
