from __future__ import annotations

from concurrent.futures import Future
from typing import Literal

import numpy as np
import pytest

from builders import START, handover_at, random_chips
from search_builder import arrival, e6_source
from vestige.sample_processor.correlator import correlate
from vestige.sample_processor.search import exhaustive_search
from vestige.sample_processor.search.engines.choice import make_engine
from vestige.sample_processor.search.engines.engine import CHIP_RATE_HZ, GRIDS
from vestige.sample_processor.search.exact_cell import Cell, doppler_spectrum, wiped_chips
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch, searchable
from vestige.sample_processor.search.peak import Peak, separated, shortened
from vestige.sample_processor.search.sample_source import BatchSource

CHIPS = random_chips(np.random.default_rng(8), 81_840)
OTHER = random_chips(np.random.default_rng(9), 81_840, svid=25)
CHIP_S = 1 / CHIP_RATE_HZ


def _all(search: ExhaustiveSearch, source: BatchSource, codes: list, threshold: float = 7.3) -> tuple[Peak, ...]:
    *_, last = search.run(source, codes, START, START + 1, threshold)
    assert last.done == last.total
    return last.peaks


# C/N0 that leaves 12 σ after all grid losses; both edges of the band
@pytest.mark.parametrize(
    ("ms", "cn0_dbhz", "engine"),
    [
        *((ms, 52.0 - 3 * k, "segment") for k, ms in enumerate((1, 2, 4, 8, 16))),
        *((ms, 52.0 - 3 * k, "fft") for k, ms in enumerate((1, 2, 4, 8))),
    ],
)
def test_both_signals_at_their_half_chips(ms: int, cn0_dbhz: float, engine: str) -> None:
    signals = [
        arrival(CHIPS, 0.0011 + 0.3 * CHIP_S, cn0_dbhz, 4930.0),
        arrival(CHIPS, 0.0032, cn0_dbhz + 6, -4960.0, phase=2.0),
    ]
    source = e6_source(signals, 0.0037 + ms * 1e-3, 4, 1277.5e6)
    search = ExhaustiveSearch(integration_s=ms * 1e-3, engine=engine)  # type: ignore[arg-type]
    true, copy = _all(search, source, [CHIPS])
    for peak, start_s, doppler_hz, power in (
        (true, 0.0011 + 0.3 * CHIP_S, 4930.0, cn0_dbhz),
        (copy, 0.0032, -4960.0, cn0_dbhz + 6),
    ):
        assert peak.start_time - START == pytest.approx(start_s, abs=0.2 * CHIP_S)
        assert peak.doppler_hz == pytest.approx(doppler_hz, abs=150 / ms)
        assert peak.cn0_dbhz == pytest.approx(power, abs=2.0)


def test_several_satellites_share_a_search_and_blocks_join_without_a_seam() -> None:
    """One signal just before and one just behind the end of a block of the FFT engine, at 110,613 offsets."""
    border_s = 110_613 * CHIP_S
    signals = [
        arrival(CHIPS, border_s - 1.2 * CHIP_S, 48.0, 100.0),
        arrival(OTHER, border_s + 0.8 * CHIP_S, 48.0, 800.0),
    ]
    source = e6_source(signals, border_s + 0.005, 6)
    for engine in ("segment", "fft"):
        search = ExhaustiveSearch(doppler_span_hz=1000.0, engine=engine, workers=2)  # type: ignore[arg-type]
        first, second = _all(search, source, [CHIPS, OTHER], 7.0)
        assert (first.svid, second.svid) == (11, 25)
        assert second.start_time - first.start_time == pytest.approx(2 * CHIP_S, abs=0.2 * CHIP_S)


@pytest.mark.parametrize("engine", ["segment", "fft"])
@pytest.mark.parametrize("half_chips", [17_390, 17_391])
def test_the_threshold_is_on_the_correlator_at_the_grid_point(
    engine: Literal["segment", "fft"], half_chips: int
) -> None:
    """A signal on a point of either grid, at 0 Hz: found under its magnitude there, and not over it."""
    start_s = half_chips / 2 * CHIP_S
    source = e6_source([arrival(CHIPS, start_s, 52.0)], 0.008, 3)
    bank = correlate(source.batch, handover_at(shortened(CHIPS, 20_460), start_s), np.zeros(1))
    assert bank is not None
    magnitude = float(np.abs(bank.taps[0]) / np.sqrt(bank.noise_power / 2))
    search = ExhaustiveSearch(integration_s=4e-3, doppler_span_hz=1000.0, engine=engine)
    (peak,) = _all(search, source, [CHIPS], 0.995 * magnitude)
    assert peak.start_time - START == pytest.approx(start_s, abs=0.1 * CHIP_S)
    assert _all(search, source, [CHIPS], 1.005 * magnitude) == ()


