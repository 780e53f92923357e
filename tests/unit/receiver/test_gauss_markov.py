from __future__ import annotations

import numpy as np
import pytest

from vestige.receiver.errors.gauss_markov import GaussMarkovProcess


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
