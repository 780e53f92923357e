from __future__ import annotations

import numpy as np
import pytest

from builders import batch_of, handover_at, random_chips
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.samples.staircase import commensurate_tread_m
from vestige.sample_processor.correlator import correlate
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.synthesis import ReceivedSignal, synthesize
from vestige.signals.definitions import E6C

CHIP_RATE = E6C.chip_rate_hz


def e6c(delay_m: float = 0.0, start_s: float = 0.0) -> ReceivedSignal:
    return ReceivedSignal(
        chips=random_chips(np.random.default_rng(1), 20_460),
        start_s=start_s,
        doppler_hz=0.0,
        doppler_rate_hz_per_s=0.0,
        delay_m=np.array([delay_m]),
        amplitude=np.array([1.0 + 0j]),
        ray_doppler_hz=np.zeros(1),
    )


@pytest.mark.parametrize(
    ("rate_hz", "p", "good_hz"),
    [(5.115e6, 1, 5.2e6), (10.23e6, 2, 10.3e6), (20.46e6, 4, 20.5e6), (7.6725e6, 3, 7.7e6), (15.345e6, 3, 15.4e6)],
)
def test_commensurate_rates(rate_hz: float, p: int, good_hz: float) -> None:
    stairs = commensurate_tread_m(rate_hz, CHIP_RATE)
    assert stairs is not None
    assert stairs.tread_m == pytest.approx(58.6105 / p, rel=1e-5)
    assert stairs.good_rate_hz == good_hz
    assert commensurate_tread_m(good_hz, CHIP_RATE) is None
    assert commensurate_tread_m(rate_hz + 0.9e-3 * CHIP_RATE, CHIP_RATE) is not None


@pytest.mark.parametrize("rate_hz", [8.192e6, 10.24e6, 10.3e6, 12.5e6, 20.5e6, 25e6])
def test_good_rates(rate_hz: float) -> None:
    assert commensurate_tread_m(rate_hz, CHIP_RATE) is None


@pytest.mark.parametrize(("rate_hz", "same"), [(10.23e6, True), (10.3e6, False)])
def test_within_a_tread_all_delays_are_one(rate_hz: float, same: bool) -> None:
    """5 m and 25 m lie on one tread of 29.3 m: at 10.23 MHz the samples are equal, and so is all that follows."""
    a, b = (synthesize((e6c(delay_m=d),), sample_rate_hz=rate_hz, n_samples=5000, noise_key=None) for d in (5.0, 25.0))
    assert np.array_equal(a, b) is same


def test_below_the_chip_rate() -> None:
    stairs = commensurate_tread_m(CHIP_RATE / 2, CHIP_RATE)
    assert stairs is not None
    assert stairs.tread_m == pytest.approx(58.6105, rel=1e-5)


@pytest.mark.parametrize(("rate_hz", "pairs"), [(10.23e6, True), (10.3e6, False)])
def test_a_filter_does_not_help(rate_hz: float, pairs: bool) -> None:
    """Sampled five times as fast, limited to 9 MHz, correlated at twice the chip rate: taps on one tread are equal."""
    front_end = FrontEnd(sample_rate_hz=rate_hz, bandwidth_hz=9e6, oversampling=5)
    start_s = 1e-4
    x = synthesize(
        (e6c(start_s=start_s),),
        sample_rate_hz=front_end.input_rate_hz,
        n_samples=front_end.input_samples(int(4.3e-3 * rate_hz)),
        noise_key=noise_key(1, 0, 6),
        first_sample=-front_end.margin_samples,
    )
    samples, _ = front_end.process(x)
    bank = correlate(batch_of(samples, rate_hz), handover_at(e6c().chips, start_s), np.array([5.0, 25.0]))
    assert bank is not None
    assert bool(abs(bank.taps[0] - bank.taps[1]) < 1e-9 * abs(bank.taps[0])) is pairs