def test_the_doppler_of_a_pass_is_taken_off_carrier_and_code() -> None:
    """Without noise, 16 ms at the Doppler of the pass: no chip is cut. The wrong sign would cut 0.2 chip off each."""
    middle_hz = 5000 * 2 / 3
    source = e6_source([arrival(CHIPS, 0.0007, 60.0, middle_hz)], 0.018, None)
    block = exhaustive_search._Block(
        search=ExhaustiveSearch(integration_s=16e-3), middle_hz=middle_hz, begin=START + 0.0007, first=0, count=1
    )
    chips = block._chips(source)[0, :, :81_840].astype(float)
    wiped = (chips[0] + 1j * chips[1]) * CHIPS.chips
    assert abs(np.sum(wiped)) / np.sum(np.abs(wiped)) > 0.9999
    assert np.min(np.abs(wiped)) > 0.4 * np.max(np.abs(wiped))  # two or three samples a chip


def test_what_is_found_does_not_depend_on_the_workers_and_stops_where_one_stops() -> None:
    source = e6_source([arrival(CHIPS, 0.001, 47.0, 10.0)], 0.06, 6)
    runs = [
        [state.peaks for state in ExhaustiveSearch(workers=n).run(source, [CHIPS], START, START + 1, 7.0)]
        for n in (1, 3)
    ]
    assert runs[0] == runs[1]
    states = ExhaustiveSearch(engine="fft").run(source, [CHIPS], START, START + 1, 7.0)
    state = next(states)
    assert 0 < state.done < state.total
    assert len(state.peaks) == 1
    states.close()


def test_blocks_go_in_order_of_time_and_a_search_goes_on_where_it_stopped() -> None:
    """16 ms have three passes; a signal early and one late, at both ends of the band."""
    signals = [arrival(CHIPS, 0.003, 46.0, 4800.0), arrival(CHIPS, 0.085, 46.0, -4800.0)]
    source = e6_source(signals, 0.11, 4)
    search = ExhaustiveSearch(integration_s=16e-3, engine="segment")
    states = list(search.run(source, [CHIPS], START, START + 1, 7.5))
    starts = [state.block_start - START for state in states]
    assert len(search.passes_hz) == 3
    assert starts == sorted(starts)
    assert starts[0] == starts[2] < starts[3]
    assert [state.blocks for state in states] == list(range(1, len(states) + 1))
    assert len(states[-1].peaks) == 2
    for stopped in (states[-2], states[-1]):
        again = list(search.run(source, [CHIPS], START, START + 1, 7.5, after=stopped))
        assert again == states[states.index(stopped) :]


def test_the_time_uncertainty_is_what_is_searched() -> None:
    source = e6_source([arrival(CHIPS, 0.004, 50.0, 10.0)], 0.02, 6)
    search = ExhaustiveSearch(integration_s=4e-3)
    for first_s, last_s, found in ((0.0, 0.0039, 0), (0.0039, 0.0041, 1), (0.0041, 1.0, 0), (0.5, 1.0, 0)):
        *_, last = search.run(source, [CHIPS], START + first_s, START + last_s, 7.0)
        assert len(last.peaks) == found
    begin, width_s = searchable(source, 4e-3, START + -1, START + 1)
    assert begin == START
    assert width_s == pytest.approx(0.016, abs=1e-6)


def test_number_of_hypotheses_is_that_of_the_theory() -> None:
    """81 bins where the theory counts 80, and 0.1 % from the engine's bins."""
    for ms in (1, 2, 4, 8, 16):
        expected = 2 * 5.115e6 * 30 * 10e3 * 2 * ms * 1e-3
        assert ExhaustiveSearch(integration_s=ms * 1e-3).hypotheses(30.0) == pytest.approx(expected, rel=0.06)


def test_passes_keep_the_code_doppler_loss_below_0_3_db() -> None:
    for ms, passes in ((1, 1), (4, 1), (8, 2), (16, 3)):
        search = ExhaustiveSearch(integration_s=ms * 1e-3)
        assert len(search.passes_hz) == passes
        slide = 5000.0 / passes / 1278.75e6 * 5.115e6 * ms * 1e-3
        assert -20 * np.log10(1 - slide / 4) < 0.3
        covered = np.sort(np.concatenate([middle + search.bins_hz for middle in search.passes_hz]))
        assert covered[0] <= -5000 + 260 / ms
        assert covered[-1] >= 5000 - 260 / ms
        assert np.max(np.diff(covered)) < 1.01 * 500 / ms
    assert len(ExhaustiveSearch(integration_s=16e-3, doppler_span_hz=1000.0).passes_hz) == 1
    assert len(ExhaustiveSearch(doppler_span_hz=20_000.0).passes_hz) == 4


