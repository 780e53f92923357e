from __future__ import annotations

import numpy as np
import pytest

from vestige.spoofer.phase import ALL_PHASES, Coherent, DelayedCarrier, Locked, Phase, Slipping

CASES = (Locked(phase_rad=0.3), Slipping(slip_hz=0.7, phase_rad=0.3), Coherent(phase_rad=0.3))


def test_every_law_has_a_case() -> None:
    assert tuple(type(phase) for phase in CASES) == ALL_PHASES


@pytest.mark.parametrize("phase", CASES, ids=lambda phase: phase.kind)
def test_doppler_is_the_rate_of_the_phase(phase: Phase) -> None:
    t_s = np.arange(0.0, 10.0, 1e-3)
    signal = DelayedCarrier(
        since_start_s=t_s, delay_m=2.0 * t_s + 0.3 * t_s**2, delay_rate_mps=2.0 + 0.6 * t_s, carrier_hz=1278.75e6
    )
    turned = np.angle(np.exp(1j * np.diff(phase.phase(signal)))) / (2 * np.pi)
    middle_hz = (phase.doppler_hz(signal)[1:] + phase.doppler_hz(signal)[:-1]) / 2
    assert turned / 1e-3 == pytest.approx(middle_hz, abs=1e-6)
    assert phase.phase(signal)[0] == pytest.approx(0.3)


def test_a_wavelength_of_delay_is_a_turn_backwards() -> None:
    """23.444 cm on E6."""
    delay_m = np.array([0.0, 0.25, 0.5, 1.0]) * 299_792_458 / 1278.75e6
    signal = DelayedCarrier(
        since_start_s=0 * delay_m, delay_m=delay_m, delay_rate_mps=0 * delay_m, carrier_hz=1278.75e6
    )
    phasor = np.exp(1j * Coherent().phase(signal))
    assert phasor == pytest.approx([1, -1j, -1, 1], abs=1e-9)


@pytest.mark.parametrize("slip_hz", [1.1e4, -1e9, np.inf, np.nan])
def test_what_is_no_slip(slip_hz: float) -> None:
    with pytest.raises(ValueError, match="expected at most 10000 Hz up or down"):
        Slipping(slip_hz=slip_hz)
