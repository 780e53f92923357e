"""The model of search results against the searches on samples, with one or two signals of a satellite.

The model tests the cell next to a signal, the search all of them: it may find up to 6 in a hundred more (see
`test_search.py`). Two-sided limits at 1e-4 for each test around that band; fixed seeds.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import bdtr

from builders import START, random_chips, received_batch, satellite
from search_builder import arrival, e6_source
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.search_outcome import WINDOW_S, BandSignals, SearchOutcome, outcome, search_draws
from vestige.records import Band
from vestige.sample_processor.search.e1_search import search_e1
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch
from vestige.sample_processor.search.handover_search import CandidateEpochs, search_handover
from vestige.theory.search_budget import search_budget

ERROR = 1e-4
NEIGHBOURS = 0.06
DRAWS = 20_000
MS16 = 16e-3
CELLS = 4 * WINDOW_S * 5.115e6 * 321
P_FA = 1e-3


def _air(cn0_dbhz: float, delay_s: float | None, power_db: float) -> BandSignals:
    there = [1.0, 10 ** (power_db / 20) if delay_s is not None else 0.0]
    return BandSignals(
        amplitude=np.tile(np.array(there, complex), (DRAWS, 1)),
        delay_m=np.tile([0.0, (delay_s or 0.0) * SPEED_OF_LIGHT_MPS], (DRAWS, 1)),
        doppler_hz=np.zeros((DRAWS, 2)),
        cn0_dbhz=np.full(DRAWS, cn0_dbhz),
    )


def _model(e1: BandSignals, e6: BandSignals, periods: int = 24) -> SearchOutcome:
    draws = search_draws(np.random.default_rng(5), DRAWS, 2, periods=periods)
    shift = np.zeros(DRAWS)
    return outcome(
        e1, e6, draws, shift_m=shift, integration_s=MS16, e1_p_fa=P_FA, exhaustive_p_fa=P_FA, periods=periods
    )


def _agrees(found: int, trials: int, model: float) -> bool:
    low, high = max(model - 1e-9, 0.0), min(model + NEIGHBOURS, 1.0)
    not_fewer = bdtr(found, trials, low) > ERROR / 2
    not_more = found == 0 or bdtr(found - 1, trials, high) < 1 - ERROR / 2
    return bool(not_fewer and not_more)


@pytest.mark.judged(
    by="search of samples",
    what="model of the searches in campaigns",
    figure="within 0.06, two-sided at 1e-4",
)
@pytest.mark.parametrize(
    ("delay_s", "power_db", "cn0_dbhz"),
    [
        (0.3e-6, 7.0, 37.0),  # 1.5 chips: what the stronger one has 1¼ chips from the other is more than that has
        (0.3e-6, 0.0, 36.5),
        (1e-6, -6.0, 41.0),
        (10e-6, 0.0, 35.0),
        (0.1e-3, 10.0, 36.0),
        (1e-6, 3.0, 40.2),  # what the noise of a meaconer leaves of 45 dBHz: both are found
        (None, 0.0, 35.0),
    ],
)
def test_exhaustive_search(delay_s: float | None, power_db: float, cn0_dbhz: float) -> None:
    trials = 30
    limit = search_budget(CELLS, MS16, overall_pfa=P_FA).threshold
    chips = random_chips(np.random.default_rng(16), 81_840)
    search = ExhaustiveSearch(integration_s=MS16, workers=1)
    rng = np.random.default_rng(round(1e7 * (delay_s or 0.0)) + 11)
    two = first = 0
    for trial in range(trials):
        start_s, doppler_hz = 5e-6 + rng.uniform(0, 1e-6), rng.uniform(-2400, 2400)
        signals = [arrival(chips, start_s, cn0_dbhz, doppler_hz, phase=rng.uniform(0, 6.28))]
        if delay_s is not None:
            signals.append(arrival(chips, start_s + delay_s, cn0_dbhz + power_db, doppler_hz))
        source = e6_source(signals, MS16 + (delay_s or 0.0) + 12e-6, 500 + trial)
        *_, state = search.run(source, [chips], START, START + 1, limit)
        starts_s = sorted(peak.start_time - START for peak in state.peaks)
        two += len(starts_s) == 2
        first += bool(starts_s) and abs(starts_s[0] - start_s) < 0.1e-6
    found = _model(_air(60.0, None, 0.0), _air(cn0_dbhz, delay_s, power_db))
    single = found.exhaustive_signals == 1
    assert _agrees(two, trials, float(np.mean(found.exhaustive_signals == 2))), two
    if delay_s is None:
        assert _agrees(first, trials, float(np.mean(single))), first
    elif two:
        true_first = (found.exhaustive_signals == 2) & (np.abs(found.exhaustive_error_m) < 30)
        assert abs(float(np.mean(true_first)) - float(np.mean(found.exhaustive_signals == 2))) <= 2 * P_FA


@pytest.mark.parametrize(("power_db", "cn0_dbhz"), [(-6.0, 37.5), (3.0, 31.2), (10.0, 31.2)])
def test_handover_search(power_db: float, cn0_dbhz: float) -> None:
    """E1 has both at 60 dBHz, so all depends on E6: one period of 16 ms at the delays of both, 10 µs apart."""
    delay_s, trials = 10e-6, 60
    chips = random_chips(np.random.default_rng(17), 81_840)
    limit = search_budget(2 * 2 * WINDOW_S / 4e-3 * 5, MS16, overall_pfa=P_FA, doppler_step_hz=0.0).threshold
    rng = np.random.default_rng(18)
    two = 0
    for trial in range(trials):
        start_s, doppler_hz = 20e-6 + rng.uniform(0, 1e-6), rng.uniform(-2400, 2400)
        both = (
            arrival(chips, start_s, cn0_dbhz, doppler_hz, phase=rng.uniform(0, 6.28)),
            arrival(chips, start_s + delay_s, cn0_dbhz + power_db, doppler_hz),
        )
        source = e6_source(list(both), MS16 + 60e-6, 900 + trial)
        peaks = []
        for late_s in (0.0, delay_s):
            anchor = START + (start_s + late_s + rng.normal(0.0, 3.0) / SPEED_OF_LIGHT_MPS)
            line = CandidateEpochs(svid=11, chips=chips, anchor=anchor, period_s=4e-3, doppler_hz=doppler_hz)
            peaks += search_handover(source, line, START, START + 1, limit)
        two += len(peaks) == 2
    e1 = _air(60.0, delay_s, 0.0)
    found = _model(e1, _air(cn0_dbhz, delay_s, power_db))
    assert np.mean(found.e1_signals == 2) > 1 - 3 * P_FA
    # E1 is strong: what is not found in E6 is not there, so what is there is used
    assert np.mean(np.isfinite(found.handover_error_m)) > 0.99
    model = float(np.mean(_both_in_e6(cn0_dbhz, power_db)))
    assert 0.2 < model < 0.99
    assert _agrees(two, trials, model), two


def _both_in_e6(cn0_dbhz: float, power_db: float) -> np.ndarray:
    """Return where the hand-over finds both: with E1 too weak to be sure, its range says so."""
    weak = BandSignals(
        amplitude=np.ones((DRAWS, 2), complex),
        delay_m=np.tile([0.0, 10e-6 * SPEED_OF_LIGHT_MPS], (DRAWS, 1)),
        doppler_hz=np.zeros((DRAWS, 2)),
        cn0_dbhz=np.full(DRAWS, 31.0),
    )
    found = _model(weak, _air(cn0_dbhz, 10e-6, power_db))
    return np.isfinite(found.handover_error_m)[found.e1_signals == 2]


@pytest.mark.parametrize(
    ("delay_s", "power_db", "cn0_dbhz"),
    [
        (1e-6, 3.0, 45.0),  # within two chips: one
        (10e-6, 3.0, 36.8),
        (0.1e-3, -6.0, 42.5),
        (0.1e-3, 14.0, 40.0),  # near the rule of 16 dB
        (2.0 + 1e-5, 3.0, 45.0),  # seconds: the phase modulo 4 ms
    ],
)
def test_search_of_e1(delay_s: float, power_db: float, cn0_dbhz: float) -> None:
    periods, trials = 2, 20
    rng = np.random.default_rng(round(1e6 * delay_s))
    two = 0
    for trial in range(trials):
        range_m, rate_mps = 2.4e7 + rng.uniform(0, 300.0), rng.uniform(-400, 400)
        sky = [
            satellite(11, range_m, rate_mps, cn0_dbhz, 40.0),
            satellite(11, range_m + delay_s * SPEED_OF_LIGHT_MPS, rate_mps, cn0_dbhz + power_db, 40.0),
        ]
        batch = received_batch(Band.E1, sky, rate_hz=4.5e6, duration_s=0.0125, seed=300 + trial)
        two += len(search_e1(batch, [11], periods=periods, overall_pfa=P_FA)) == 2
    found = _model(_air(cn0_dbhz, delay_s, power_db), _air(60.0, None, 0.0), periods)
    assert _agrees(two, trials, float(np.mean(found.e1_signals == 2))), two