def test_the_exact_cell_is_the_plain_sum() -> None:
    rng = np.random.default_rng(2)
    source = e6_source([], 0.006, 3)
    cell = Cell(code=shortened(CHIPS, 20_460), start_time=START + 0.0011, middle_hz=1234.5)
    wiped, noise = wiped_chips(source, cell)
    t = np.arange(source.batch.samples.size) / source.batch.sample_rate_hz - 0.0011
    chip = np.floor(5.115e6 * (1 + 1234.5 / 1278.75e6) * t).astype(int)
    inside = (chip >= 0) & (chip < 20_460)
    y = np.zeros(20_460, complex)
    np.add.at(y, chip[inside], (source.batch.samples * np.exp(-2j * np.pi * 1234.5 * t))[inside])
    np.testing.assert_allclose(wiped, y * cell.code.chips, atol=1e-4)
    assert noise == pytest.approx(np.sum(np.abs(y) ** 2), rel=1e-5)
    frequencies = rng.uniform(-5000, 5000, 7)
    expected = np.exp(-2j * np.pi * np.outer(frequencies, np.arange(20_460)) * CHIP_S) @ wiped
    np.testing.assert_allclose(doppler_spectrum(wiped, frequencies), expected, rtol=1e-9, atol=1e-9)


def test_zeros_and_nothing_to_search_are_nothing() -> None:
    source = e6_source([], 0.02, None)
    assert _all(ExhaustiveSearch(), source, [CHIPS]) == ()
    assert [state.total for state in ExhaustiveSearch().run(source, [], START, START + 1, 7.0)] == [0.0]


def test_what_cannot_be_asked() -> None:
    source = e6_source([], 0.01, 1)
    with pytest.raises(ValueError, match="1, 2, 4, 8 or 16 ms"):
        ExhaustiveSearch(integration_s=3e-3)
    with pytest.raises(ValueError, match="span"):
        ExhaustiveSearch(doppler_span_hz=0.0)
    short = shortened(CHIPS, 1000)
    with pytest.raises(ValueError, match="fewer than the 20460"):
        next(ExhaustiveSearch().run(source, [short], START, START + 1, 7.0))
    assert set(GRIDS) == {5115 * ms for ms in (1, 2, 4, 8, 16)}


def test_a_weaker_peak_within_a_chip_belongs_to_the_stronger() -> None:
    def peak(start_s: float, magnitude: float, svid: int = 11) -> Peak:
        return Peak(
            svid=svid, start_time=START + start_s, doppler_hz=0.0, magnitude=magnitude, threshold=6.0, cn0_dbhz=40.0
        )

    peaks = [peak(0.5, 8.0), peak(0.5 + 0.9 * CHIP_S, 20.0), peak(0.5 + 2.5 * CHIP_S, 7.0), peak(0.5, 7.0, svid=3)]
    kept = separated(peaks)
    assert [(one.svid, one.magnitude) for one in kept] == [(3, 7.0), (11, 20.0), (11, 7.0)]


def test_an_interrupt_loses_no_block_that_was_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    """The signal is in the second block, the interrupt comes while the first is awaited."""
    chips = random_chips(np.random.default_rng(8), 5115)
    block = make_engine("fft", chips.chips[None, :]).block
    source = e6_source([arrival(chips, 1.5 * block / 5.115e6, 60.0)], 2.2 * block / 5.115e6 + 1e-3, 3)
    search = ExhaustiveSearch(integration_s=1e-3, workers=2)
    waited = Future.result

    def interrupted(future: Future[object], timeout: float | None = None) -> object:
        monkeypatch.setattr(Future, "result", waited)
        waited(future, timeout)
        raise KeyboardInterrupt

    monkeypatch.setattr(Future, "result", interrupted)
    states = search.run(source, [chips], START, START + 1, 8.0)
    state = next(states)
    with pytest.raises(KeyboardInterrupt):
        next(states)
    (peak,) = state.peaks
    assert peak.start_time - START == pytest.approx(1.5 * block / 5.115e6, abs=0.1e-6)
    assert 0 < state.done <= state.total
