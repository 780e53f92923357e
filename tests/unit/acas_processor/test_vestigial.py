"""From two signals on E1 to the decision, on samples of both bands that belong together."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from builders import START, random_chips, received_batch, satellite, validated_key
from search_builder import arrival, e6_source
from vestige.acas_processor.searches import vestigial
from vestige.acas_processor.searches.vestigial import (
    decide_vestigial,
    handover_line,
    handover_peaks,
    line_stretches,
    reception_proof,
)
from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.records import Assistance, Band, EncryptedSegment, SampleBatch
from vestige.sample_processor.acquisition import Acquisition
from vestige.sample_processor.e1_snapshot import E1Snapshot
from vestige.sample_processor.search.e1_search import search_e1
from vestige.sample_processor.search.peak import Peak
from vestige.sample_processor.search.sample_source import BatchSource
from vestige.time import GalileoTime

SVID, RANGE_M, RATE_MPS = 11, 2.4e7, -300.0
CHIPS = random_chips(np.random.default_rng(4), 81_840)  # sent at START
LATER_S = 1.3e-3 + 0.1  # of the meaconed signal: code phase 1.3 ms, and one period of the secondary code
CHIP_S = 1 / 5.115e6


def _arrival_s(delay_s: float) -> float:
    """Return when the first chip arrives: t − P(t)/c = 0."""
    return (RANGE_M / SPEED_OF_LIGHT_MPS + delay_s) / (1 - RATE_MPS / SPEED_OF_LIGHT_MPS)


@pytest.fixture(scope="module")
def e1() -> SampleBatch:
    """0.15 s of E1: the true signal and one 6 dB stronger."""
    sky = [
        satellite(SVID, RANGE_M, RATE_MPS, 41.0, 40.0),
        satellite(SVID, RANGE_M + LATER_S * SPEED_OF_LIGHT_MPS, RATE_MPS, 47.0, 46.0),
    ]
    return received_batch(Band.E1, sky, rate_hz=4.5e6, duration_s=0.15)


def _e6() -> BatchSource:
    doppler_hz = -RATE_MPS / SPEED_OF_LIGHT_MPS * E6_CARRIER_HZ
    signals = [
        arrival(CHIPS, _arrival_s(0.0), 40.0, doppler_hz),
        arrival(CHIPS, _arrival_s(LATER_S), 46.0, doppler_hz),
    ]
    return e6_source(signals, 0.25, 5)


@pytest.mark.parametrize("secondary", [True, False])
def test_two_signals_on_e1_two_in_e6_the_earlier_is_true(e1: SampleBatch, secondary: bool) -> None:
    found = search_e1(e1, [SVID], periods=8)
    assert len(found) == 2
    stretches = [
        stretch
        for one in found
        for stretch in line_stretches(BatchSource(e1), one, e1.start, CHIPS, START + -1, START + 1, secondary=secondary)
    ]
    peaks, budget = handover_peaks(_e6(), stretches)
    decision = decide_vestigial(SVID, peaks)
    assert decision.spoofed
    assert decision.true is not None
    assert decision.true.start_time - START == pytest.approx(_arrival_s(0.0), abs=0.3 * CHIP_S)
    assert decision.peaks[1].start_time - START == pytest.approx(_arrival_s(LATER_S), abs=0.3 * CHIP_S)
    assert decision.peaks[1].cn0_dbhz > decision.true.cn0_dbhz + 3
    places = 2 * (0.25 - 0.016) / (0.1 if secondary else 4e-3)
    assert budget.hypotheses == pytest.approx(5 * places, rel=0.3)


def test_one_signal_is_no_spoofing_and_none_is_nothing(e1: SampleBatch) -> None:
    found = search_e1(e1, [SVID], periods=8)
    weaker = min(found, key=lambda one: one.statistic)
    stretches = line_stretches(BatchSource(e1), weaker, e1.start, CHIPS, START + -1, START + 1)
    peaks, _ = handover_peaks(_e6(), stretches)
    decision = decide_vestigial(SVID, peaks)
    assert (len(decision.peaks), decision.spoofed) == (1, False)
    nothing = decide_vestigial(3, peaks)
    assert (nothing.true, nothing.spoofed) == (None, False)
    assert handover_peaks(_e6(), [])[0] == ()


def test_the_true_signal_is_from_before_the_disclosure() -> None:
    """A RECS of 16 ms, a clock good to 2 s: it must have begun 2.016 s before the key is on air."""
    key = validated_key(START.subframe + 30)
    segment = EncryptedSegment(
        svid=SVID, transmit_time=START, n_chips=81_840, cipher=b"", key_time=key.time, key_delay=1
    )
    assistance = Assistance(segments=(segment,), keys=(key,))
    proof = reception_proof(assistance, CHIPS, 2.0)
    until = key.time + (22 - 2.016)
    early, late = (
        Peak(svid=SVID, start_time=until + at_s, doppler_hz=0.0, magnitude=9.0, threshold=6.0, cn0_dbhz=40.0)
        for at_s in (-1e-6, 1e-6)
    )
    both = decide_vestigial(SVID, (late, early), proof)
    assert (both.true, both.spoofed) == (early, True)
    forged = decide_vestigial(SVID, (late,), proof)
    assert (forged.true, forged.spoofed, forged.peaks) == (None, False, (late,))
    assert decide_vestigial(SVID, (late,)).true is late
    unknown = reception_proof(assistance, CHIPS, math.inf)
    assert decide_vestigial(SVID, (early,), unknown).true is None


def test_repetitions_of_an_open_code_count_once_and_a_replay_counts() -> None:
    """A period of 100 ms, received 0.23 µs shorter at 3 kHz; a replay 1.3 ms later, which repeats as well."""
    period_s, doppler_hz = 0.1, 3000.0
    received_s = period_s / (1 + doppler_hz / E6_CARRIER_HZ)
    peaks = [
        Peak(svid=SVID, start_time=START + at_s, doppler_hz=doppler_hz, magnitude=9.0, threshold=6.0, cn0_dbhz=40.0)
        for at_s in (0.0, received_s, 2 * received_s, 1.3e-3, 1.3e-3 + received_s)
    ]
    alone = decide_vestigial(SVID, peaks[:3], repeated_after_s=period_s)
    assert (alone.true, alone.spoofed) == (peaks[0], False)
    replayed = decide_vestigial(SVID, peaks, repeated_after_s=period_s)
    assert (replayed.true, replayed.spoofed, replayed.peaks) == (peaks[0], True, (peaks[0], peaks[3]))
    assert decide_vestigial(SVID, peaks[:2]).spoofed, "chips that do not repeat were sent twice"
    unclear = decide_vestigial(SVID, peaks, open_code=True)
    assert (unclear.true, unclear.spoofed, len(unclear.peaks)) == (None, False, 5)


def test_a_smaller_uncertainty_is_a_shorter_search(e1: SampleBatch) -> None:
    (strong, _) = search_e1(e1, [SVID], periods=8)
    around = START + _arrival_s(LATER_S)
    stretches = line_stretches(BatchSource(e1), strong, e1.start, CHIPS, around + -0.01, around + 0.01, secondary=False)
    peaks, budget = handover_peaks(_e6(), stretches)
    assert budget.hypotheses == 5 * 5
    assert len(peaks) == 1


def _snapshot(**changes: float) -> E1Snapshot:
    values = {"transmit_phase_s": 0.031, "doppler_hz": 1575.42, "cn0_dbhz": 40.0, "secondary_margin_db": 5.0}
    return E1Snapshot(svid=SVID, time=START + 0.5, **{**values, **changes})


def test_places_follow_the_phase_of_transmission() -> None:
    """Doppler of 1e-6 makes 69 ms of the satellite 69 ms less 69 ns here; 30 m are 100 ns."""
    line = handover_line(_snapshot(), CHIPS, delay_m=29.9792458)
    assert line.period_s == 0.1
    assert line.anchor - START == pytest.approx(0.5 + 0.069 / (1 + 1e-6) + 1e-7, abs=1e-12)
    assert line.doppler_hz == pytest.approx(1278.75)
    unclear = handover_line(_snapshot(secondary_margin_db=0.3), CHIPS)
    assert unclear.period_s == 4e-3
    assert unclear.anchor - START == pytest.approx(0.5 + 0.001 / (1 + 1e-6), abs=1e-12)
    late = replace(CHIPS, transmit_time=START + 0.0375)
    assert handover_line(_snapshot(), late).anchor - START == pytest.approx(0.5065, abs=1e-8)


def test_over_seconds_e1_is_measured_again_where_it_is(e1: SampleBatch, monkeypatch: pytest.MonkeyPatch) -> None:
    """A Doppler rate of 1 Hz/s, E1 up to 7 s: each stretch has its own Doppler, and there is no gap between them."""

    def measured(_source: BatchSource, _found: Acquisition, at: GalileoTime) -> E1Snapshot | None:
        elapsed_s = at - START + 0.05
        return replace(_snapshot(doppler_hz=1000 + elapsed_s), time=at + 0.05) if elapsed_s < 7 else None

    monkeypatch.setattr(vestigial, "_measured", measured)
    (found, _) = search_e1(e1, [SVID], periods=2)
    stretches = line_stretches(BatchSource(e1), found, START + 4, CHIPS, START, START + 9)
    assert stretches[0].first_start == START
    assert stretches[-1].last_start == START + 9
    for one, other in pairwise(stretches):
        assert one.last_start == other.first_start
        assert other.first_start - one.first_start < 3.2
    dopplers = [one.line.doppler_hz * E1_CARRIER_HZ / E6_CARRIER_HZ - 1000 for one in stretches]
    assert dopplers == pytest.approx([0.05, 2.05, 4.05, 6.1, 6.1], abs=0.3)
