from __future__ import annotations

import numpy as np
import pytest

from builders import START, random_chips
from search_builder import arrival, e6_source
from vestige.constants import E6_CARRIER_HZ
from vestige.sample_processor.correlator import correlate
from vestige.sample_processor.search import handover_search
from vestige.sample_processor.search.half_chip_kernel import chip_sums, half_chip_sums
from vestige.sample_processor.search.handover_search import CandidateEpochs, handover_positions, search_handover
from vestige.sample_processor.search.peak import shortened
from vestige.sample_processor.search.sample_source import BatchSource

CHIPS = random_chips(np.random.default_rng(5), 81_840)
DOPPLER_HZ, DOPPLER_RATE = 2345.6, -0.6
CHIP_S = 1 / 5.115e6
THRESHOLD = 6.0


def line(start_s: float, period_s: float = 4e-3, **options: float) -> CandidateEpochs:
    return CandidateEpochs(
        svid=11,
        chips=CHIPS,
        anchor=START + start_s,
        period_s=period_s,
        doppler_hz=DOPPLER_HZ,
        doppler_rate_hz_per_s=DOPPLER_RATE,
    )


def received_periods(n: float) -> float:
    """Return the time that n code periods of 4 ms of the satellite take at the receiver."""
    chips, t = n * 20_460, n * 4e-3
    for _ in range(5):
        f = DOPPLER_HZ * t + 0.5 * DOPPLER_RATE * t**2
        t = chips / 5.115e6 - f / E6_CARRIER_HZ
    return t


@pytest.mark.parametrize("center_hz", [1278.75e6, 1277.0e6])
def test_every_hypothesis_is_the_correlator_at_its_place(center_hz: float) -> None:
    """Against the correlator bank at the same moments; the noise floor is summed over shifted chips there."""
    source = e6_source([arrival(CHIPS, 0.0201, 45.0, DOPPLER_HZ, DOPPLER_RATE)], 0.06, 3, center_hz)
    one = line(0.0203)
    places = handover_positions(source, one, START, START + 1)
    assert places[0] == -5
    squares = np.concatenate([found for _, found in handover_search._squares(source, one, places, 5)])
    assert squares.shape == (places.size, 5)
    for row, tap in [(0, 0), (2, 1), (5, 2), (places.size - 1, 3), (places.size - 1, 4)]:
        handover = handover_search._handover(source, one, int(places[row]), tap - 2)
        bank = correlate(source.batch, handover, np.zeros(1))
        assert bank is not None
        expected = np.abs(bank.taps[0]) / np.sqrt(bank.noise_power / 2)
        assert np.sqrt(squares[row, tap]) == pytest.approx(expected, rel=1e-2, abs=0.02)


def test_two_signals_the_earlier_is_first() -> None:
    """Nine periods apart, the later one stronger, half a chip beside E1's word."""
    later_s = received_periods(9)
    signals = [
        arrival(CHIPS, 0.01 + 0.4 * CHIP_S, 40.0, DOPPLER_HZ, DOPPLER_RATE),
        arrival(CHIPS, 0.01 + later_s - 0.4 * CHIP_S, 46.0, DOPPLER_HZ + DOPPLER_RATE * later_s, DOPPLER_RATE, 1.0),
    ]
    source = e6_source(signals, 0.12, 1)
    true, copy = search_handover(source, line(0.01), START, START + 1, THRESHOLD)
    assert true.start_time - START == pytest.approx(0.01 + 0.4 * CHIP_S, abs=0.1 * CHIP_S)
    assert copy.start_time - START == pytest.approx(0.01 + later_s - 0.4 * CHIP_S, abs=0.1 * CHIP_S)
    assert true.cn0_dbhz == pytest.approx(40.0, abs=1.5)  # 1σ 0.6 dB at 16 ms
    assert copy.cn0_dbhz == pytest.approx(46.0, abs=1.0)
    assert true.doppler_hz == pytest.approx(DOPPLER_HZ, abs=0.1)


def test_a_line_holds_far_from_its_anchor() -> None:
    """20 s later the received period, and a Doppler that changes, have moved a place by 186 chips."""
    away_s = received_periods(5000)
    assert abs(away_s - 20) * 5.115e6 > 180
    doppler_hz = DOPPLER_HZ + DOPPLER_RATE * away_s
    source = e6_source([arrival(CHIPS, 0.01, 40.0, doppler_hz, DOPPLER_RATE)], 0.03, 1)
    (peak,) = search_handover(source, line(0.01 - away_s), START, START + 1, THRESHOLD)
    assert peak.start_time - START == pytest.approx(0.01, abs=0.1 * CHIP_S)
    assert peak.doppler_hz == pytest.approx(doppler_hz, abs=0.01)
    assert peak.cn0_dbhz == pytest.approx(40.0, abs=1.5)


