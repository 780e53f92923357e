"""A jammer leaves in the correlators what its covariance says, measured with random chips on its samples."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signals.definitions import E1C, E6C
from vestige.spoofer.jammers import (
    ALL_JAMMERS,
    AnyJammer,
    Chirp,
    ContinuousWave,
    Pulsed,
    Wideband,
    power_in_samples,
    rise,
)

FS, BANDWIDTH = 12.5e6, 20.46e6
CASES = (
    Wideband(),
    ContinuousWave(),
    ContinuousWave(offset_hz=1.1e6),
    Chirp(),
    Chirp(bandwidth_hz=3e6, sweep_s=50e-6),
    Pulsed(),
)


def test_every_waveform_has_a_case() -> None:
    assert {type(jammer) for jammer in CASES} == set(ALL_JAMMERS)


@pytest.mark.parametrize("jammer", CASES, ids=str)
def test_power_and_key(jammer: AnyJammer) -> None:
    x, again, other = (np.zeros(200_000, np.complex64) for _ in range(3))
    jammer.add(x, 3.0, FS, noise_key(1, 0, 16))
    jammer.add(again, 3.0, FS, noise_key(1, 0, 16))
    jammer.add(other, 3.0, FS, noise_key(1, 1, 16))
    assert np.mean(np.abs(x) ** 2) == pytest.approx(3.0, rel=0.03)
    assert x.tobytes() == again.tobytes()
    assert not np.array_equal(x, other)
    nothing = np.zeros(1000, np.complex64)
    jammer.add(nothing, 0.0, FS, noise_key(1, 0, 16))
    assert not np.any(nothing)


@pytest.mark.parametrize("jammer", CASES, ids=str)
def test_what_passes_a_correlator(jammer: AnyJammer) -> None:
    """Power in a correlator and coherence of two, 30 m apart, over 1500 codes of 1 ms.

    Tolerance: 5 σ of 1500 exponential values (13 %), and the side lobes that sampling folds in (3 %).
    """
    rng = np.random.default_rng(5)
    n, lag_chips = 12_500, 30.0 / SPEED_OF_LIGHT_MPS * 5.115e6
    u = np.arange(n) / FS * 5.115e6
    taps = np.empty((1500, 2), complex)
    for k in range(1500):
        x = np.zeros(n, np.complex64)
        jammer.add(x, power_in_samples(jammer, 1.0, BANDWIDTH, FS), FS, noise_key(2, k, 16))
        chips = 1 - 2 * rng.integers(0, 2, 5200)
        taps[k] = [np.mean(x * chips[np.floor(u - delay + 2).astype(int)]) for delay in (0.0, lag_chips)]
    in_noise = taps * np.sqrt(n)  # white noise of variance 1 a sample has 1 here
    expected = jammer.covariance(E6C, np.array([0.0, lag_chips]), BANDWIDTH)
    assert np.mean(np.abs(in_noise) ** 2) == pytest.approx(expected[0].real, rel=0.16)
    coherence = np.mean(in_noise[:, 1] * in_noise[:, 0].conj()) / np.mean(np.abs(in_noise) ** 2)
    assert coherence == pytest.approx(expected[1] / expected[0], abs=0.15)


def test_rise_of_the_noise_density() -> None:
    """Wideband 1; a line on the carrier B T_c sinc²(0); on the first null of the chips nothing."""
    assert rise(Wideband(), E6C, BANDWIDTH) == pytest.approx(1.0)
    assert rise(Pulsed(), E6C, BANDWIDTH) == pytest.approx(1.0)
    assert rise(ContinuousWave(), E6C, BANDWIDTH) == pytest.approx(4.0)
    assert rise(ContinuousWave(offset_hz=5.115e6), E6C, BANDWIDTH) == pytest.approx(0.0, abs=1e-9)
    assert rise(ContinuousWave(), E1C, BANDWIDTH) < 1.0  # BOC has its null there
    assert rise(Chirp(bandwidth_hz=BANDWIDTH), E6C, BANDWIDTH) == pytest.approx(0.9499, abs=1e-3)  # in-band share


@pytest.mark.parametrize(
    "make",
    [
        lambda: Chirp(sweep_s=0.0),
        lambda: Chirp(bandwidth_hz=-1.0),
        lambda: Pulsed(duty=0.0),
        lambda: Pulsed(duty=2.0),
        lambda: Pulsed(period_s=1.0),
        lambda: Pulsed(duty=1e-4),
    ],
)
def test_what_is_no_waveform(make: Callable[[], AnyJammer]) -> None:
    with pytest.raises(ValueError, match=r"chirp|pulses"):
        make()


def test_phase_and_place_of_a_sweep_know_nothing_of_each_other() -> None:
    """Over 400 epochs, circular correlation of uniform angles: below 5 σ = 5/√400, in both senses."""
    jammer, n = Chirp(bandwidth_hz=2e6), 250
    t_s = (np.arange(n) - n / 2) / FS
    sweep = np.exp(1j * np.pi * 2e6 / 20e-6 * t_s**2)
    places, phases = np.empty(400), np.empty(400)
    for epoch in range(400):
        x = np.zeros(n, np.complex64)
        jammer.add(x, 1.0, FS, noise_key(3, epoch, 16))
        against = np.fft.ifft(np.fft.fft(x) * np.fft.fft(sweep).conj())
        places[epoch] = 2 * np.pi * np.argmax(np.abs(against)) / n
        phases[epoch] = np.angle(against[np.argmax(np.abs(against))])
    for angle in (places, phases, phases - places, phases + places):
        assert np.abs(np.mean(np.exp(1j * angle))) < 0.25


def test_how_far_a_waveform_goes_from_the_carrier() -> None:
    found = [jammer.reach_hz for jammer in (Wideband(), ContinuousWave(offset_hz=-2e6), Chirp(), Pulsed())]
    assert found == [0.0, 2e6, 5e6, 0.0]


@pytest.mark.parametrize("jammer", [Wideband(), ContinuousWave(offset_hz=1.3e6), Chirp(), Pulsed()])
def test_pieces_of_a_waveform_fit_together(jammer: AnyJammer) -> None:
    """As one stretch of a recording follows another; a day later, too."""
    for begin in (0, 12_500_000 * 86_400 + 7):
        whole = np.zeros(60_000, np.complex64)
        jammer.add(whole, 2.0, FS, noise_key(4, 0, 16), begin)
        parts = np.zeros(60_000, np.complex64)
        for first, last in ((0, 1), (1, 20_011), (20_011, 60_000)):
            jammer.add(parts[first:last], 2.0, FS, noise_key(4, 0, 16), begin + first)
        assert parts == pytest.approx(whole, abs=3e-4)  # float64 counts the turns of a day to 1e-4 rad
        assert np.mean(np.abs(whole) ** 2) == pytest.approx(2.0, rel=0.1)
