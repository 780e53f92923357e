from __future__ import annotations

import numpy as np
import pytest

from vestige.receiver.errors.gauss_markov import GaussMarkovProcess, SmoothGaussMarkovProcess


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def test_the_recursion_by_hand() -> None:
    w = rng().standard_normal(3)
    rho = np.exp(-np.array([1.0, 3.0]) / 2.0)
    first = rho[0] * w[0] + np.sqrt(1 - rho[0] ** 2) * w[1]
    second = rho[1] * first + np.sqrt(1 - rho[1] ** 2) * w[2]
    found = GaussMarkovProcess(rng(), 2.0).advance(np.array([10.0, 11.0, 14.0]))
    assert found == pytest.approx([w[0], first, second], rel=1e-14)


def test_no_memory_is_white_noise() -> None:
    assert np.array_equal(GaussMarkovProcess(rng(), 0.0).advance(np.zeros(9)), rng().standard_normal(9))


def test_the_same_time_has_the_same_value() -> None:
    assert np.unique(GaussMarkovProcess(rng(), 2.0).advance(np.full(9, 3.0))).size == 1


def test_endless_memory_is_constant() -> None:
    assert np.unique(GaussMarkovProcess(rng(), np.inf).advance(np.arange(9.0))).size == 1


@pytest.mark.parametrize("tau_s", [-1.0, np.nan])
def test_a_correlation_time_is_not_negative(tau_s: float) -> None:
    with pytest.raises(ValueError, match="correlation time"):
        GaussMarkovProcess(rng(), tau_s)


def test_the_smooth_process_has_its_correlation_and_its_rate() -> None:
    """1/e after τ, (1 + u) e^{−u} before; its steps are those of a rate of 2.146/τ. 400,000 steps of τ/20: 4 % (1σ)."""
    tau_s, n = 10.0, 400_000
    z = SmoothGaussMarkovProcess(rng(), tau_s).advance(np.arange(n) * 0.5)
    assert np.var(z) == pytest.approx(1, abs=0.06)
    for lag_s, expected in ((2.5, (1 + 0.5366) * np.exp(-0.5366)), (10.0, np.exp(-1)), (40.0, 9.585 * np.exp(-8.585))):
        lag = round(lag_s / 0.5)
        assert np.mean(z[lag:] * z[:-lag]) / np.var(z) == pytest.approx(expected, abs=0.03)
    step = np.std(np.diff(z)) / 0.5
    u = 2.146193 * 0.05
    assert step == pytest.approx(np.sqrt(2 * (1 - (1 + u) * np.exp(-u))) / 0.5, rel=0.02)


def test_the_smooth_process_goes_on_where_it_was_cut() -> None:
    times = np.cumsum(rng().random(50))
    whole = SmoothGaussMarkovProcess(rng(), 3.0).advance(times)
    process = SmoothGaussMarkovProcess(rng(), 3.0)
    assert np.array_equal(whole, np.concatenate([process.advance(times[:7]), process.advance(times[7:])]))


def test_the_smooth_process_hardly_moves_in_a_moment() -> None:
    process = SmoothGaussMarkovProcess(rng(), 7200.0)
    first, second, third = process.advance(np.array([0.0, 1.0, 2.0])).tolist()
    assert abs(second - first) < 5 * 2.146 / 7200
    assert abs(third - 2 * second + first) < 1e-4 * abs(second - first) + 1e-5
    assert process.advance(np.array([2.0]))[0] == third
    with pytest.raises(ValueError, match="positive"):
        SmoothGaussMarkovProcess(rng(), 0.0)