def test_a_place_is_where_the_received_code_has_come_to_it() -> None:
    """Half a chip of 20 s is the Doppler's change; 1e-3 chip is asked for."""
    source = e6_source([], 0.03, 1)
    for place in (-5000, 7, 5000):
        handover = handover_search._handover(source, line(0.0), place, 0)
        assert handover.start_time - START == pytest.approx(received_periods(place), abs=1e-3 * CHIP_S)


def test_the_time_uncertainty_bounds_the_places() -> None:
    source = e6_source([], 0.3, 1)
    every = handover_positions(source, line(0.1), START, START + 1)
    assert every[0] == -25
    assert every[-1] == 46  # the last that holds 16 ms: 0.1 + 46 · 4 ms + 16 ms = 0.3 s, less 0.4 µs of Doppler
    assert handover_positions(source, line(0.1), START + 0.0999, START + 0.1081).tolist() == [0, 1, 2]
    assert handover_positions(source, line(0.1), START + 0.101, START + 0.103).size == 0
    assert handover_positions(source, line(0.1, 0.1), START, START + 1).tolist() == [-1, 0, 1]
    assert search_handover(source, line(0.1), START + 0.101, START + 0.103, THRESHOLD) == ()


def test_with_the_secondary_code_phase_only_every_100_ms_is_tested() -> None:
    signals = [arrival(CHIPS, 0.02 + received_periods(k), 44.0, DOPPLER_HZ, DOPPLER_RATE) for k in (0, 12, 25)]
    source = e6_source(signals, 0.16, 2)
    seen: list[float] = []
    found = search_handover(
        source, line(0.02, 0.1), START, START + 1, THRESHOLD, trace=lambda time, _: seen.append(time - START)
    )
    assert [one.start_time - START for one in found] == pytest.approx([0.02, 0.02 + received_periods(25)], abs=CHIP_S)
    assert seen == pytest.approx([0.02, 0.02 + received_periods(25)], abs=CHIP_S)


def test_a_shorter_segment_is_as_many_rows() -> None:
    chips = shortened(CHIPS, 20_460)
    source = e6_source([arrival(chips, 0.02, 50.0, DOPPLER_HZ, DOPPLER_RATE)], 0.03, 2)
    one = CandidateEpochs(svid=3, chips=chips, anchor=START + 0.02, period_s=4e-3, doppler_hz=DOPPLER_HZ)
    (peak,) = search_handover(source, one, START, START + 1, THRESHOLD, taps=1)
    assert peak.start_time - START == pytest.approx(0.02, abs=0.1 * CHIP_S)


def test_what_cannot_be_asked() -> None:
    source = e6_source([], 0.03, 1)
    with pytest.raises(ValueError, match="odd"):
        search_handover(source, line(0.01), START, START + 1, THRESHOLD, taps=4)
    with pytest.raises(ValueError, match="4 ms"):
        line(0.01, 0.005)
    with pytest.raises(ValueError, match="not all in the batch"):
        BatchSource(source.batch).read(0, 10)


@pytest.mark.parametrize("rate_hz", [10e6, 25e6])
def test_half_chips_are_the_sums_of_their_samples(rate_hz: float) -> None:
    """A plain loop in float64, from before the first to behind the last half chip; one sample or several in each."""
    rng = np.random.default_rng(1)
    n, rate, fd, t0 = round(rate_hz * 5e-4), 5.115e6 * 1.01, 31_234.5, -37e-6
    x = (rng.standard_normal((n, 2)) @ [1, 1j]).astype(np.complex64)
    re, im = np.empty(3001, np.float32), np.empty(3001, np.float32)
    half_chip_sums(x.view(np.float32), t0, 1 / rate_hz, rate, 0.0, fd, 0.0, 77, re, im)
    t = t0 + np.arange(n) / rate_hz
    half = np.floor(2 * rate * t).astype(int) - 77
    y = x * np.exp(-2j * np.pi * fd * t)
    expected = np.zeros(3001, complex)
    inside = (half >= 0) & (half < 3001)
    np.add.at(expected, half[inside], y[inside])
    np.testing.assert_allclose(re + 1j * im, expected, atol=2e-5)
    even, odd = np.empty(1500, np.float32), np.empty(1500, np.float32)
    power = chip_sums(re, even, odd)
    np.testing.assert_array_equal(even, re[:-1:2] + re[1::2])
    np.testing.assert_array_equal(odd, re[1::2] + re[2::2])
    assert power == pytest.approx(np.sum(even.astype(float) ** 2), rel=1e-6)
