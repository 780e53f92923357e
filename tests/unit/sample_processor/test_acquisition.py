from __future__ import annotations

import numpy as np
import pytest

from builders import batch_of, received_batch, satellite
from vestige.constants import E1_CARRIER_HZ, E1_CODE_PERIOD_S, SPEED_OF_LIGHT_MPS
from vestige.records import Band
from vestige.sample_processor.acquisition import CellPowers, acquire, search_cells
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1B, E1C, SignalDefinition

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


@pytest.mark.parametrize("signals", [(E1C,), (E1C, E1B)])
@pytest.mark.parametrize("periods", [1, 3, 5])
def test_cell_powers_are_those_of_one_transform_at_a_time(signals: tuple[SignalDefinition, ...], periods: int) -> None:
    """Cells at 500, 0 and −875 Hz in float64; 5 periods are short enough for no code Doppler."""
    rng, rate_hz = np.random.default_rng(4), 4e6
    x = rng.standard_normal((16_000 * (periods + 1), 2)) @ [1, 1j]
    cells: list[CellPowers] = []
    search_cells(
        batch_of(x, rate_hz, Band.E1),
        (11,),
        lambda powers: cells.append(powers) or (),
        signals=signals,
        max_stretches=periods,
        overall_pfa=0.1,
        doppler_span_hz=1000.0,
    )
    (found,) = cells
    assert found.powers.shape == (17, 16_000)
    half_chips = np.arange(16_000) * 2046 // 4000
    for doppler_hz in (500.0, 0.0, -875.0):
        turned = batch_of(x, rate_hz, Band.E1).samples * np.exp(-2j * np.pi * doppler_hz * np.arange(x.size) / rate_hz)
        power = np.zeros(16_000)
        for signal in signals:
            chips = primary_code(signal, 11)[half_chips // 2] * (1 - 2 * (half_chips % 2))
            replica = np.conj(np.fft.fft(chips, 32_000))
            for first in range(0, 16_000 * periods, 16_000):
                y = np.fft.ifft(np.fft.fft(turned[first : first + 32_000]) * replica)[:16_000]
                power += np.abs(y) ** 2
        power *= 2 * found.n_added / np.mean(power)
        row = int(np.flatnonzero(found.doppler_hz == doppler_hz)[0])
        np.testing.assert_allclose(found.powers[row], power, atol=1e-4 * power.max())


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
