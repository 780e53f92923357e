"""Vestigial signal search on the real recording, as it is and with a delayed copy of itself mixed in.

In the last 12 ms of the recording all satellites arrive 80 µs earlier at once: some 965 samples are missing there. In
all of it every satellite is one signal that jumps; most tests stay in front of that.

Open E6-C takes the place of a RECS. It repeats its primary code every millisecond, which encrypted chips do not: so the
hand-over uses the phase of the secondary code, and the exhaustive search stays within half a millisecond.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from builders import START, batch_of
from vestige.acas_processor.searches.vestigial import (
    VestigialDecision,
    decide_vestigial,
    handover_line,
    handover_peaks,
    line_stretches,
)
from vestige.records import Band, ChipSequence, SampleBatch
from vestige.sample_processor.acquisition import Acquisition
from vestige.sample_processor.e1_snapshot import measure_e1
from vestige.sample_processor.search.e1_jump import Jump
from vestige.sample_processor.search.e1_search import search_e1
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch
from vestige.sample_processor.search.sample_source import BatchSource
from vestige.signals.codes import tiered_code
from vestige.signals.definitions import E6C

IN_THE_SKY = (2, 3, 5, 7, 8, 13, 15, 25)
RATE_HZ = 12e6
PERIODS = 8
DELAY_SAMPLES = round(1.3e-3 * RATE_HZ)
COPY = 10 ** (-3 / 20)
INTACT = round(0.086 * RATE_HZ)  # samples in front of the gap
E1_CENTER_HZ = 1572.42e6
HARDWARE_BIAS_M = -21.0  # E6 minus E1 (protocol reference, section 9.1)


@pytest.fixture(scope="module")
def e1(recording_data: Path) -> SampleBatch:
    samples = np.fromfile(recording_data / "L1_20211125_004000_12MHz_I.bin", np.int8, INTACT)
    return batch_of(samples, RATE_HZ, Band.E1, center_frequency_hz=E1_CENTER_HZ)


@pytest.fixture(scope="module")
def e6(recording_data: Path) -> SampleBatch:
    pairs = np.fromfile(recording_data / "L6_20211125_004000_12MHz_IQ.bin", np.int8, 2 * INTACT).reshape(-1, 2)
    return batch_of(pairs @ np.array([1, -1j]), RATE_HZ, Band.E6)  # the spectrum is inverted


@pytest.fixture(scope="module")
def e1_with_copy(e1: SampleBatch) -> SampleBatch:
    return batch_of(with_copy(e1.samples), RATE_HZ, Band.E1, center_frequency_hz=E1_CENTER_HZ)


@pytest.fixture(scope="module")
def twice(e1_with_copy: SampleBatch) -> tuple[Acquisition, ...]:
    """What E1 holds of the satellites in the sky, with the copy."""
    return search_e1(e1_with_copy, IN_THE_SKY, periods=PERIODS)


def with_copy(samples: np.ndarray) -> np.ndarray:
    """Return the samples with a copy of themselves 1.3 ms later and 3 dB weaker."""
    return samples[DELAY_SAMPLES:] + np.complex64(COPY) * samples[:-DELAY_SAMPLES]


def sixteen_milliseconds(batch: SampleBatch, signal: Acquisition) -> ChipSequence:
    """Return the open E6-C chips that arrive some 25 ms after the first sample, as if they were out of a RECS."""
    snapshot = measure_e1(batch, signal)
    assert snapshot is not None
    phase_ms = round((snapshot.transmit_phase_s - (snapshot.time - batch.start) + 0.025) * 1e3) % 100
    code = np.roll(tiered_code(E6C, signal.svid), -phase_ms * 5115)[:81_840]
    at = START + phase_ms * 1e-3
    return ChipSequence.of(svid=signal.svid, transmit_time=at, chip_rate_hz=E6C.chip_rate_hz, chips=code)


def decide(e1: SampleBatch, e6: SampleBatch, signals: list[Acquisition], chips: ChipSequence) -> VestigialDecision:
    stretches = [
        stretch
        for one in signals
        for stretch in line_stretches(
            BatchSource(e1), one, e1.start, chips, START, START + 0.1, delay_m=HARDWARE_BIAS_M
        )
    ]
    peaks, _ = handover_peaks(BatchSource(e6), stretches)
    return decide_vestigial(chips.svid, peaks)


def test_one_signal_for_each_satellite_in_the_sky_and_none_for_the_others(e1: SampleBatch, e6: SampleBatch) -> None:
    found = search_e1(e1, range(1, 37), periods=PERIODS)
    assert tuple(one.svid for one in found) == IN_THE_SKY
    for one in found:
        decision = decide(e1, e6, [one], sixteen_milliseconds(e1, one))
        assert (len(decision.peaks), decision.spoofed) == (1, False)


def test_all_of_the_recording_has_one_signal_for_each_satellite_and_a_gap(recording_data: Path) -> None:
    """Four satellites are strong enough to be seen in the last 12 ms, too."""
    samples = np.fromfile(recording_data / "L1_20211125_004000_12MHz_I.bin", np.int8)
    jumps: list[Jump] = []
    whole = batch_of(samples, RATE_HZ, Band.E1, center_frequency_hz=E1_CENTER_HZ)
    found = search_e1(whole, IN_THE_SKY, jumped=jumps.append)
    assert tuple(one.svid for one in found) == IN_THE_SKY
    assert [jump.svid for jump in jumps] == [3, 8, 13, 15]
    for jump in jumps:
        assert jump.by_s * RATE_HZ == pytest.approx(-965, abs=4)
        assert jump.at_s == pytest.approx(0.087, abs=0.003)


def test_with_a_delayed_copy_exactly_two(twice: tuple[Acquisition, ...]) -> None:
    for svid in IN_THE_SKY:
        true, copy = (one for one in twice if one.svid == svid)
        later_s = (copy.code_start_s - true.code_start_s) % 4e-3
        assert later_s == pytest.approx(1.3e-3, abs=0.3e-6)
        assert -6 < copy.cn0_dbhz - true.cn0_dbhz < -1  # both in noise, the copy in the true one's too


@pytest.mark.judged(
    by="real recording",
    what="vestigial search with a copy mixed in",
    figure="two signals 1.3e-3 s apart, within 5e-8 s",
)
def test_the_handover_search_tells_which_is_earlier(
    e1_with_copy: SampleBatch, e6: SampleBatch, twice: tuple[Acquisition, ...]
) -> None:
    """The earlier one is the stronger, 3 dB; every satellite, both signals, 1.3 ms apart."""
    e6_twice = batch_of(with_copy(e6.samples), RATE_HZ, Band.E6)
    for svid in IN_THE_SKY:
        signals = [one for one in twice if one.svid == svid]
        decision = decide(e1_with_copy, e6_twice, signals, sixteen_milliseconds(e1_with_copy, signals[0]))
        assert decision.spoofed
        true, copy = decision.peaks
        assert decision.true is true
        assert copy.start_time - true.start_time == pytest.approx(1.3e-3, abs=0.05e-6)
        assert -5.5 < copy.cn0_dbhz - true.cn0_dbhz < -1.0


def test_the_exhaustive_search_finds_the_same_without_e1(e1: SampleBatch, e6: SampleBatch) -> None:
    """Three strong satellites are found with 4 ms of open chips, each at the delay that E1 predicts."""
    for signal in search_e1(e1, (3, 8, 13), periods=PERIODS):
        chips = sixteen_milliseconds(e1, signal)
        snapshot = measure_e1(e1, signal)
        assert snapshot is not None
        expected = handover_line(snapshot, chips, delay_m=HARDWARE_BIAS_M)
        arrival = expected.anchor + -0.1 / (1 + expected.doppler_hz / E6C.carrier_hz)  # the anchor is the next one
        search = ExhaustiveSearch(integration_s=4e-3)
        *_, state = search.run(BatchSource(e6), [chips], arrival + -0.45e-3, arrival + 0.45e-3, 7.0)
        (peak,) = state.peaks
        assert peak.start_time - arrival == pytest.approx(0.0, abs=0.1e-6)
        assert peak.doppler_hz == pytest.approx(expected.doppler_hz, abs=20)
