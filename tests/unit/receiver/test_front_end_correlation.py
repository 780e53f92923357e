from __future__ import annotations

import numpy as np
import pytest

from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.front_end.front_end_correlation import (
    noise_correlation,
    range_offset_scale,
    signal_correlation,
    spread,
)
from vestige.signals.definitions import E6C

CHIP_M = 58.6105
# Share of the power that passes, and R_B at 7.5 m and 15 m over that at 0, of BPSK(5) by bandwidth
TABLE = {10.23e6: (-0.44, 0.964, 0.863), 14e6: (-0.37, 0.957, 0.841), 20.46e6: (-0.22, 0.936, 0.788)}


@pytest.mark.parametrize("bandwidth_hz", TABLE)
def test_steep_filter(bandwidth_hz: float) -> None:
    """Signal and noise both have the band-limited autocorrelation; folded sidelobes change up to 0.3 %."""
    loss_db, near, far = TABLE[bandwidth_hz]
    front_end = FrontEnd(sample_rate_hz=101.2e6, bandwidth_hz=bandwidth_hz, transition_hz=0.1e6)
    delays = np.array([0.0, 7.5 / CHIP_M, 15 / CHIP_M, -15 / CHIP_M])
    signal, noise = signal_correlation(front_end, delays), noise_correlation(front_end, delays)
    for correlation in (signal, noise):
        assert 10 * np.log10(correlation[0]) == pytest.approx(loss_db, abs=0.01)
        assert correlation[1:] / correlation[0] == pytest.approx([near, far, far], abs=3e-3)
    assert 10 * np.log10(signal[0] ** 2 / noise[0]) == pytest.approx(loss_db, abs=0.01)


def test_without_filter_and_quantiser_there_is_the_triangle() -> None:
    delays = np.linspace(-2, 2, 41)
    triangle = np.maximum(0, 1 - np.abs(delays))
    for correlation in (signal_correlation, noise_correlation):
        assert correlation(FrontEnd(sample_rate_hz=12.5e6), delays) == pytest.approx(triangle, abs=1e-12)


@pytest.mark.parametrize(("bits", "loss_db"), [(1, 1.96), (2, 0.55), (3, 0.17), (8, 0.0)])
def test_quantiser(bits: int, loss_db: float) -> None:
    """White noise stays white, so all taps lose alike; the signal's shape stays."""
    front_end = FrontEnd(sample_rate_hz=12.5e6, bits=bits)
    delays = np.array([0.0, 0.25])
    assert signal_correlation(front_end, delays) == pytest.approx([1, 0.75])
    loss = 10 * np.log10(noise_correlation(front_end, delays) / np.array([1, 0.75]))
    assert loss == pytest.approx([loss_db] * 2, abs=0.006)


@pytest.mark.parametrize(
    "front_end",
    [
        FrontEnd(sample_rate_hz=12.5e6, bandwidth_hz=10e6, oversampling=2, bits=2),
        FrontEnd(sample_rate_hz=12.5e6, bandwidth_hz=6e6),
    ],
)
def test_noise_is_that_of_the_front_end(front_end: FrontEnd) -> None:
    """The covariance of 400 correlations of real noise with random chips: five standard errors."""
    rng = np.random.default_rng(3)
    lags_chips, n = np.array([0.0, 0.25, 0.5]), 20_000
    rate, draws = front_end.sample_rate_hz, []
    for _ in range(400):
        noise = rng.standard_normal((front_end.input_samples(n), 2)).astype(np.float32).view(np.complex64).ravel()
        samples, _ = front_end.process(noise / np.float32(np.sqrt(2)))
        code = rng.choice([-1.0, 1.0], 20_000)
        at = np.arange(n) * (E6C.chip_rate_hz / rate) + 10.3
        draws.append([np.sum(samples * code[np.floor(at - lag).astype(int)]) for lag in lags_chips])
    covariance = np.array(draws).T @ np.array(draws).conj()
    found = covariance.real[0] / covariance.real[0, 0]
    expected = noise_correlation(front_end, lags_chips)
    assert found == pytest.approx(expected / expected[0], abs=5 / np.sqrt(400))


def test_spread_is_the_sum_over_the_lags() -> None:
    front_end = FrontEnd(sample_rate_hz=12.5e6, bandwidth_hz=10e6)
    code = np.random.default_rng(1).standard_normal(6)
    at = np.array([0.0, 0.25, 2.75, 4.5])
    both = np.concatenate([code[:0:-1], code])  # lags −5 … 5
    expected = sum(a * signal_correlation(front_end, at - lag) for a, lag in zip(both, range(-5, 6), strict=True))
    assert (code @ spread(front_end, 6, 4))[(at * 4).astype(int)] == pytest.approx(expected, abs=1e-12)


def test_range_offsets_are_true_on_a_triangle() -> None:
    for bits in (None, 2):
        assert range_offset_scale(FrontEnd(sample_rate_hz=12.5e6, bits=bits), 15.0) == pytest.approx(1)


def test_range_offsets_behind_a_steep_filter() -> None:
    """½ Δ (R(Δ−δ) − R(Δ+δ))/(R(δ) − R(Δ+δ)) by hand, R being the integral of sinc²(f T) cos 2πfτ over the pass band."""
    bandwidth_hz, chip_s, delta_m = 10.23e6, 1 / 5.115e6, 15.0
    f = (np.arange(20_000) + 0.5) / 20_000 * bandwidth_hz / 2
    delay_m = np.linspace(0.05, 1, 20) * delta_m / 4

    def correlation(x_m: np.ndarray) -> np.ndarray:
        return np.cos(2 * np.pi / 299_792_458 * np.outer(x_m, f)) @ np.sinc(f * chip_s) ** 2

    early, late = correlation(delta_m + delay_m), correlation(delta_m - delay_m)
    found_m = delta_m / 2 * (late - early) / (correlation(delay_m) - early)
    expected = np.sum(delay_m * found_m) / np.sum(delay_m**2)
    front_end = FrontEnd(sample_rate_hz=101.2e6, bandwidth_hz=bandwidth_hz, transition_hz=0.1e6)
    assert expected > 1.3
    assert range_offset_scale(front_end, delta_m) == pytest.approx(expected, rel=0.02)
