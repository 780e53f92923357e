from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from builders import batch_of, received_batch, satellite
from vestige.constants import E1_CARRIER_HZ, E1_CODE_PERIOD_S, SPEED_OF_LIGHT_MPS
from vestige.records import Band
from vestige.sample_processor.search.e1_jump import Jump
from vestige.sample_processor.search.e1_search import MAX_SIGNALS, search_e1
from vestige.signals.definitions import E1C

TRUE_M, RATE_MPS = 2.4e7, -300.0


def _copy(delay_m: float, rate_mps: float, cn0_dbhz: float, svid: int = 11) -> dict:
    return satellite(svid, TRUE_M + delay_m, rate_mps, cn0_dbhz, 40.0)


@pytest.mark.parametrize(
    ("delay_m", "rate_mps"),
    [
        (1.3e-3 * SPEED_OF_LIGHT_MPS, RATE_MPS),  # far away
        (3.0 * 293.05, RATE_MPS),  # three chips later
        (-1.0e-3 * SPEED_OF_LIGHT_MPS, RATE_MPS + 350.0),  # another Doppler
        (2.0 * SPEED_OF_LIGHT_MPS + 5e5, RATE_MPS),  # seconds later: only the phase modulo 4 ms shows
    ],
)
def test_two_signals_are_two(delay_m: float, rate_mps: float) -> None:
    """The true signal and one 6 dB stronger; whatever the true one's rank, each where it is."""
    batch = received_batch(
        Band.E1, [_copy(0.0, RATE_MPS, 40.0), _copy(delay_m, rate_mps, 46.0)], rate_hz=4.5e6, duration_s=0.04
    )
    strong, weak = search_e1(batch, [11])
    for one, delay, rate in ((weak, 0.0, RATE_MPS), (strong, delay_m, rate_mps)):
        expected_s = (TRUE_M + delay) / SPEED_OF_LIGHT_MPS
        error_chips = ((one.code_start_s - expected_s + 2e-3) % E1_CODE_PERIOD_S - 2e-3) * E1C.chip_rate_hz
        assert abs(error_chips) < 0.3
        assert one.doppler_hz == pytest.approx(-rate / SPEED_OF_LIGHT_MPS * E1_CARRIER_HZ, abs=63)


def test_one_strong_signal_is_one() -> None:
    """55 dBHz: its side peaks, side lobes in Doppler and code are all far above the threshold of noise."""
    batch = received_batch(Band.E1, [_copy(0.0, RATE_MPS, 55.0)], rate_hz=4.5e6, duration_s=0.04)
    (one,) = search_e1(batch, [11, 12, 24])
    assert one.svid == 11
    assert one.statistic > 100 * one.threshold


def test_one_strong_signal_at_the_edge_of_the_band_is_one() -> None:
    """Over 100 ms the code moves by 0.3 chip; a bin at the other edge of the band follows it as much the other way."""
    batch = received_batch(Band.E1, [_copy(0.0, -940.0, 55.0)], rate_hz=4.5e6, duration_s=0.1)
    (one,) = search_e1(batch, [11])
    assert one.doppler_hz == pytest.approx(4940, abs=126)


def test_both_components_find_what_the_pilot_alone_does_not() -> None:
    """31.5 dBHz in eight periods: near the middle of the pilot's detection curve."""
    found = {1: 0, 2: 0}
    for seed in range(6):
        sky = [_copy(0.0, RATE_MPS, 31.5)]
        batch = received_batch(Band.E1, sky, rate_hz=4.5e6, duration_s=0.0365, seed=seed)
        found[1] += len(search_e1(batch, [11], signals=(E1C,), periods=8))
        found[2] += len(search_e1(batch, [11], periods=8))
    assert found[2] > found[1]


def test_a_signal_that_jumps_is_one() -> None:
    """360 samples, 80 µs, are missing 24 ms after the first; at 36 dBHz, where single periods are near the noise."""
    for cn0_dbhz in (36.0, 45.0):
        batch = received_batch(Band.E1, [_copy(0.0, RATE_MPS, cn0_dbhz)], rate_hz=4.5e6, duration_s=0.05)
        cut = np.delete(batch.samples, np.arange(108_000, 108_360))
        jumps: list[Jump] = []
        (one,) = search_e1(replace(batch, samples=cut), [11], jumped=jumps.append)
        (jump,) = jumps
        assert jump.svid == one.svid == 11
        assert jump.by_s == pytest.approx(-80e-6, abs=0.5e-6)
        assert jump.at_s == pytest.approx(0.024, abs=0.005)


@pytest.mark.parametrize("comes", [True, False])
def test_a_second_signal_that_comes_or_goes_is_a_second_signal(comes: bool) -> None:
    """6 dB stronger, and there for half of the time; the true one stays."""
    true = _copy(0.0, RATE_MPS, 40.0)
    alone = received_batch(Band.E1, [true], rate_hz=4.5e6, duration_s=0.05)
    both = received_batch(Band.E1, [true, _copy(3e5, RATE_MPS, 46.0)], rate_hz=4.5e6, duration_s=0.05)
    first, second = (alone, both) if comes else (both, alone)
    half = alone.samples.size // 2
    mixed = np.concatenate([first.samples[:half], second.samples[half:]])
    jumps: list[Jump] = []
    assert len(search_e1(replace(alone, samples=mixed), [11], jumped=jumps.append)) == 2
    assert jumps == []


def test_a_swept_jammer_is_eight_signals_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sweep of 4 MHz each 10 µs exceeds the threshold at hundreds of code phases; no pair of them is a jump."""
    compared: list[object] = []
    monkeypatch.setattr("vestige.sample_processor.search.e1_search.find_jump", lambda *given: compared.append(given))
    rate_hz, n = 5.2e6, 208_000
    t_s = np.arange(n) / rate_hz % 10e-6
    sweep = np.exp(2j * np.pi * (-2e6 * t_s + 0.5 * 4e11 * t_s**2))
    noise = np.random.default_rng(3).standard_normal((n, 2)).view(np.complex128)[:, 0]
    batch = batch_of((noise + 6 * sweep).astype(np.complex64), rate_hz, Band.E1)
    found = search_e1(batch, (6, 11))
    assert [sum(one.svid == svid for one in found) for svid in (6, 11)] == [MAX_SIGNALS] * 2
    assert compared == []


def test_noise_alone_is_no_signal() -> None:
    """Ten searches at an overall P_FA of 1e-3: an alarm has probability 1 %, two 5e-5."""
    alarms = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        batch = batch_of(rng.standard_normal((33_000, 2)) @ [1, 1j], 4.0e6, Band.E1)
        alarms += len(search_e1(batch, [1 + seed]))
    assert alarms <= 1


def test_too_few_samples_and_no_satellites_are_nothing() -> None:
    assert search_e1(batch_of(np.ones(31_999), 4.0e6, Band.E1), [1]) == ()
    assert search_e1(batch_of(np.ones(40_000), 4.0e6, Band.E1), ()) == ()
