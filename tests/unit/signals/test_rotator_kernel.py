from __future__ import annotations

import cmath
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vestige.signals.rotator_kernel import BLOCK, MIDDLE, from_middle, rotator_table, turn_at


def exact(cycles: float) -> complex:
    """The phasor after the removal of whole quarters of a cycle, which rounds nothing."""
    quarters = math.floor(4 * cycles + 0.5)
    return 1j ** (quarters % 4) * cmath.exp(2j * math.pi * (cycles - quarters / 4))


@given(cycles_per_sample=st.floats(-0.5, 0.5))
def test_the_table_counts_from_the_middle(cycles_per_sample: float) -> None:
    cos, sin = np.empty((2, BLOCK), np.float32)
    rotator_table(cycles_per_sample, cos, sin)
    assert np.array_equal(from_middle(), np.arange(BLOCK) - MIDDLE)
    expected = np.exp(2j * np.pi * cycles_per_sample * (np.arange(BLOCK) - MIDDLE))
    assert np.max(np.abs(cos + 1j * sin - expected)) < 1e-7


@given(f=st.floats(-6e6, 6e6), rate=st.floats(-1e3, 1e3), t=st.floats(0, 0.1))
def test_the_phase_has_frequency_and_rate(f: float, rate: float, t: float) -> None:
    assert abs(turn_at(f, rate, t) - exact(f * t % 1 + 0.5 * rate * t * t % 1)) < 4e-15
