"""Rows of chips and their products against sums over samples, written out in float64."""

from __future__ import annotations

import numpy as np
import pytest

from vestige.sample_processor.search.row_kernel import OFFSETS_AT_ONCE, row_products, time_of

RATE_HZ = 12.5e6
CODE_RATE, CODE_RATE_RATE = 5.115e6 * (1 + 4e-6), 25.0
IF_HZ, DOPPLER_RATE = 31_234.5, -700.0


def test_row_products_are_sums_over_samples() -> None:
    """Three rows from row 2 on, rows longer than a block and not a multiple of it, the samples from chip 4600.3 on."""
    rng = np.random.default_rng(1)
    n, first_row, rows = 2346, 2, 3
    x = (rng.standard_normal((25_000, 2)) @ [1, 1j]).astype(np.complex64)
    t0, dt = time_of(4600.3, CODE_RATE, CODE_RATE_RATE), 1 / RATE_HZ
    code = rng.choice([-1.0, 1.0], 3 * n).astype(np.float32)
    offsets, odd_offsets = np.array([0, 17, n - 1, 2 * n]), np.array([5, 5, 5, 6])
    out, odd = np.empty((2, rows, 4), np.float32), np.empty((2, rows, 4), np.float32)
    noise = np.empty(rows)
    row_products(
        x.view(np.float32), t0, dt, CODE_RATE, CODE_RATE_RATE, IF_HZ, DOPPLER_RATE, first_row, n,
        code, offsets, odd_offsets, out, odd, noise,
    )  # fmt: skip

    t = t0 + np.arange(x.size) * dt
    u = CODE_RATE * t + 0.5 * CODE_RATE_RATE * t**2
    y = x * np.exp(-2j * np.pi * (IF_HZ * t + 0.5 * DOPPLER_RATE * t**2))
    for late, where, found in ((0.0, offsets, out), (0.5, odd_offsets, odd)):
        chips = np.zeros(rows * n, complex)
        chip = np.floor(u - late).astype(int) - first_row * n
        inside = (chip >= 0) & (chip < rows * n)
        np.add.at(chips, chip[inside], y[inside])
        row_chips = chips.reshape(rows, n)
        expected = np.stack([row_chips @ code[offset : offset + n] for offset in where], axis=1)
        np.testing.assert_allclose(found[0] + 1j * found[1], expected, atol=1e-5 * np.max(np.abs(expected)))
        if late == 0.0:
            np.testing.assert_allclose(noise, np.sum(np.abs(row_chips) ** 2, axis=1), rtol=1e-5)
    assert offsets.size == OFFSETS_AT_ONCE


def test_the_time_of_a_chip_is_where_the_code_has_come_to_it() -> None:
    for chips in (-1e8, 0.0, 20_460.0, 1.6e8):  # 30 s
        t = time_of(chips, CODE_RATE, CODE_RATE_RATE)
        assert CODE_RATE * t + 0.5 * CODE_RATE_RATE * t**2 == pytest.approx(chips, abs=1e-6)
