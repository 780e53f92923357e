"""The searches against theory: P_d at the paper's C/N0s with the losses of the grid, false alarms against Poisson.

The paper's theory has the signal on a grid point (P_d 0.90). Here it lies anywhere between the points. What is expected
then follows from the cells around it, drawn in the correlator domain: means A · Tri · sinc, noise with the same
correlations. Two-sided limits at 1e-4 for each test; fixed seeds.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import bdtr, pdtr

from builders import START, random_chips
from search_builder import arrival, e6_source
from vestige.sample_processor.search.engines.engine import CHIP_SIGMA, GRIDS
from vestige.sample_processor.search.engines.segment.segment_engine import SegmentEngine
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch
from vestige.sample_processor.search.handover_search import CandidateEpochs, search_handover
from vestige.sample_processor.search.peak import shortened
from vestige.theory.hypotheses import effective_taps
from vestige.theory.screen_loss import pass_threshold, screen_loss
from vestige.theory.search_budget import grid_probability_of_detection
from vestige.theory.thresholds import probability_of_detection, single_event_pfa, threshold

CHIP_S = 1 / 5.115e6
TRIALS = 200
TRIALS_OF_SCREEN = {4: 4000, 16: 1000}
ERROR = 1e-4


def _expected(cn0_dbhz: float, integration_s: float, pfa: float, bins: bool) -> float:
    """Return P_d of the strongest of the cells around a signal: 5 code offsets by 5 bins, or 5 code offsets."""
    rng = np.random.default_rng(123)
    draws = 40_000
    strength = np.sqrt(2 * 10 ** (cn0_dbhz / 10) * integration_s)
    code = np.arange(-2, 3) / 2
    bin_cycles = np.arange(-2, 3) / 2 if bins else np.zeros(1)
    off_chips = rng.uniform(-0.25, 0.25, (draws, 1)) - code
    off_cycles = rng.uniform(-0.25, 0.25, (draws, 1)) * (1.0 if bins else 0.0) - bin_cycles
    mean = (
        strength
        * np.maximum(1 - np.abs(off_chips), 0)[:, :, None]
        * (np.sinc(off_cycles) * np.exp(1j * np.pi * off_cycles))[:, None, :]
    )
    code_noise = np.linalg.cholesky(np.maximum(1 - np.abs(code[:, None] - code), 0) + 1e-12 * np.eye(5))
    apart = bin_cycles[:, None] - bin_cycles
    bin_noise = np.linalg.cholesky(np.sinc(apart) * np.exp(-1j * np.pi * apart) + 1e-9 * np.eye(bin_cycles.size))
    white = rng.standard_normal((draws, 5, bin_cycles.size, 2)) @ [1, 1j]
    noise = np.einsum("ij,njk,lk->nil", code_noise, white, bin_noise)
    return float(np.mean(np.max(np.abs(mean + noise), axis=(1, 2)) > threshold(pfa)))


def _expected_screen_loss(cn0_dbhz: float, integration_s: float, pfa: float, segment_chips: int) -> float:
    """Return the share of detections that the screen loses: eight code offsets, of which the screen adds two and two.

    The screen uses the middle three quarters. The carrier is left in within a segment, which weakens the screen, but
    not the exact cell.
    """
    rng = np.random.default_rng(321)
    draws, parts = 20_000, 16
    limit = float(threshold(pfa))
    strength = np.sqrt(2 * 10 ** (cn0_dbhz / 10) * integration_s / parts)
    time, middle = (np.arange(parts) + 0.5) / parts, slice(parts // 8, 7 * parts // 8)
    detected = both = 0

    def strongest(z: np.ndarray, at: np.ndarray, bins: np.ndarray) -> np.ndarray:
        return np.asarray(np.max(np.abs(z @ np.exp(-2j * np.pi * np.outer(at, bins))), axis=2) / np.sqrt(at.size))

    for _ in range(10):  # so many pieces, for the memory
        n = draws // 10
        late = rng.uniform(-0.25, 0.75, (n, 1)) - np.arange(-4, 4) / 2  # the signal is on the first or second of a pair
        mean = strength * np.maximum(1 - np.abs(late), 0)
        halves = rng.standard_normal((n, 9, parts, 2)) @ [1, 1j] * np.sqrt(0.5)
        noise = halves[:, :-1] + halves[:, 1:]
        signal = mean[:, :, None] * np.exp(2j * np.pi * rng.uniform(-0.5, 0.5, (n, 1)) * time)[:, None, :]
        left = np.sinc(rng.uniform(0, 5000.0, n) * segment_chips / 5.115e6)[:, None, None]
        found = strongest(signal + noise, time, np.arange(-4, 5) / 2) > limit
        weak = (left * signal + noise)[:, :, middle]
        joined = (weak[:, ::2] + weak[:, 1::2]) / np.sqrt(3)
        passed = strongest(joined, time[middle], np.arange(-4, 5) * 2 / 3) > pass_threshold(limit)
        detected += np.count_nonzero(found.any(axis=1))
        both += np.count_nonzero((found & np.repeat(passed, 2, axis=1)).any(axis=1))
    return 1 - both / detected


def _within(found: int, trials: int, expected: float) -> bool:
    return bool(bdtr(found, trials, expected) > ERROR / 2 and bdtr(found - 1, trials, expected) < 1 - ERROR / 2)


@pytest.mark.judged(by="theory", what="exhaustive search", figure="P_d of 200 trials, two-sided at 1e-4")
@pytest.mark.parametrize(("ms", "cn0_dbhz"), [(4, 40.12), (8, 37.20), (16, 34.27)])
def test_exhaustive_search_finds_as_often_as_theory_says(ms: int, cn0_dbhz: float) -> None:
    """The threshold is that of 30 s and ±5 kHz; a window of 60 chips is searched around the signal."""
    integration_s = ms * 1e-3
    pfa = float(single_event_pfa(1e-3, 2.4e10 * ms / 4))
    limit = float(threshold(pfa))
    chips = shortened(random_chips(np.random.default_rng(ms), 81_840), 5115 * ms)
    search = ExhaustiveSearch(integration_s=integration_s, workers=1)
    rng = np.random.default_rng(1000 + ms)
    found = 0
    for trial in range(TRIALS):
        start_s, doppler_hz = 5e-6 + rng.uniform(0, 4) * CHIP_S, rng.uniform(-4900, 4900)
        source = e6_source([arrival(chips, start_s, cn0_dbhz, doppler_hz)], integration_s + 12e-6, 7000 + trial)
        *_, state = search.run(source, [chips], START, START + 1, limit)
        for peak in state.peaks:
            assert abs(peak.start_time - START - start_s) < CHIP_S
        found += len(state.peaks)
    assert float(probability_of_detection(cn0_dbhz, integration_s, pfa)) == pytest.approx(0.90, abs=2e-3)
    assert _within(found, TRIALS, _expected(cn0_dbhz, integration_s, pfa, bins=True)), found


@pytest.mark.judged(by="theory", what="hand-over search", figure="P_d at 37.65 dBHz, two-sided at 1e-4")
def test_handover_search_finds_as_often_as_theory_says() -> None:
    """37.65 dBHz, one period of 4 ms, 7500 positions; the code delay is random within half a correlator spacing."""
    pfa = float(single_event_pfa(1e-3, 7500))
    chips = shortened(random_chips(np.random.default_rng(3), 81_840), 20_460)
    rng = np.random.default_rng(77)
    found, trials = 0, 400
    for trial in range(trials):
        start_s, doppler_hz = 20e-6 + rng.uniform(0, 4) * CHIP_S, rng.uniform(-4900, 4900)
        source = e6_source([arrival(chips, start_s, 37.65, doppler_hz)], 4.04e-3, 9000 + trial)
        line = CandidateEpochs(
            svid=11,
            chips=chips,
            anchor=START + (start_s + rng.uniform(-0.25, 0.25) * CHIP_S),
            period_s=4e-3,
            doppler_hz=doppler_hz,
        )
        found += len(search_handover(source, line, START, START + 1, float(threshold(pfa))))
    assert float(probability_of_detection(37.65, 4e-3, pfa)) == pytest.approx(0.90, abs=2e-3)
    assert _within(found, trials, _expected(37.65, 4e-3, pfa, bins=False)), found


@pytest.mark.judged(by="theory", what="screen of the exhaustive search", figure="detections lost, two-sided at 1e-4")
@pytest.mark.parametrize(("ms", "cn0_dbhz", "segment_chips"), [(4, 40.12, 240), (16, 34.27, 320)])
def test_the_screen_loses_as_many_detections_as_theory_says(ms: int, cn0_dbhz: float, segment_chips: int) -> None:
    """Codes with a signal of P_d ½ in chips: where a sum over all is above the threshold, was it screened out?

    16 ms: a third of 960 chips, because a pass is a third of the span.
    """
    n = 5115 * ms
    pfa = float(single_event_pfa(1e-3, 2.4e10 * ms / 4))
    limit = float(threshold(pfa))
    rng = np.random.default_rng(60 + ms)
    code = (1 - 2 * rng.integers(0, 2, (1, n))).astype(np.int8)
    engine = SegmentEngine(code)
    strength = CHIP_SIGMA * np.sqrt(2 * 10 ** (cn0_dbhz / 10) / 5.115e6)
    width = GRIDS[n].half_width_hz
    detected = lost = 0
    for _ in range(TRIALS_OF_SCREEN[ms]):
        late, f = 4 + 2 * rng.uniform(-0.25, 0.75), rng.uniform(-width, width)  # in half chips
        halves = CHIP_SIGMA * np.sqrt(0.5) * rng.standard_normal((2, 2 * n + 10), np.float32)
        carrier = strength * np.exp(2j * np.pi * (f * np.arange(halves.shape[1]) / 10.23e6 + rng.uniform()))
        whole, part = int(late), late % 1
        twice = np.pad(np.repeat(code[0] / 2, 2), (whole, halves.shape[1] - 2 * n - whole))
        signal = ((1 - part) * twice + part * np.roll(twice, 1)) * carrier
        halves += [signal.real, signal.imag]
        sums = halves[:, :-1] + halves[:, 1:]
        chips = np.rint([sums[:, :-1:2], sums[:, 1::2]]).astype(np.int16)
        full = engine.powers(chips, 4) > limit**2 * CHIP_SIGMA**2 * n
        if full.any():
            detected += 1
            lost += not np.any(full & (engine.powers(chips, 4, limit) > 0))
    expected = _expected_screen_loss(cn0_dbhz, ms * 1e-3, pfa, segment_chips)
    alone = screen_loss(cn0_dbhz, ms * 1e-3, pfa, 5000.0 * segment_chips / 5.115e6)
    assert 0.4 * alone < expected < alone  # without the neighbours
    assert _within(lost, detected, expected), (lost, detected, expected)


def test_the_strongest_cell_alone_is_a_lower_bound_close_to_the_search() -> None:
    """The library's average over the grid leaves out the neighbours, which find a few signals in a hundred more."""
    for ms, cn0_dbhz in ((4, 40.12), (16, 34.27)):
        pfa = float(single_event_pfa(1e-3, 2.4e10 * ms / 4))
        alone = grid_probability_of_detection(cn0_dbhz, ms * 1e-3, pfa)
        assert alone < _expected(cn0_dbhz, ms * 1e-3, pfa, bins=True) < alone + 0.12


def test_false_alarms_are_as_many_as_correlated_neighbours_allow() -> None:
    """1 ms, 21 bins, 6.3e6 cells at P_fa 1e-5: Poisson, between the clusters of neighbours and N · P_fa."""
    pfa = 1e-5
    search = ExhaustiveSearch(integration_s=1e-3)
    chips = random_chips(np.random.default_rng(4), 5115)
    alarms, cells = 0, 0.0
    for seed in range(3):
        source = e6_source([], 0.0107, 500 + seed)
        *_, state = search.run(source, [chips], START, START + 1, float(threshold(pfa)))
        alarms += len(state.peaks)
        cells += state.total
    share = (float(effective_taps(pfa, 2, 0.5)) - 1) * (float(effective_taps(pfa, 2, 2 / np.pi)) - 1)
    assert cells == pytest.approx(6.3e6, rel=0.02)
    assert pdtr(alarms, 0.95 * share * cells * pfa) > ERROR / 2
    assert pdtr(alarms - 1, cells * pfa) < 1 - ERROR / 2
