from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from vestige.receiver.front_end.quantiser import QUANTISERS

LOSS_DB = {1: 1.96, 2: 0.55, 3: 0.17}  # Thompson, Emerson, Schwab 2007


def efficiency(step: float, bits: int) -> float:
    """(E xq)² / E q² of a uniform quantiser of a standard normal x, from the normal law alone."""
    levels = np.arange(1, 2**bits, 2)
    edges = np.append(np.arange(levels.size) * step, np.inf)
    density, distribution = np.exp(-(edges**2) / 2) / np.sqrt(2 * np.pi), special.ndtr(edges)
    product, square = 2 * np.sum(levels * -np.diff(density)), 2 * np.sum(levels**2 * np.diff(distribution))
    return float(product**2 / square)


@pytest.mark.parametrize("bits", [1, 2, 3])
def test_step_is_the_one_that_loses_least(bits: int) -> None:
    step = QUANTISERS[bits].step_sigma
    assert -10 * np.log10(efficiency(step, bits)) == pytest.approx(LOSS_DB[bits], abs=0.005)
    assert all(efficiency(step * factor, bits) <= efficiency(step, bits) + 1e-12 for factor in (0.98, 1.02))


@pytest.mark.parametrize("bits", [1, 2, 3])
def test_white_noise_costs_the_loss(bits: int) -> None:
    quantiser = QUANTISERS[bits]
    assert quantiser.noise_correlation(np.ones(1))[0] == pytest.approx(1 / efficiency(quantiser.step_sigma, bits))
    assert quantiser.noise_correlation(np.zeros(1))[0] == 0


def test_one_bit_follows_the_arcsine_law() -> None:
    rho = np.linspace(-0.85, 0.85, 35)
    assert QUANTISERS[1].noise_correlation(rho) == pytest.approx(np.arcsin(rho), abs=1e-5)


def test_many_bits_leave_the_noise_as_it_is() -> None:
    rho = np.linspace(-1, 1, 41)
    assert QUANTISERS[8].noise_correlation(rho) == pytest.approx(rho, abs=1e-3)


@pytest.mark.parametrize("bits", [1, 2, 3, 8])
@pytest.mark.parametrize("rho", [-0.6, 0.3, 0.9])
def test_correlated_noise(bits: int, rho: float) -> None:
    """E qq' over (E xq)² of 400,000 pairs; five standard errors are 0.012."""
    rng, quantiser = np.random.default_rng(bits), QUANTISERS[bits]
    x, y = rng.standard_normal((2, 400_000))
    y = rho * x + np.sqrt(1 - rho**2) * y
    p, q = (quantiser.quantise((z / quantiser.step_sigma).astype(np.float32)).astype(float) for z in (x, y))
    assert np.mean(p * q) / np.mean(x * p) ** 2 == pytest.approx(
        quantiser.noise_correlation(np.array([rho]))[0], abs=0.012
    )
