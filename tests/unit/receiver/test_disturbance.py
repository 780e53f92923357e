from __future__ import annotations

import numpy as np
import pytest

from vestige.receiver.correlators.disturbance import (
    CHIPS_A_METRE,
    Disturbance,
    drawn_disturbance,
    unrelated_correlation,
)
from vestige.records import Band
from vestige.signals.definitions import E6C
from vestige.spoofer.interference import Jam
from vestige.spoofer.jammers import AnyJammer, Chirp, ContinuousWave, Pulsed
from vestige.spoofer.spoofer import Spoofer

OFFSETS_M = 15.0 * np.arange(-5, 6)
N = 20_000


def _drawn(first: int, n: int, *waveforms: AnyJammer, seed: int = 3) -> Disturbance:
    attacks = tuple(Jam(j_over_n_db=4.0, waveform=waveform) for waveform in waveforms)
    effects = Spoofer(attacks=attacks).effects(Band.E6, 11, np.arange(first, first + n, dtype=float))
    return drawn_disturbance(effects, OFFSETS_M, np.zeros(2, bool), seed=seed, first=first)


@pytest.mark.parametrize("waveform", [ContinuousWave(offset_hz=8e5), Chirp(bandwidth_hz=4e6), Pulsed()], ids=str)
def test_waveforms_have_their_covariance(waveform: AnyJammer) -> None:
    """20,000 draws: 5 σ are 3.5 % of the power on the diagonal, and beside it."""
    drawn = _drawn(0, N, waveform)
    lags = np.subtract.outer(OFFSETS_M, OFFSETS_M) * CHIPS_A_METRE
    expected = 10**0.4 * waveform.covariance(E6C, lags.ravel(), 20.46e6).reshape(lags.shape)
    measured = drawn.waveforms.T @ drawn.waveforms.conj() / N
    assert np.max(np.abs(measured - expected)) < 0.04 * expected[0, 0].real
    assert drawn.rise == pytest.approx(np.full(N, expected[0, 0].real))


def test_two_waveforms_are_independent() -> None:
    both, one = _drawn(0, N, Pulsed(), Pulsed()), _drawn(0, N, Pulsed())
    assert np.mean(np.abs(both.waveforms) ** 2) == pytest.approx(2 * 10**0.4, rel=0.03)
    assert both.rise == pytest.approx(2 * one.rise)


def test_independent_of_the_cut() -> None:
    whole = _drawn(0, 1300, Chirp())
    part = _drawn(490, 30, Chirp())
    assert part.waveforms.tobytes() == whole.waveforms[490:520].tobytes()
    assert part.unrelated.tobytes() == whole.unrelated[490:520].tobytes()


def test_chips_that_do_not_match() -> None:
    """Variance (1 − f)² + f² between two whole chips; taps share the chips on both sides of them."""
    noise = _drawn(0, N).unrelated[:, 0]
    for shift_chips in (0.0, 0.25, 300.5, -1e6 + 0.7):
        distance = np.broadcast_to(shift_chips - OFFSETS_M * CHIPS_A_METRE, (N, 11))
        part = distance[0] % 1.0
        values = unrelated_correlation(noise, distance)
        assert np.mean(values**2, axis=0) == pytest.approx((1 - part) ** 2 + part**2, abs=0.05)  # 5 σ
    two = unrelated_correlation(noise, np.tile([0.0, 0.5, 1.0, 2.0], (N, 1)))
    assert two[:, 1] == pytest.approx((two[:, 0] + two[:, 2]) / 2)
    assert np.mean(two[:, 0] * two[:, 3]) == pytest.approx(0.0, abs=0.04)
