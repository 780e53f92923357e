from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.signal_generator.waveform import open_component, random_signs
from vestige.signals.codes import primary_code, secondary_code
from vestige.signals.definitions import ALL_SIGNALS, E1B, E1C, E6C, SignalDefinition


@pytest.mark.parametrize("signal", ALL_SIGNALS, ids=lambda signal: signal.name)
def test_one_period_is_code_times_pulse(signal: SignalDefinition) -> None:
    levels = np.asarray(signal.pulse.levels)
    n = levels.size
    k = np.arange(signal.code_length * n)
    t = (k + 0.5) / (signal.chip_rate_hz * n) + 3 * signal.period_s
    expected = np.repeat(primary_code(signal, 7), n) * np.tile(levels, signal.code_length)
    sign = secondary_code(signal, 7)[3 % signal.secondary_length]
    component = open_component(signal, 7, seed=1)
    if component.symbol is None:
        sign = -sign  # a band is (e_B − e_C)/√2
    else:
        sign = sign * component.symbol(np.array([round(3 * signal.period_s * signal.symbol_rate_hz)]))[0]
    assert component.modulation(t) == pytest.approx(sign * expected)


@given(st.floats(2e7, 3e7), st.floats(-1000, 1000))
def test_carrier_and_code_move_together(range_m: float, rate_mps: float) -> None:
    """Two samples one code chip of delay apart differ in phase by f_c times that delay."""
    t = np.array([0.25, 0.25 + 1e-7])
    pseudorange = range_m + rate_mps * t
    x = open_component(E6C, 3).received(t, pseudorange, E6C.carrier_hz)
    assert np.abs(x) == pytest.approx(1.0)
    turns = np.angle(x[1] * x[0].conj()) / (2 * np.pi) + 0.25
    expected = -E6C.carrier_hz * rate_mps * 1e-7 / SPEED_OF_LIGHT_MPS + 0.25
    half_turns = (turns - expected) % 0.5  # a chip edge between the two samples adds half a turn
    assert min(half_turns, 0.5 - half_turns) == pytest.approx(0.0, abs=1e-5)


def test_pilot_has_no_symbols_and_satellites_differ() -> None:
    assert open_component(E1C, 1).symbol is None
    a, b = open_component(E1B, 1, seed=4).symbol, open_component(E1B, 2, seed=4).symbol
    assert a is not None
    assert b is not None
    index = np.arange(1000)
    assert 400 < np.sum(a(index) == b(index)) < 600  # binomial(1000, ½): 6 sigma


def test_random_signs_are_fair_and_a_function_of_the_index() -> None:
    sign = random_signs(b"k" * 32)
    values = sign(np.arange(100_000))
    assert abs(values.sum(dtype=int)) < 5 * np.sqrt(100_000)
    assert abs(np.sum(values[1:] * values[:-1], dtype=int)) < 5 * np.sqrt(100_000)
    assert np.array_equal(sign(np.arange(500, 600)), values[500:600])
