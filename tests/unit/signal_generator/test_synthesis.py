from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from builders import batch_of, handover_at, random_chips
from vestige.constants import E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.sample_processor.correlator import correlate
from vestige.signal_generator.noise_kernel import noise_key, normal_pairs
from vestige.signal_generator.synthesis import ReceivedSignal, amplitude, synthesize
from vestige.signals.definitions import E6C

RATE = E6C.chip_rate_hz
CHIP_M = SPEED_OF_LIGHT_MPS / RATE


def signal_of(
    seed: int = 1,
    n_chips: int = 5115,
    start_s: float = 0.0,
    doppler_hz: float = 0.0,
    rate: float = 0.0,
    delay_m: tuple[float, ...] = (0.0,),
    amplitudes: tuple[complex, ...] = (1.0,),
    ray_hz: tuple[float, ...] | None = None,
    lead_chips: int = 0,
) -> ReceivedSignal:
    return ReceivedSignal(
        chips=random_chips(np.random.default_rng(seed), n_chips),
        start_s=start_s,
        doppler_hz=doppler_hz,
        doppler_rate_hz_per_s=rate,
        delay_m=np.array(delay_m),
        amplitude=np.array(amplitudes, np.complex128),
        ray_doppler_hz=np.zeros(len(delay_m)) if ray_hz is None else np.array(ray_hz),
        lead_chips=lead_chips,
    )


def plain(signal: ReceivedSignal, fs: float, first: int, n: int, if_hz: float) -> tuple[np.ndarray, np.ndarray]:
    """The definition in float64, and which samples lie so near a chip edge (0.4 µm) that either chip is right."""
    chips = signal.chips.chips.astype(float)
    f, rate = signal.doppler_hz, signal.doppler_rate_hz_per_s
    t = (first + np.arange(n)) / fs - signal.start_s
    x, near_edge = np.zeros(n, complex), np.zeros(n, bool)
    for delay_m, a, own_hz in zip(signal.delay_m, signal.amplitude, signal.ray_doppler_hz, strict=True):
        u = RATE * ((1 + f / E6_CARRIER_HZ) * t + 0.5 * rate / E6_CARRIER_HZ * t**2) - delay_m / CHIP_M
        u += signal.lead_chips
        j = np.floor(u).astype(int)
        inside = (j >= 0) & (j < chips.size)
        cycles = (if_hz + f + own_hz) * t + 0.5 * rate * t**2
        x += np.where(inside, a * chips[np.clip(j, 0, chips.size - 1)], 0) * np.exp(2j * np.pi * cycles)
        near_edge |= np.abs(u - np.round(u)) < 2.0**-26
    return x, near_edge


rays = st.lists(
    st.tuples(
        st.one_of(st.floats(-500, 1400), st.sampled_from([0.0, 23 * CHIP_M, -8 * CHIP_M, 5000.0, -4000.0])),
        st.complex_numbers(max_magnitude=3.0, allow_nan=False, allow_infinity=False),
        st.sampled_from([0.0, 1.5, -5.0, 300.0]),
    ),
    min_size=0,
    max_size=6,
)


@settings(max_examples=60)
@given(
    rays=rays,
    seed=st.integers(0, 1000),
    n_chips=st.sampled_from([1, 40, 1024, 5115, 20_460]),
    fs=st.sampled_from([3e6, 5.2e6, 10.23e6, 10.3e6, 12.5e6, 20.46e6]),
    start_s=st.floats(-2e-3, 1e-3),
    doppler_hz=st.floats(-5000, 5000),
    rate=st.sampled_from([0.0, 0.7, -100.0]),
    first=st.sampled_from([-50, 0, 700, 1024, 3000]),
    lead=st.sampled_from([0, 33, 6000]),
    if_hz=st.sampled_from([0.0, 2e6]),
)
def test_equals_the_definition_at_every_sample(
    rays: list[tuple[float, complex, float]],
    seed: int,
    n_chips: int,
    fs: float,
    start_s: float,
    doppler_hz: float,
    rate: float,
    first: int,
    lead: int,
    if_hz: float,
) -> None:
    delay_m, amplitudes, ray_hz = zip(*rays, strict=True) if rays else ((), (), ())
    signal = signal_of(seed, n_chips, start_s, doppler_hz, rate, delay_m, amplitudes, ray_hz, lead)
    n = int(3e-3 * fs)
    x = synthesize(
        (signal,),
        sample_rate_hz=fs,
        n_samples=n,
        noise_key=None,
        first_sample=first,
        center_frequency_hz=E6_CARRIER_HZ - if_hz,
    )
    expected, near_edge = plain(signal, fs, first, n, if_hz)
    assert x.shape == (n,)
    assert x.dtype == np.complex64
    error = np.abs(x - expected) / (np.abs(signal.amplitude).sum() + 1e-9)
    assert np.max(error[~near_edge], initial=0.0) < 5e-7


