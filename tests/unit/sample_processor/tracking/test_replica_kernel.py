from __future__ import annotations

import numpy as np
import pytest

from vestige.sample_processor.tracking.replica_kernel import (
    HALF_CHIPS,
    correlate_period,
    fill_replica,
    half_chip_windows,
)
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1B, E1C, SignalDefinition

HIGH = float(np.sqrt(1 / 11))


def _plain_replica(signal: SignalDefinition, svid: int, half_chips: np.ndarray, high: float) -> np.ndarray:
    """Return the replica at code phases in half chips, written from the definition of the pulse."""
    chips = np.mod(half_chips, HALF_CHIPS) / 2
    code = primary_code(signal, svid)[np.floor(chips).astype(int)].astype(float)
    slow = np.where(np.floor(2 * chips).astype(int) % 2 == 0, 1.0, -1.0)
    quick = np.where(np.floor(12 * chips).astype(int) % 2 == 0, 1.0, -1.0)
    return code * slow if high == 0.0 else code * (np.sqrt(10 / 11) * slow + high * quick)


@pytest.mark.parametrize("signal", [E1B, E1C], ids=lambda one: one.name)
@pytest.mark.parametrize("high", [0.0, HIGH, -HIGH])
@pytest.mark.parametrize("rate_hz", [4.1e6, 12.5e6, 25e6])
def test_replica_is_the_pulse_of_the_code(signal: SignalDefinition, high: float, rate_hz: float) -> None:
    step = 2 * 1.023e6 / rate_hz * (1 + 2e-6)
    replica = np.empty(3000, np.float32)
    for phase in (-1.73, 0.31, 4000.123, HALF_CHIPS - 40.4):
        if phase + replica.size * step > HALF_CHIPS + 60:
            replica = np.empty(int(80 / step), np.float32)
        fill_replica(half_chip_windows(primary_code(signal, 11)), phase, step, high, replica)
        expected = _plain_replica(signal, 11, phase + step * np.arange(replica.size), high)
        # a sample within 1e-6 half chip of an edge may fall on either side
        assert np.count_nonzero(np.abs(replica - expected) > 1e-6) <= 1


@pytest.mark.parametrize("high", [0.0, HIGH])
def test_correlates_as_the_sums_say(high: float) -> None:
    rng = np.random.default_rng(3)
    n, step, phase, cycles, per_sample = 49_990, 2 * 1.023e6 / 12.5e6, 0.11, 0.37, 1.3e-3
    x = (rng.normal(size=2 * n) * 20).astype(np.float32)
    lags = np.array([-4, -2, 0, 2, 4])
    bank = np.empty(lags.size, np.complex128)
    windows = [half_chip_windows(primary_code(signal, 7)) for signal in (E1C, E1B)]
    data = correlate_period(x, *windows, high, phase, step, cycles, per_sample, lags, bank)
    wiped = x.astype(float).view(complex) * np.exp(-2j * np.pi * (cycles + per_sample * np.arange(n)))
    half_chips = phase + step * np.arange(n)
    expected = [wiped @ _plain_replica(E1C, 7, half_chips - lag * step, -high) for lag in lags]
    # one sample in doubt at an edge is 20 · √2; the sums of noise are 20 · √(2n) = 6300
    np.testing.assert_allclose(bank, expected, atol=60)
    assert data == pytest.approx(wiped @ _plain_replica(E1B, 7, half_chips, high), abs=60)
