from __future__ import annotations

import numpy as np
import pytest

from vestige.signals.pulse import BOC11, Pulse
from vestige.theory.thermal_noise import MBOC, dll_noise_m, snapshot_noise_bound_m


@pytest.mark.parametrize(
    ("shares", "mhz", "spacing", "expected"),
    [  # at 35 dBHz with 20 ms, 35 dBHz with 4 ms, 45 dBHz with 20 ms
        ({BOC11: 1.0}, 14, 0.25, (1.069, 1.124, 0.334)),
        ({BOC11: 1.0}, 24.552, 0.1, (0.561, 0.583, 0.176)),
        (MBOC, 24.552, 0.1, (0.403, 0.421, 0.126)),
    ],
)
def test_dll_table(shares: dict[Pulse, float], mhz: float, spacing: float, expected: tuple[float, ...]) -> None:
    found = [
        dll_noise_m(cn0, bandwidth_hz=mhz * 1e6, spacing_chips=spacing, shares=shares, integration_s=time_s)
        for cn0, time_s in ((35, 20e-3), (35, 4e-3), (45, 20e-3))
    ]
    assert found == pytest.approx(expected, abs=1.001e-3)  # the last printed digit


@pytest.mark.parametrize(
    ("cn0", "expected"), [(35, (2.913, 2.060, 1.457)), (40, (1.638, 1.158, 0.819)), (45, (0.921, 0.651, 0.461))]
)
def test_snapshot_bound_table(cn0: float, expected: tuple[float, ...]) -> None:
    found = [snapshot_noise_bound_m(cn0, 16e-3, mhz * 1e6) for mhz in (10.23, 20.46, 40.92)]
    assert found == pytest.approx(expected, abs=1.001e-3)


def test_snapshot_bound_in_closed_form() -> None:
    # f² S = T_c sin²(πfT_c)/(πT_c)²: its integral over ±B/2 is (B/2 − sin(πBT_c)/(2πT_c)) / (π²T_c)
    chip_s, band_hz = 1 / 5.115e6, 20.46e6
    moment = (band_hz / 2 - np.sin(np.pi * band_hz * chip_s) / (2 * np.pi * chip_s)) / (np.pi**2 * chip_s)
    expected = 299_792_458 / np.sqrt(8 * np.pi**2 * 10**3.5 * 16e-3 * moment)
    assert snapshot_noise_bound_m(35.0, 16e-3, band_hz) == pytest.approx(expected, rel=1e-8)