def test_doppler_rate_over_a_whole_segment() -> None:
    """At the end of 16 ms, 100 Hz/s turn a block of 0.3 ms by 3 mrad: more than a first order would do."""
    signal = signal_of(n_chips=81_840, doppler_hz=500.0, rate=-100.0, start_s=1e-7)
    x = synthesize((signal,), sample_rate_hz=3e6, n_samples=48_000, noise_key=None)
    expected, near_edge = plain(signal, 3e6, 0, 48_000, 0.0)
    assert np.max(np.abs(x - expected)[~near_edge]) < 5e-7


def test_signals_and_noise_add() -> None:
    """Two signals in noise are the sum of three calls, to float32's rounding."""
    a, b = signal_of(seed=1, delay_m=(0.0, 40.0), amplitudes=(1.0, 0.3j)), signal_of(seed=2, doppler_hz=-800.0)
    key = noise_key(3, 4, 5)
    common = {"sample_rate_hz": 12.5e6, "n_samples": 9000}
    together = synthesize((a, b), noise_key=key, **common)
    parts = [synthesize((s,), noise_key=None, **common) for s in (a, b)] + [synthesize((), noise_key=key, **common)]
    assert np.max(np.abs(together - sum(parts))) < 2e-6
    assert parts[2] == pytest.approx(normal_pairs(key, 0, 9000) @ [1, 1j] * np.sqrt(0.5), rel=5e-7)


@given(cut=st.integers(0, 12_000), begin=st.sampled_from([-3000, -7, 0, 5000]), seed=st.integers(0, 50))
@settings(max_examples=30)
def test_same_bits_wherever_the_samples_are_cut(cut: int, begin: int, seed: int) -> None:
    signal = signal_of(seed, 6000, 2e-5, 1234.5, -3.0, (0.0, 35.0), (0.02, 0.01j), (0.0, 2.0))
    common = {"sample_rate_hz": 12.5e6, "noise_key": noise_key(seed, 1, 1)}
    whole = synthesize((signal,), n_samples=12_000, first_sample=begin, **common)
    left = synthesize((signal,), n_samples=cut, first_sample=begin, **common)
    right = synthesize((signal,), n_samples=12_000 - cut, first_sample=begin + cut, **common)
    assert np.array_equal(np.concatenate([left, right]), whole)


def test_the_correlator_finds_amplitude_and_phase() -> None:
    """C/N0 of 60 dBHz, 4 ms: |tap|²/noise = C/N0 T, phase of the ray; a second ray three chips later stands alone."""
    fs, t_s = 12.5e6, 4e-3
    a = amplitude(60.0, fs)
    signal = signal_of(5, 20_460, 1e-4, 2345.6, -5.0, (0.0, 180.0), (a * np.exp(0.4j), a * np.exp(-2j) / 2))
    x = synthesize((signal,), sample_rate_hz=fs, n_samples=int(4.3e-3 * fs), noise_key=noise_key(1, 1, 1))
    bank = correlate(batch_of(x, fs), handover_at(signal.chips, 1e-4, 2345.6, -5.0), np.array([0.0, 90.0, 180.0]))
    assert bank is not None
    spread = 1 / np.sqrt(1e6 * t_s)  # of a tap, of unit amplitude; the code's own noise is below it
    assert abs(bank.taps[0] / a - np.exp(0.4j)) < 5 * spread
    assert abs(bank.taps[2] / a - np.exp(-2j) / 2) < 5 * spread
    assert abs(bank.taps[1] / a) < 5 * spread
    own = 1.25 * 1e6 / RATE  # the two rays add to the floor at most their own C/N0 over a chip
    assert 0.98 < bank.noise_power * fs * t_s < 1.02 + own
