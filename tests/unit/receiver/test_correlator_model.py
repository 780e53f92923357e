from __future__ import annotations

import numpy as np
import pytest

from vestige.receiver.correlators.correlator_model import CorrelatorModel
from vestige.streams import stream

OFFSETS_M = tuple((np.arange(11) - 5) * 15.0)
MODEL = CorrelatorModel(offsets_m=OFFSETS_M, n_chips=81_840)
CHIP_M = 58.6105


def _rays(n: int, *rays: tuple[float, complex, float]) -> dict[str, np.ndarray]:
    delay, amplitude, doppler = zip(*rays, strict=True)
    return {
        "delay_m": np.tile(np.array(delay), (n, 1)),
        "amplitude": np.tile(np.array(amplitude, np.complex128), (n, 1)),
        "doppler_hz": np.tile(np.array(doppler), (n, 1)),
    }


def test_without_noise_a_ray_is_a_triangle() -> None:
    taps, _ = MODEL.banks(MODEL.draws(stream(1, "t"), 50), cn0_dbhz=150.0, **_rays(50, (4.0, 0.5j, 0.0)))
    triangle = np.maximum(0, 1 - np.abs(np.array(OFFSETS_M) - 4.0) / CHIP_M)
    assert taps == pytest.approx(np.tile(0.5j * triangle, (50, 1)), abs=0.5 * 5 / np.sqrt(81_840))


def test_doppler_loss_and_turn() -> None:
    """sinc(f T) and half a turn of phase for f T = ½."""
    taps, _ = MODEL.banks(MODEL.draws(stream(1, "t"), 1), cn0_dbhz=150.0, **_rays(1, (0.0, 1.0, 0.5 / 0.016)))
    assert taps[0, 5] == pytest.approx(1j * 2 / np.pi, abs=1e-5)


def test_noise_covariance_and_floor() -> None:
    """200,000 draws: every entry of the covariance within 6 standard errors of σ² Tri."""
    n, cn0 = 200_000, 35.0
    taps, noise_power = MODEL.banks(MODEL.draws(stream(2, "t"), n), cn0_dbhz=cn0, **_rays(n, (0.0, 0.0, 0.0)))
    variance = 1 / (10**3.5 * 0.016)
    lags = np.subtract.outer(OFFSETS_M, OFFSETS_M) / CHIP_M
    expected = variance * np.maximum(0, 1 - np.abs(lags))
    assert np.max(np.abs(taps.T.conj() @ taps / n - expected)) < 6 * variance / np.sqrt(n)
    assert np.max(np.abs(taps.T @ taps / n)) < 6 * variance * 1.5 / np.sqrt(n)  # circular
    assert np.mean(noise_power) == pytest.approx(variance, rel=6 / np.sqrt(n * 81_840))
    assert np.std(noise_power) == pytest.approx(variance / np.sqrt(81_840), rel=0.02)


def test_same_stream_same_bits() -> None:
    a = MODEL.banks(MODEL.draws(stream(3, "t", 7), 4), cn0_dbhz=35.0, **_rays(4, (0.0, 1.0, 0.0)))
    b = MODEL.banks(MODEL.draws(stream(3, "t", 7), 4), cn0_dbhz=35.0, **_rays(4, (0.0, 1.0, 0.0)))
    assert a[0].tobytes() == b[0].tobytes()


def test_coinciding_taps() -> None:
    with pytest.raises(ValueError, match="same offset"):
        CorrelatorModel(offsets_m=(0.0, 15.0, 15.0), n_chips=81_840).noise_factor()
