from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from builders import START, batch_of, handover_at, metres_to_seconds, random_chips
from vestige.constants import E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.records import Handover, SampleBatch
from vestige.sample_processor.correlator import correlate

RATE = 5.115e6


def middle_of(offsets_m: np.ndarray) -> float:
    """Return the middle of a bank in chips; beyond half a chip, whole chips."""
    mean = float(np.mean(offsets_m / SPEED_OF_LIGHT_MPS * RATE))
    return mean if abs(mean) < 0.5 else float(np.trunc(mean))


def brute_force(batch: SampleBatch, handover: Handover, offsets_m: np.ndarray) -> tuple[np.ndarray, float]:
    """The definition, tap by tap and sample by sample, in float64."""
    chips = handover.chips.chips
    f, rate = handover.doppler_hz, handover.doppler_rate_hz_per_s
    t = np.arange(batch.samples.size) / batch.sample_rate_hz - (handover.start_time - batch.start)
    u = RATE * (t + f / E6_CARRIER_HZ * t + 0.5 * rate / E6_CARRIER_HZ * t**2)
    cycles = (E6_CARRIER_HZ - batch.center_frequency_hz + f) * t + 0.5 * rate * t**2
    y = batch.samples.astype(np.complex128) * np.exp(-2j * np.pi * cycles)
    m = chips.size / (RATE * (1 + f / E6_CARRIER_HZ)) * batch.sample_rate_hz
    taps = []
    for offset_m in offsets_m:
        j = np.floor(u - offset_m / SPEED_OF_LIGHT_MPS * RATE).astype(int)
        inside = (j >= 0) & (j < chips.size)
        taps.append(np.sum(y[inside] * chips[j[inside]]) / m)
    j = np.floor(u - middle_of(offsets_m)).astype(int)
    inside = (j >= 0) & (j < chips.size)
    sums = np.bincount(j[inside], y[inside].real) + 1j * np.bincount(j[inside], y[inside].imag)
    return np.array(taps), float(np.sum(np.abs(sums) ** 2) / m**2)


def on_an_edge(batch: SampleBatch, handover: Handover, offsets_m: np.ndarray) -> bool:
    """Whether a sample lies on a chip's edge, where the last digit decides to which chip it belongs."""
    t = np.arange(batch.samples.size) / batch.sample_rate_hz - (handover.start_time - batch.start)
    f, rate = handover.doppler_hz, handover.doppler_rate_hz_per_s
    u = RATE * (t + f / E6_CARRIER_HZ * t + 0.5 * rate / E6_CARRIER_HZ * t**2)
    late = np.append(offsets_m / SPEED_OF_LIGHT_MPS * RATE, middle_of(offsets_m))
    return bool(np.any(np.abs(np.subtract.outer(u, late) - np.rint(np.subtract.outer(u, late))) < 1e-9))


@settings(max_examples=40)
@given(
    seed=st.integers(0, 1000),
    n_chips=st.sampled_from([200, 1024, 5115, 10_230]),
    sample_rate_hz=st.sampled_from([5.2e6, 10.3e6, 12e6, 12.5e6, 20.46e6]),
    doppler_hz=st.floats(-5000, 5000),
    rate=st.sampled_from([0.0, 20.0, -100.0]),
    start_s=st.floats(3e-6, 1e-4),
    n_taps=st.integers(1, 13),
    middle_m=st.one_of(st.floats(-60, 60), st.floats(-300, -200)),
    spacing_m=st.floats(1.0, 60.0),
    if_hz=st.sampled_from([0.0, 3e6]),
)
def test_equals_the_brute_force_double_loop(
    seed: int,
    n_chips: int,
    sample_rate_hz: float,
    doppler_hz: float,
    rate: float,
    start_s: float,
    n_taps: int,
    middle_m: float,
    spacing_m: float,
    if_hz: float,
) -> None:
    rng = np.random.default_rng(seed)
    chips = random_chips(rng, n_chips)
    handover = handover_at(chips, start_s, doppler_hz, rate)
    n = int((n_chips / RATE + 2e-4) * sample_rate_hz)
    noise = rng.standard_normal((n, 2)) @ [1, 1j]
    batch = batch_of(noise, sample_rate_hz, center_frequency_hz=E6_CARRIER_HZ - if_hz)
    offsets_m = middle_m + (np.arange(n_taps) - (n_taps - 1) / 2) * spacing_m
    assume(not on_an_edge(batch, handover, offsets_m))
    bank = correlate(batch, handover, offsets_m)
    if start_s + metres_to_seconds(float(offsets_m.min())) < 0:
        assert bank is None
        return
    assert bank is not None
    taps, noise_power = brute_force(batch, handover, offsets_m)
    assert np.max(np.abs(bank.taps - taps)) < 1e-6 * np.sqrt(noise_power) * 5
    assert bank.noise_power == pytest.approx(noise_power, rel=1e-6)
    assert bank.integration_s == pytest.approx(n_chips / RATE, rel=1e-5)


