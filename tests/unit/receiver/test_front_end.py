from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import batch_of, handover_at, random_chips, received_batch, satellite
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.records import Band
from vestige.sample_processor.correlator import correlate
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.synthesis import ReceivedSignal, amplitude, synthesize
from vestige.signals.definitions import E6C
from vestige.signals.pulse import BPSK, band_limited_autocorrelation

FS = 12.5e6
CHIP_RATE = E6C.chip_rate_hz
LOSS_DB = {1: 1.96, 2: 0.55, 3: 0.17}  # Thompson, Emerson, Schwab 2007


def noise(n: int, epoch: int = 0) -> np.ndarray:
    return synthesize((), sample_rate_hz=FS, n_samples=n, noise_key=noise_key(1, epoch, 1))


def e6c(amplitude: float, n_chips: int = 81_840, delay_m: float = 0.0, start_s: float = 1e-4) -> ReceivedSignal:
    return ReceivedSignal(
        chips=random_chips(np.random.default_rng(1), n_chips),
        start_s=start_s,
        doppler_hz=0.0,
        doppler_rate_hz_per_s=0.0,
        delay_m=np.array([delay_m]),
        amplitude=np.array([amplitude + 0j]),
        ray_doppler_hz=np.zeros(1),
    )


def test_noise_has_unit_power_and_no_colour() -> None:
    x = received_batch(Band.E6, [], rate_hz=5e6, duration_s=0.1).samples
    n = x.size
    assert np.mean(np.abs(x) ** 2) == pytest.approx(1.0, abs=5 / np.sqrt(n))
    assert abs(np.mean(x[1:] * x[:-1].conj())) < 5 / np.sqrt(n)
    assert abs(np.mean(x**2)) < 6 / np.sqrt(n)  # circular


def test_power_of_the_components() -> None:
    """E6-B and E6-C of 67 dBHz each at 5 MHz add two unit powers to the noise."""
    cn0 = 10 * np.log10(5e6)
    x = received_batch(Band.E6, [satellite(5, 2.4e7, 10.0, cn0, cn0)], rate_hz=5e6, duration_s=0.02).samples
    assert np.mean(np.abs(x) ** 2) == pytest.approx(3.0, abs=0.1)


def test_same_seed_same_bits() -> None:
    sky = [satellite(5, 2.4e7, 10.0, 45.0, 45.0)]
    a, b, c = (received_batch(Band.E1, sky, duration_s=0.01, seed=seed).samples for seed in (1, 1, 2))
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)


@pytest.mark.parametrize("agc", [True, False])
def test_without_filter_and_quantiser_nothing_happens(agc: bool) -> None:
    x = 3 * noise(1000)
    before = x.copy()
    y, status = FrontEnd(sample_rate_hz=FS, agc=agc).process(x)
    assert np.array_equal(x, before)
    assert np.array_equal(y, before)
    assert status.agc_gain_db == 0.0
    assert not status.saturated
    assert status.total_power_db == pytest.approx(10 * np.log10(np.mean(np.abs(before) ** 2)), abs=1e-4)
    assert FrontEnd(sample_rate_hz=FS).input_samples(1000) == 1000


@given(
    n=st.integers(1, 12_000),
    bandwidth_hz=st.sampled_from([2e6, 8e6, 12e6]),
    oversampling=st.integers(1, 3),
    seed=st.integers(0, 9),
)
def test_filter_is_the_convolution_without_its_delay(n: int, bandwidth_hz: float, oversampling: int, seed: int) -> None:
    front_end = FrontEnd(sample_rate_hz=FS, bandwidth_hz=bandwidth_hz, oversampling=oversampling)
    x = noise(front_end.input_samples(n), seed)
    taps, margin = front_end.filter_taps(), front_end.margin_samples
    assert taps.size == 2 * margin + 1
    assert np.array_equal(taps, taps[::-1])
    y, _ = front_end.process(x)
    expected = np.convolve(x.astype(complex), taps.astype(float), "same" if x.size >= taps.size else "full")
    assert y.dtype == np.complex64
    assert y.shape == (n,)
    assert y == pytest.approx(expected[margin : x.size - margin : oversampling], abs=1e-5)


def test_filter_passes_its_band_and_stops_the_rest() -> None:
    """A tone keeps its phase; in the pass band it grows by √(f/B), in the stop band it is 60 dB down; edge at −6 dB."""
    front_end = FrontEnd(sample_rate_hz=FS, bandwidth_hz=8e6)  # edges of 0.8 MHz around ±4 MHz
    n, margin = 2000, front_end.margin_samples
    time_s = (np.arange(front_end.input_samples(n)) - margin) / FS
    for tone_hz, level in ((0.0, 1.0), (-3.5e6, 1.0), (4e6, 0.5), (4.5e6, 0.0), (-6e6, 0.0)):
        y, _ = front_end.process(np.exp(2j * np.pi * tone_hz * time_s).astype(np.complex64))
        ratio = y / np.exp(2j * np.pi * tone_hz * time_s[margin : margin + n]) / np.sqrt(FS / 8e6)
        assert ratio == pytest.approx(np.full(n, level), abs=0.015 if level else 2e-3)


def test_noise_keeps_its_variance() -> None:
    front_end = FrontEnd(sample_rate_hz=5e6, bandwidth_hz=4e6, oversampling=5)
    y, status = front_end.process(noise(front_end.input_samples(200_000)))
    assert np.mean(np.abs(y) ** 2) == pytest.approx(1.0, abs=5 * np.sqrt(1.25 / 200_000))
    assert abs(status.total_power_db) < 0.06


