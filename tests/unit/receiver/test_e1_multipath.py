"""Against closed forms of one ray in phase or in opposition, and against plain bisection on many.

With spacing d ≪ 1 chip, the discriminator of a ray of relative amplitude α at excess delay τ, both real, is that of two
sums of straight lines. BOC(1,1) falls with slope 3 on both sides of its peak (BPSK with slope 1), so a small error is

    x = τ α/(1 + α)    while the ray's peak lies between early and late, τ < (1 + α) d/2
    x = α d/2          behind it, up to half a chip (BPSK: one chip)
    x = −α d/6         from half a chip to one, where BOC(1,1) rises with slope 1 between its two peaks
"""

from __future__ import annotations

import numpy as np
import pytest

from vestige.receiver.correlators.e1_multipath import LOOP_REACH_CHIPS, e1_multipath_error_m
from vestige.signals.pulse import BOC11, BPSK, CBOC_MINUS, Pulse

CHIP_M = 299_792_458 / 1.023e6


def error_chips(delay_chips: float, alpha: complex, spacing: float = 0.1, pulse: Pulse = BOC11) -> float:
    found = e1_multipath_error_m(
        np.array([[delay_chips * CHIP_M]]), np.array([[alpha + 0j]]), spacing_chips=spacing, pulse=pulse
    )
    return float(found[0]) / CHIP_M


@pytest.mark.parametrize("pulse", [BOC11, BPSK])
@pytest.mark.parametrize("alpha", [0.1, 0.5, -0.1, -0.5])
@pytest.mark.parametrize("spacing", [0.05, 0.1])
def test_one_ray_in_phase_or_in_opposition(pulse: Pulse, alpha: float, spacing: float) -> None:
    near = 0.8 * (1 + alpha) * spacing / 2
    assert error_chips(near, alpha, spacing, pulse) == pytest.approx(near * alpha / (1 + alpha), abs=1e-9)
    assert error_chips(0.3, alpha, spacing, pulse) == pytest.approx(alpha * spacing / 2, abs=1e-9)
    beyond = {BOC11: -alpha * spacing / 6, BPSK: alpha * spacing / 2}[pulse]
    assert error_chips(0.7, alpha, spacing, pulse) == pytest.approx(beyond, abs=1e-9)
    assert error_chips(1.2, alpha, spacing, pulse) == 0


def test_a_ray_in_quadrature_moves_the_loop_by_its_power() -> None:
    """Only |S|² counts: to first order nothing, in second order α²; far less than in phase."""
    assert 0 < error_chips(0.3, 0.1j) < 0.2 * error_chips(0.3, 0.1)


def test_no_ray_no_error() -> None:
    for rays in (np.zeros((5, 0)), np.full((5, 3), 40.0)):
        assert e1_multipath_error_m(rays, 0j * rays).tolist() == [0.0] * 5
    assert e1_multipath_error_m(np.zeros((0, 2)), np.zeros((0, 2), complex)).size == 0


def triangle_sum(x: np.ndarray, pulse: Pulse) -> np.ndarray:
    """Autocorrelation of a piecewise constant pulse from its definition, as overlap of shifted sub-chips."""
    n = len(pulse.levels)
    overlap = np.zeros_like(x)
    for i, first in enumerate(pulse.levels):
        for k, second in enumerate(pulse.levels):
            overlap += first * second * np.clip(1 / n - np.abs(x - (i - k) / n), 0, None)
    return overlap


def bisected(delay: np.ndarray, amplitude: np.ndarray, spacing: float, pulse: Pulse) -> np.ndarray:
    """First zero that a loop meets on its way from x = 0, on a fine grid and by halving, in chips."""

    def discriminator(x: float, row: int) -> float:
        place = np.array([x - spacing / 2, x + spacing / 2])
        total = triangle_sum(place, pulse) + sum(
            a * triangle_sum(place - tau, pulse) for a, tau in zip(amplitude[row], delay[row], strict=True)
        )
        early, late = np.abs(total) ** 2
        return float(early - late)

    roots = []
    for row in range(delay.shape[0]):
        start = discriminator(0.0, row)
        side, step = -np.sign(start), spacing / 8
        near, far = 0.0, side * step
        while discriminator(far, row) * start > 0:
            near, far = far, far + side * step
        for _ in range(25):  # to 4e-10 chips
            middle = 0.5 * (near + far)
            near, far = (middle, far) if discriminator(middle, row) * start > 0 else (near, middle)
        roots.append(0.5 * (near + far))
    return np.array(roots)


@pytest.mark.parametrize(("pulse", "spacing"), [(BOC11, 0.1), (BOC11, 0.25), (CBOC_MINUS, 0.1)])
def test_against_bisection(pulse: Pulse, spacing: float) -> None:
    rng = np.random.default_rng(3)
    delay = rng.exponential(0.15, (12, 2))
    amplitude = 0.3 * (rng.standard_normal((12, 2)) + 1j * rng.standard_normal((12, 2)))
    found = e1_multipath_error_m(delay * CHIP_M, amplitude, spacing_chips=spacing, pulse=pulse) / CHIP_M
    assert found == pytest.approx(bisected(delay, amplitude, spacing, pulse), abs=1e-7)


def test_an_epoch_does_not_depend_on_its_neighbours() -> None:
    rng = np.random.default_rng(4)
    delay_m = rng.exponential(40, (300, 9))
    amplitude = 0.2 * (rng.standard_normal((300, 9)) + 1j * rng.standard_normal((300, 9)))
    whole = e1_multipath_error_m(delay_m, amplitude)
    alone = [e1_multipath_error_m(delay_m[i : i + 1], amplitude[i : i + 1])[0] for i in range(40)]
    assert np.array_equal(whole[:40], alone)


def test_a_ray_of_any_strength_has_an_answer_within_reach() -> None:
    rng = np.random.default_rng(5)
    delay_m = rng.exponential(100, (2000, 1))
    amplitude = 10 ** rng.uniform(-1, 3, (2000, 1)) * np.exp(2j * np.pi * rng.random((2000, 1)))
    found = e1_multipath_error_m(delay_m, amplitude)
    assert np.all(np.abs(found) <= LOOP_REACH_CHIPS * CHIP_M * (1 + 1e-12))


@pytest.mark.parametrize("spacing", [0.0, 1.0, np.nan])
def test_the_spacing_is_part_of_a_chip(spacing: float) -> None:
    with pytest.raises(ValueError, match="chip"):
        error_chips(0.1, 0.1, spacing)
