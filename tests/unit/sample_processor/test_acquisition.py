from __future__ import annotations

import numpy as np
import pytest

from builders import batch_of, received_batch, satellite
from vestige.constants import E1_CARRIER_HZ, E1_CODE_PERIOD_S, SPEED_OF_LIGHT_MPS
from vestige.records import Band
from vestige.sample_processor.acquisition import acquire

SKY = {3: (2.4e7, -700.0, 44.0), 11: (2.55e7, 0.0, 40.0), 30: (2.32e7, 600.0, 36.0)}


@pytest.mark.parametrize("rate_hz", [4.5e6, *(pytest.param(rate, marks=pytest.mark.slow) for rate in (6.0e6, 10.3e6))])
def test_finds_who_is_there_where_it_is(rate_hz: float) -> None:
    sky = [satellite(svid, *values, e6_dbhz=40.0) for svid, values in SKY.items()]
    batch = received_batch(Band.E1, sky, rate_hz=rate_hz, duration_s=0.06)
    found = {one.svid: one for one in acquire(batch, [1, 3, 7, 11, 24, 30, 36])}
    assert found.keys() == SKY.keys()
    for svid, (range_m, rate_mps, cn0_dbhz) in SKY.items():
        expected_s = (range_m / SPEED_OF_LIGHT_MPS) % E1_CODE_PERIOD_S
        error_chips = ((found[svid].code_start_s - expected_s + 2e-3) % 4e-3 - 2e-3) * 1.023e6
        assert abs(error_chips) < 0.25
        assert found[svid].doppler_hz == pytest.approx(-rate_mps / SPEED_OF_LIGHT_MPS * E1_CARRIER_HZ, abs=63)
        assert -5.0 < found[svid].cn0_dbhz - cn0_dbhz < 1.0
        assert found[svid].statistic > found[svid].threshold


@pytest.mark.slow
def test_false_alarm_rate_of_the_threshold() -> None:
    """At an overall P_FA of 0.5 a search of noise alarms half of the time.

    The cells oversample the correlation function, so they are correlated and the true rate lies below: two-sided
    binomial limits at 1e-6 for 120 trials, between 0.5 · 1/3 (three dependent cells count as one) and 0.5.
    """
    alarms = 0
    for seed in range(120):
        rng = np.random.default_rng(1000 + seed)
        batch = batch_of(rng.standard_normal((48_100, 2)) @ [1, 1j], 4.0e6, Band.E1)
        alarms += bool(acquire(batch, [1 + seed % 36], overall_pfa=0.5, doppler_span_hz=1000))
    assert 8 <= alarms <= 86


def test_progress_and_nothing_to_do() -> None:
    batch = batch_of(np.ones(40_000), 4.0e6, Band.E1)
    seen: list[tuple[int, int]] = []
    acquire(batch, [5, 6], progress=lambda done, total: seen.append((done, total)))
    assert seen == [(1, 2), (2, 2)]
    assert acquire(batch, []) == ()
    assert acquire(batch_of(np.ones(100), 4.0e6, Band.E1), [1]) == ()
