from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from vestige.sample_processor.tracking.correlator_bank_kernel import (
    REMOVED_STEPS,
    add_to_bank,
    bank_replicas,
    bank_vectors,
    bank_workspace,
    correlate_part,
    piece_length,
    removed_cycles,
    running_sums,
    segments_in_half_chip,
)
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1B, E1C, SignalDefinition

CODES = primary_code(E1C, 7), primary_code(E1B, 7)
REPLICAS = ("BOC(1,1)", "CBOC")


def _plain_replica(signal: SignalDefinition, half_chips: np.ndarray, replica: str) -> np.ndarray:
    """Return the replica at code phases in half chips, written from the definition of the pulse."""
    chips = np.mod(half_chips, 8184) / 2
    code = primary_code(signal, 7)[np.floor(chips).astype(int)].astype(float)
    slow = np.where(np.floor(2 * chips).astype(int) % 2 == 0, 1.0, -1.0)
    quick = np.where(np.floor(12 * chips).astype(int) % 2 == 0, 1.0, -1.0)
    sign = 1 if signal is E1B else -1
    return code * slow if replica == "BOC(1,1)" else code * (np.sqrt(10 / 11) * slow + sign * np.sqrt(1 / 11) * quick)


@pytest.mark.parametrize("replica", REPLICAS)
@pytest.mark.parametrize(
    ("rate_hz", "lags"),
    [
        (4.1e6, [-1, 0, 1]),
        (12.5e6, [-2, -1, 0, 1, 2]),
        (12.5e6, [-3, -2, -1, 0, 1, 2, 3]),
        (12.5e6, [0]),
        (25e6, [-8, -6, -4, -2, 0, 2, 4, 6, 8]),
        (50e6, [-25, -20, -15, -10, -5, 0, 5, 10, 15, 20, 25]),
    ],
)
def test_correlates_as_the_sums_say(replica: str, rate_hz: float, lags: list[int]) -> None:
    rng = np.random.default_rng(3)
    n, step, phase, cycles, doppler_hz = round(0.00399 * rate_hz), 2.046e6 / rate_hz, 0.11371, 0.37, 5e3
    half_chips = phase + step * np.arange(n)
    x = (rng.normal(size=2 * n) * 20).astype(np.float32)
    whole = np.array(lags)
    bank = np.empty(whole.size, np.complex128)
    k = segments_in_half_chip(replica)
    per_sample = doppler_hz / rate_hz
    data = correlate_part(
        x, bank_replicas(*CODES, replica), k * phase, k * step, cycles, per_sample, whole, *bank_vectors(whole), bank
    )
    wiped = x.astype(float).view(complex) * np.exp(-2j * np.pi * (cycles + per_sample * np.arange(n)))
    expected = [wiped @ _plain_replica(E1C, half_chips - lag * step, replica) for lag in lags]
    # A sample in doubt at an edge is 20 · √2. The carrier turns by up to ±π · 0.0025 within a segment, an error
    # of 0.5 % in the sums of noise, which are 20 · √(2n).
    error = 60 + 0.01 * 20 * np.sqrt(2 * n)
    np.testing.assert_allclose(bank, expected, atol=error)
    assert data == pytest.approx(wiped @ _plain_replica(E1B, half_chips, replica), abs=error)


@pytest.mark.parametrize("doppler_hz", [0.0, 5e3, -1e4])
def test_a_segment_with_a_single_phase_keeps_the_amplitude(doppler_hz: float) -> None:
    """The signal itself, correlated at its own phase and frequency, loses 1e-4 of its amplitude and no phase."""
    rate_hz = 12.5e6
    n, step, phase, cycles = 49_990, 2.046e6 / rate_hz, 0.11, 0.37
    carrier = np.exp(2j * np.pi * (cycles + doppler_hz / rate_hz * np.arange(n)))
    signal = (_plain_replica(E1C, phase + step * np.arange(n), "BOC(1,1)") * carrier).astype(np.complex64)
    lags, bank = np.arange(-2, 3), np.empty(5, np.complex128)
    correlate_part(
        signal.view(np.float32), bank_replicas(*CODES), phase, step, cycles, doppler_hz / rate_hz, lags,
        *bank_vectors(lags), bank,
    )  # fmt: skip
    assert bank[2] / n == pytest.approx(1.0, abs=1e-4)


def test_a_removed_frequency_changes_no_correlation() -> None:
    """The same samples, with the front end's centre frequency removed before they are summed, give the same bank."""
    rng = np.random.default_rng(4)
    rate_hz, if_hz, doppler_hz, first = 12.5e6, -1.0001e6, 2e3, 10**12 + 17
    n, step, cycles = 6000, 2.046e6 / rate_hz, 0.2
    base = (rng.normal(size=(n, 2)) @ [20, 20j]).astype(np.complex128)
    lags = np.arange(-2, 3)
    shift = round(if_hz / rate_hz * REMOVED_STEPS)
    numbers = np.arange(n)
    removed = np.array([removed_cycles(first + int(k), shift) for k in (0, 1, n - 1)])
    exact = [(((first + k) * shift) % (1 << 32)) / REMOVED_STEPS for k in (0, 1, n - 1)]
    np.testing.assert_array_equal(removed, exact)
    moved = base * np.exp(2j * np.pi * (removed[0] + shift / REMOVED_STEPS * numbers))
    banks = []
    for samples, by in ((base, 0), (moved, shift)):
        work, bank = bank_workspace(), np.zeros(5, np.complex128)
        assert n <= piece_length(step, lags)
        running_sums(samples.astype(np.complex64).view(np.float32), first, by, work)
        add_to_bank(
            work, 0, n, bank_replicas(*CODES), 0.3, step, cycles, doppler_hz / rate_hz, lags, *bank_vectors(lags), bank
        )
        banks.append(bank)
    np.testing.assert_allclose(banks[1], banks[0], atol=1e-4 * 20 * np.sqrt(2 * n))


def test_the_sums_do_not_depend_on_how_a_code_period_is_cut() -> None:
    rng = np.random.default_rng(5)
    n, step = 6000, 2.046e6 / 12.5e6
    x = (rng.normal(size=2 * n) * 20).astype(np.float32)
    lags = np.arange(-2, 3)
    replicas, vectors = bank_replicas(*CODES), bank_vectors(lags)
    banks, prompts = [], []
    for cuts in ([0, n], [0, 1, 2, 7, 700, 3001, n - 1, n]):
        work, bank, prompt = bank_workspace(), np.zeros(5, np.complex128), 0.0j
        running_sums(x, 0, 0, work)
        for a, b in pairwise(cuts):
            prompt += add_to_bank(
                work, a, b - a, replicas, 0.3 + a * step, step, 0.1 + a * 1e-4, 1e-4, lags, *vectors, bank
            )
        banks.append(bank)
        prompts.append(prompt)
    # the segment of a cut has the same phase on both sides
    np.testing.assert_allclose(banks[1], banks[0], atol=1e-4 * 20 * np.sqrt(2 * n))
    assert prompts[1] == pytest.approx(prompts[0], abs=1e-4 * 20 * np.sqrt(2 * n))