def test_band_limit_rounds_the_correlation() -> None:
    """What the pulse's spectrum says passes 8 MHz, at the peak and half a chip off; sampled at 12.5 of 37.5 MHz."""
    front_end = FrontEnd(sample_rate_hz=FS, bandwidth_hz=8e6, oversampling=3, transition_hz=0.2e6)
    signal = e6c(1.0, 81_840)
    x = synthesize(
        (signal,),
        sample_rate_hz=front_end.input_rate_hz,
        n_samples=front_end.input_samples(int(0.0163 * FS)),
        noise_key=None,
        first_sample=-front_end.margin_samples,
    )
    y, _ = front_end.process(x)
    half_chip_m = SPEED_OF_LIGHT_MPS / CHIP_RATE / 2
    bank = correlate(batch_of(y, FS), handover_at(signal.chips, 1e-4), np.array([-half_chip_m, 0, half_chip_m]))
    assert bank is not None
    expected = band_limited_autocorrelation(
        BPSK, np.array([-0.5, 0.0, 0.5]), chip_rate_hz=CHIP_RATE, bandwidth_hz=8e6
    ) * np.sqrt(3 * FS / 8e6)
    assert bank.taps.real == pytest.approx(expected, abs=5 * expected[1] / np.sqrt(81_840))


@pytest.mark.parametrize("bits", [1, 2, 3, 8])
def test_quantised_noise(bits: int) -> None:
    """Levels, and the loss (E xq)² / (E x² E q²) of a million numbers: 5 standard errors are 0.01 dB."""
    x = noise(500_000, bits)
    y, status = FrontEnd(sample_rate_hz=FS, bits=bits).process(x)
    levels = np.unique(y.view(np.float32))
    if bits < 8:
        assert levels.tolist() == list(range(1 - 2**bits, 2**bits, 2))
    else:
        assert np.std(y.real) == pytest.approx(16.0, rel=0.01)
        assert np.array_equal(levels, np.rint(levels))
        assert np.max(np.abs(levels)) <= 127
    loss_db = -20 * np.log10(np.corrcoef(x.view(np.float32), y.view(np.float32))[0, 1])
    assert loss_db == pytest.approx(LOSS_DB.get(bits, 0.002), abs=0.012)
    assert not status.saturated


@pytest.mark.parametrize("bits", [1, 2, 3, 8])
def test_a_weak_signal_loses_as_much(bits: int) -> None:
    """C/N0 of 55 dBHz over 16 ms, mean of 6 epochs before and behind the quantiser: good to 0.1 dB."""
    signal = e6c(amplitude(55.0, FS))
    change_db = []
    for epoch in range(6):
        key = noise_key(2, epoch, bits)
        x = synthesize((signal,), sample_rate_hz=FS, n_samples=205_000, noise_key=key)
        y, _ = FrontEnd(sample_rate_hz=FS, bits=bits).process(x)
        before, behind = (correlate(batch_of(z, FS), handover_at(signal.chips, 1e-4), np.zeros(1)) for z in (x, y))
        assert before is not None
        assert behind is not None
        ratios = [abs(bank.taps[0]) ** 2 / bank.noise_power for bank in (before, behind)]
        change_db.append(10 * np.log10(ratios[0] / ratios[1]))
    assert np.mean(change_db) == pytest.approx(LOSS_DB.get(bits, 0.0), abs=0.1)


@pytest.mark.parametrize("bits", [2, 3, 8])
def test_gain_control_follows_the_power(bits: int) -> None:
    x = noise(50_000)
    front_end = FrontEnd(sample_rate_hz=FS, bits=bits)
    quiet, _ = front_end.process(x)
    loud, status = front_end.process(4 * x)
    assert np.array_equal(loud, quiet)  # a power of two: not even rounding differs
    measured_db = 10 * np.log10(16 * np.mean(np.abs(x) ** 2))
    assert status.total_power_db == pytest.approx(measured_db, abs=1e-4)
    assert status.agc_gain_db == pytest.approx(-measured_db, abs=1e-4)
    assert not status.saturated


@pytest.mark.parametrize(("bits", "rise_db"), [(2, 6.0), (3, 6.0), (8, 20.0)])
def test_fixed_gain_saturates(bits: int, rise_db: float) -> None:
    x = noise(50_000)
    front_end = FrontEnd(sample_rate_hz=FS, bits=bits, agc=False)
    calm = front_end.process(x)[1]
    assert (calm.agc_gain_db, calm.saturated) == (0.0, False)
    jammed = front_end.process((10 ** (rise_db / 20) * x).astype(np.complex64))[1]
    assert (jammed.agc_gain_db, jammed.saturated) == (0.0, True)
    assert jammed.total_power_db == pytest.approx(rise_db, abs=0.1)


def test_silence() -> None:
    y, status = FrontEnd(sample_rate_hz=FS, bits=8).process(np.zeros(10, np.complex64))
    assert not y.any()
    assert status.total_power_db == -np.inf
    assert not status.saturated


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        ({"bits": 4}, "bits"),
        ({"bandwidth_hz": 12.5e6}, "bandwidth"),
        ({"bandwidth_hz": 0.0}, "bandwidth"),
        ({"oversampling": 2}, "filter"),
        ({"oversampling": 0, "bandwidth_hz": 1e6}, "bandwidth"),
        ({"bandwidth_hz": 1e6, "transition_hz": 0.0}, "transition"),
    ],
)
def test_front_ends_that_cannot_be(arguments: dict[str, float], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        FrontEnd(sample_rate_hz=FS, **arguments)


def test_too_few_samples_for_the_filter() -> None:
    with pytest.raises(ValueError, match="fewer"):
        FrontEnd(sample_rate_hz=FS, bandwidth_hz=1e6).process(noise(10))
