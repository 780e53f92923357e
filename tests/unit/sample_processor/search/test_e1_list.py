from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from builders import received_batch, satellite
from vestige.constants import E1_CARRIER_HZ, E1_CODE_PERIOD_S, SPEED_OF_LIGHT_MPS
from vestige.records import Band, SampleBatch
from vestige.sample_processor.search.e1_list import E1Signal, list_e1

RATE_HZ = 4e6
RANGES_M = {11: 2.4e7, 12: 2.45e7}
RATES_MPS = {11: -300.0, 12: 410.0}
CN0_DBHZ = {11: 45.0, 12: 42.0}


def received(duration_s: float = 0.1, *, delay_m: float | None = None) -> SampleBatch:
    sky = [satellite(svid, RANGES_M[svid], RATES_MPS[svid], CN0_DBHZ[svid], 40.0) for svid in RANGES_M]
    if delay_m is not None:
        sky.append(satellite(11, RANGES_M[11] + delay_m, RATES_MPS[11], CN0_DBHZ[11] - 4, 40.0))
    return received_batch(Band.E1, sky, rate_hz=RATE_HZ, duration_s=duration_s)


def error_s(one: E1Signal, at_s: float = 0.0, delay_m: float = 0.0) -> float:
    """Return how much later a code period starts than it should, at a time after the reference of the range."""
    range_m = RANGES_M[one.svid] + RATES_MPS[one.svid] * at_s + delay_m
    expected_s = range_m / SPEED_OF_LIGHT_MPS - at_s
    half = E1_CODE_PERIOD_S / 2
    return (one.code_start_s - expected_s + half) % E1_CODE_PERIOD_S - half


def test_values_are_measured_at_the_first_sample() -> None:
    batch = received()
    found = list_e1(batch, (9, 11, 12))
    assert [one.svid for one in found.signals] == [11, 12]
    assert (found.batch.start, found.jumps) == (batch.start, ())
    for one in found.signals:
        assert one.is_measured
        assert abs(error_s(one)) < 30e-9  # the grid has 125 ns
        assert one.doppler_hz == pytest.approx(-RATES_MPS[one.svid] / SPEED_OF_LIGHT_MPS * E1_CARRIER_HZ, abs=2)
        assert one.cn0_dbhz == pytest.approx(CN0_DBHZ[one.svid], abs=1.2)


def test_all_signals_are_of_one_side_of_a_gap() -> None:
    """360 samples, 90 µs, are missing 24 ms after the first: all signals are those of the longer part, behind it."""
    batch = received()
    cut = replace(batch, samples=np.delete(batch.samples, np.arange(96_000, 96_360)))
    found = list_e1(cut, (11, 12))
    assert {one.svid for one in found.jumps} >= {11}
    assert all(jump.by_s == pytest.approx(-90e-6, abs=0.5e-6) for jump in found.jumps)
    at_s = (found.batch.start - batch.start) + 90e-6
    assert at_s > 0.024
    assert [one.svid for one in found.signals] == [11, 12]
    for one in found.signals:
        assert one.is_measured
        assert abs(error_s(one, at_s)) < 50e-9


def test_two_signals_of_a_satellite_stay_apart() -> None:
    delay_m = 5 * 293.05  # chips
    first, second, other = list_e1(received(delay_m=delay_m), (11, 12)).signals
    assert (first.svid, second.svid, other.svid) == (11, 11, 12)
    assert abs(error_s(first)) < 50e-9
    assert abs(error_s(second, delay_m=delay_m)) < 50e-9
    assert first.cn0_dbhz - second.cn0_dbhz == pytest.approx(4.0, abs=1.5)


def test_short_samples_give_what_the_search_has() -> None:
    (one, _) = list_e1(received(0.04), (11, 12)).signals
    assert not one.is_measured
    assert one.code_start_s == one.found.code_start_s
    assert abs(error_s(one)) < 300e-9
