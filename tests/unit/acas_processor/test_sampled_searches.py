"""The vestigial searches in samples: simulated recordings with and without a meaconer."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from kept_acquisitions import e1_acquired_once
from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings
from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.searches.sampled_searches import E1VestigialSearch, E6ExhaustiveSearch, SatelliteSearch
from vestige.acas_processor.searches.sampled_snapshot import block_of
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records import Assistance, Band, E1Observation, Snapshot, Status
from vestige.records.checks import CheckName
from vestige.records.snapshot_block import SEARCH_NOT_RUN
from vestige.records.time_uncertainty import TimeUncertainty
from vestige.records.times import GalileoTimes
from vestige.sample_processor.correlator import CorrelatableSamples
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch
from vestige.sample_processor.search.sample_source import BatchSource
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import simulated
from vestige.time import GalileoTime

SCENARIO = Path(__file__).resolve().parents[3] / "scenarios" / "vestigial.toml"
DELAY_S = 0.0237
FROM_S, TO_S = 0.07, 0.13
EXHAUSTIVE = E6ExhaustiveSearch(how=ExhaustiveSearch(integration_s=4e-3, doppler_span_hz=2000.0, engine="segment"))


@pytest.fixture(scope="module", autouse=True)
def _e1_is_acquired_once() -> Iterator[None]:
    with e1_acquired_once():
        yield


@cache
def _received(attacked: bool, delay_s: float = DELAY_S) -> tuple[Snapshot, Assistance, float]:
    """A snapshot with 0.11 s of E1 and 60 ms of E6, its assistance, and when the RECS arrives."""
    attack = f"attack.0.delay_s={delay_s}" if attacked else "attack=none"
    scenario = load_scenario(SCENARIO, ("receiver.sample_rate_hz=6.2e6", attack, "receiver.cn0_dbhz=43"))
    assert isinstance(scenario, CampaignScenario)
    case = AcasTestCase(scenario=scenario, first=0, end=1)
    recording = simulated(case)
    e1, e6 = recording.window(Band.E1, 0.03, 0.14), recording.window(Band.E6, FROM_S, TO_S)
    snapshot = Snapshot(
        index=0,
        time=recording.reference + 0.1,
        received_at=recording.reference + TO_S,
        time_uncertainty_s=15.0,
        observations={},
        e6=CorrelatableSamples(e6),
        e1=e1,
    )
    return snapshot, case.assistance(), float(case.satellites[0].received_s[0])


@pytest.mark.parametrize("search", [E1VestigialSearch(), EXHAUSTIVE], ids=["e1", "e6"])
def test_a_second_signal_fails_the_check_and_the_earlier_is_the_true_one(
    search: E1VestigialSearch | E6ExhaustiveSearch,
) -> None:
    snapshot, assistance, true_s = _received(True)
    (found,) = search.search(snapshot, assistance, TimeUncertainty())
    assert found.svid == 11
    assert (found.count, found.carrying, found.not_run) == (2.0, 2, 0)
    assert [peak.start_time - (snapshot.time + -0.1) for peak in found.peaks] == pytest.approx(
        [true_s, true_s + DELAY_S], abs=0.1e-6
    )


@pytest.mark.parametrize("search", [E1VestigialSearch(), EXHAUSTIVE], ids=["e1", "e6"])
def test_one_signal_passes(search: E1VestigialSearch | E6ExhaustiveSearch) -> None:
    snapshot, assistance, _ = _received(False)
    (found,) = search.search(snapshot, assistance, TimeUncertainty())
    assert (found.count, len(found.peaks)) == (1.0, 1)
    (elsewhere,) = EXHAUSTIVE.search(
        replace(snapshot, e6=None),
        assistance,
        TimeUncertainty(),
        BatchSource(snapshot.e6.batch),  # type: ignore[union-attr]
    )
    assert len(elsewhere.peaks) == 1


def _why(found: SatelliteSearch) -> str:
    return SEARCH_NOT_RUN[found.not_run - 1] if found.not_run else ""


def _disclosed_at(assistance: Assistance) -> GalileoTime:
    (segment,) = assistance.segments
    return next(key.disclosed_at for key in assistance.keys if key.time == segment.key_time)


@pytest.mark.parametrize("search", [E1VestigialSearch(), EXHAUSTIVE], ids=["e1", "e6"])
@pytest.mark.parametrize("clock_late_s", [0.0, 3.0])
def test_what_comes_when_the_key_may_be_known_counts_and_is_never_the_true_one(
    search: E1VestigialSearch | E6ExhaustiveSearch, clock_late_s: float
) -> None:
    """The bound on the clock puts the disclosure between both signals, then in front of them.

    The labels may be late with E1's clock: what counts is when the samples were received.
    """
    snapshot, assistance, true_s = _received(True)
    reference = snapshot.time + -0.1
    received = replace(snapshot, received_at=snapshot.received_at + clock_late_s)
    disclosed_at = _disclosed_at(assistance)

    def bound(start_s: float) -> TimeUncertainty:
        """That with which a RECS that begins so late ends when its key may be known."""
        return TimeUncertainty(initial_s=disclosed_at - reference - start_s - clock_late_s - 16e-3)

    (between,) = search.search(received, assistance, bound(true_s + 1e-3))
    assert (between.count, len(between.peaks)) == (2.0, 2)
    (before,) = search.search(received, assistance, bound(true_s - 1e-3))
    assert (before.count, before.carrying, before.peaks) == (2.0, 2, ())


def test_a_single_signal_from_after_the_disclosure_proves_nothing() -> None:
    snapshot, assistance, true_s = _received(False)
    late_s = _disclosed_at(assistance) - (snapshot.time + -0.1) - true_s - 15e-3
    (found,) = EXHAUSTIVE.search(snapshot, assistance, TimeUncertainty(initial_s=late_s))
    assert (found.peaks, _why(found)) == ((), "the RECS was found, but its key may have been public when it arrived")


def test_what_is_missing_is_said() -> None:
    snapshot, assistance, _ = _received(False)
    now = TimeUncertainty()

    def reasons(snapshot: Snapshot, assistance: Assistance, uncertainty: TimeUncertainty = now) -> tuple[str, str]:
        (one,) = E1VestigialSearch().search(snapshot, assistance, uncertainty)
        (other,) = EXHAUSTIVE.search(snapshot, assistance, uncertainty)
        assert other.not_run
        return _why(one), _why(other)

    nothing = replace(snapshot, e1=None, e6=None)
    assert reasons(nothing, assistance) == ("no E1 samples", "no E6 samples")
    assert reasons(snapshot, replace(assistance, keys=())) == (
        "",
        "the satellite has no RECS with a known key that was still secret at reception",
    )
    late = reasons(snapshot, assistance, replace(now, initial_s=100.0))
    assert late[1] == "the satellite has no RECS with a known key that was still secret at reception"
    elsewhere = CorrelatableSamples(replace(snapshot.e6.batch, start=snapshot.time + -20.0))  # type: ignore[union-attr]
    assert "anywhere in the time uncertainty" in reasons(replace(snapshot, e6=elsewhere), assistance)[1]


def test_the_uncertainty_shrinks_with_a_fix_and_grows_with_the_clock() -> None:
    snapshot, _, _ = _received(False)
    before = TimeUncertainty(initial_s=15.0, frequency_error=1e-6)
    assert before.at(snapshot.time) == 15.0
    after = before.after_fix(snapshot.time, 2e-6)
    assert after.at(snapshot.time) == 2e-6
    assert after.at(snapshot.time + 30.0) == pytest.approx(32e-6)
    assert after.at(snapshot.time + 1e9) == 15.0
    assert before.fixed_at is None
    times = GalileoTimes.of([snapshot.time + later for later in (-3.5, 0.0, 30.25, 1e9)])
    for one in (before, after):
        assert one.over(times).tolist() == [one.at(times.at(place)) for place in range(4)]


def test_a_satellite_that_e1_does_not_show_is_searched_in_e6_all_the_same() -> None:
    """Two signals, and E1 shows another satellite only: no E1 range is there that the earliest could stand beside."""
    snapshot, assistance, _ = _received(True)
    unknown = dict.fromkeys(("carrier_phase_cycles", "cn0_dbhz"), math.nan)
    other = E1Observation(svid=12, pseudorange_m=2.5e7, doppler_hz=0.0, doppler_rate_hz_per_s=0.0, **unknown)
    block = block_of(replace(snapshot, observations={12: other}, recs=frozenset({11})))
    processor = AcasProcessor(level=3, monitoring=replace(MonitoringSettings(), exhaustive_search=EXHAUSTIVE))
    step = processor.step(None, block, assistance)
    found = step.block.exhaustive_search
    assert found.carrying[0].tolist()[0] == 2
    assert np.isnan(found.earliest_m[0, 0])
    assert step.block.failed[CheckName.E6_EXHAUSTIVE_SEARCH][0].tolist() == [True, False]
    assert {verdict.svid: verdict.status for verdict in step.verdicts} == {12: Status.SUSPECT}


@pytest.mark.parametrize(("delay_s", "known"), [(0.0237, True), (0.0737, False)])
def test_the_only_signal_in_e6_is_the_true_one_if_none_on_e1_is_earlier(delay_s: float, known: bool) -> None:
    """E1 alone is spoofed and tracked at the later signal: the one that carries the chips says where E1 should be.

    E1 tells the order of two signals within half a period of the secondary code, 50 ms; by the primary code alone the
    signal that is 23.7 ms late would seem to be 0.3 ms early. With a delay of 73.7 ms the later signal seems to be
    26.3 ms early; a true one that is too weak in E6 would look the same, so nothing is said.
    """
    attacked, assistance, true_s = _received(True, delay_s)
    honest = _received(False)[0]
    later = E1Observation(
        svid=11,
        pseudorange_m=(true_s + delay_s) * SPEED_OF_LIGHT_MPS,
        doppler_hz=0.0,
        doppler_rate_hz_per_s=0.0,
        carrier_phase_cycles=math.nan,
        cn0_dbhz=math.nan,
    )
    time = attacked.time + (-0.1 + true_s + delay_s)
    snapshot = replace(attacked, time=time, e6=honest.e6, observations={11: later}, recs=frozenset({11}))
    step = AcasProcessor(level=2).step(None, block_of(snapshot), assistance)
    found = step.block.e1_search
    assert (found.signals[0, 0], found.carrying[0, 0]) == (2, 1)
    expected_m = -delay_s * SPEED_OF_LIGHT_MPS if known else math.nan
    assert found.earliest_m[0, 0] == pytest.approx(expected_m, abs=100.0, nan_ok=True)
    assert step.block.earlier[0, 0] == known