def test_a_ray_of_amplitude_a_gives_a_and_the_triangle() -> None:
    """Noise-free, incommensurate rate: tap k sees a·(1 − |d|/chip) up to the code's own noise 1/√N."""
    rng = np.random.default_rng(3)
    chips = random_chips(rng, 81_840)
    fs, delay_m, a = 12.5e6, 20.0, 0.3 * np.exp(1j)
    t = np.arange(int(0.0163 * fs)) / fs
    j = np.floor((t - 1e-4 - metres_to_seconds(delay_m)) * RATE).astype(int)
    inside = (j >= 0) & (j < chips.chips.size)
    samples = np.where(inside, a * chips.chips[np.clip(j, 0, chips.chips.size - 1)], 0)
    offsets_m = np.arange(-5, 6) * 15.0
    bank = correlate(batch_of(samples, fs), handover_at(chips, 1e-4), offsets_m)
    assert bank is not None
    triangle = np.maximum(0, 1 - np.abs(offsets_m - delay_m) / (SPEED_OF_LIGHT_MPS / RATE))
    assert np.abs(bank.taps / a - triangle).max() < 5 / np.sqrt(81_840)
    assert np.angle(bank.taps[6] / a) == pytest.approx(0.0, abs=0.02)


def test_noise_power_is_the_mean_over_wrong_codes() -> None:
    """2000 random codes against coloured noise, a strong signal and a tone: mean |tap|² within 5 standard errors."""
    rng = np.random.default_rng(5)
    chips = random_chips(rng, 5115)
    fs = 12.5e6
    n = int(1.3e-3 * fs)
    white = rng.standard_normal((n + 4, 2)) @ [1, 1j]
    t = np.arange(n) / fs
    samples = white[:-4] + white[1:-3] + 0.5 * white[2:-2] + 0.8 * np.exp(2j * np.pi * 0.4e6 * t)
    batch = batch_of(samples, fs)
    zero = np.zeros(1)
    measured = correlate(batch, handover_at(chips, 1e-4, 1000.0), zero)
    assert measured is not None
    powers = []
    for _ in range(2000):
        bank = correlate(batch, handover_at(random_chips(rng, 5115), 1e-4, 1000.0), zero)
        assert bank is not None
        powers.append(np.abs(bank.taps[0]) ** 2)
    assert np.mean(powers) == pytest.approx(measured.noise_power, abs=5 * np.std(powers) / np.sqrt(2000))


@pytest.mark.parametrize("start_s", [-1e-6, 0.3e-3])
def test_outside_the_samples(start_s: float) -> None:
    chips = random_chips(np.random.default_rng(1), 1023)
    batch = batch_of(np.ones(5000), 12.5e6)  # 0.4 ms
    assert correlate(batch, handover_at(chips, start_s), np.zeros(1)) is None


def test_taps_out_of_reach() -> None:
    chips = random_chips(np.random.default_rng(1), 1023)
    with pytest.raises(ValueError, match="reach"):
        correlate(batch_of(np.ones(50_000), 12.5e6), handover_at(chips, 1e-3), np.array([-600.0, 600.0]))


def test_same_bits_wherever_the_batch_was_cut() -> None:
    """The same samples in a longer batch give the same taps to rounding: the start of the cut is not special."""
    rng = np.random.default_rng(8)
    chips = random_chips(rng, 10_230)
    samples = rng.standard_normal((60_000, 2)) @ [1, 1j]
    offsets_m = np.arange(-5, 6) * 15.0
    whole = correlate(batch_of(samples, 12.5e6), handover_at(chips, 1e-3, 700.0), offsets_m)
    cut = batch_of(samples[9_000:], 12.5e6)
    moved = SampleBatch(
        band=cut.band,
        samples=cut.samples,
        sample_rate_hz=cut.sample_rate_hz,
        center_frequency_hz=cut.center_frequency_hz,
        first_sample=9_000,
        start=START + 9_000 / 12.5e6,
    )
    part = correlate(moved, handover_at(chips, 1e-3, 700.0), offsets_m)
    assert whole is not None
    assert part is not None
    assert part.taps == pytest.approx(whole.taps, abs=1e-9)
