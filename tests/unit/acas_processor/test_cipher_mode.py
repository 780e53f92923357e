"""The two points on which the service's interface is not public reach every search of level 3, in samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from kept_acquisitions import e1_acquired_once
from vestige.acas_processor.processor import AcasProcessor, Step
from vestige.acas_processor.searches.sampled_searches import E6ExhaustiveSearch
from vestige.acas_processor.searches.sampled_snapshot import block_of
from vestige.crypto.recs.group_delay import OS_ICD_CONVENTION, GroupDelayConvention, inter_frequency_delay_s
from vestige.crypto.recs.recs_segment import CipherMode
from vestige.records import Assistance, Band, GroupDelay, Outcome, Snapshot, Status
from vestige.sample_processor.correlator import CorrelatableSamples
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import simulated

SCENARIO = Path(__file__).resolve().parents[3] / "scenarios" / "vestigial.toml"
SETTINGS = ("receiver.sample_rate_hz=6.2e6", "receiver.cn0_dbhz=43", "attack=none")
SVID = 11
EXHAUSTIVE = E6ExhaustiveSearch(
    how=ExhaustiveSearch(integration_s=4e-3, doppler_span_hz=2000.0, engine="segment"), around_s=1e-3
)
OPPOSITE = GroupDelayConvention(sign=-1)


@pytest.fixture(scope="module", autouse=True)
def _e1_is_acquired_once() -> Iterator[None]:
    with e1_acquired_once():
        yield


@cache
def _received() -> tuple[Snapshot, AcasTestCase]:
    """A snapshot of one satellite: 0.11 s of E1, 60 ms of E6, and what E1 tracking says."""
    scenario = load_scenario(SCENARIO, SETTINGS)
    assert isinstance(scenario, CampaignScenario)
    case = AcasTestCase(scenario=scenario, first=0, end=1)
    recording, (epoch,) = simulated(case), case.observations()
    snapshot = Snapshot(
        index=0,
        time=epoch.time,
        received_at=recording.reference + 0.14,
        time_uncertainty_s=15.0,
        observations=epoch.observations,
        e6=CorrelatableSamples(recording.window(Band.E6, 0.07, 0.13)),
        e1=recording.window(Band.E1, 0.03, 0.14),
        recs=frozenset({SVID}),
    )
    return snapshot, case


def _assistance(mode: CipherMode, convention: GroupDelayConvention = OS_ICD_CONVENTION) -> Assistance:
    """The RECS in a cipher mode, and a group delay of 1 µs that only the right convention cancels the bias with."""
    _, case = _received()
    segment, key = replace(case.simulation, cipher_mode=mode).segment(0)
    delay = GroupDelay(svid=SVID, bgd_e1_e6_s=1e-6, valid_from=case.simulation.start)
    sent_late_s = inter_frequency_delay_s(case.satellites[0].bgd_s)  # as the samples have it
    return Assistance(
        segments=(segment,),
        keys=(key,),
        group_delays=(delay,),
        hardware_bias_e1_e6_s=sent_late_s - inter_frequency_delay_s(delay.bgd_e1_e6_s, convention),
    )


def _step(assistance: Assistance, mode: CipherMode, convention: GroupDelayConvention = OS_ICD_CONVENTION) -> Step:
    processor = AcasProcessor(level=3, cipher_mode=mode, group_delay_convention=convention)
    processor = replace(processor, monitoring=replace(processor.monitoring, exhaustive_search=EXHAUSTIVE))
    snapshot, _ = _received()
    return processor.step(None, block_of(snapshot), assistance)


def _found(step: Step) -> tuple[float, float]:
    """Return how many signals each search found that carry the encrypted chips."""
    return float(step.block.e1_search.carrying[0, 0]), float(step.block.exhaustive_search.carrying[0, 0])


@pytest.mark.parametrize("mode", CipherMode)
def test_every_consumer_decrypts_in_the_mode_of_the_processor(mode: CipherMode) -> None:
    """The bank and both searches find the RECS; in the other mode nobody does."""
    (other,) = set(CipherMode) - {mode}
    right, wrong = _step(_assistance(mode), mode), _step(_assistance(mode), other)
    (verdict,) = right.verdicts
    assert verdict.status is Status.AUTHENTIC, verdict.reason
    assert _found(right) == (1.0, 1.0)
    (verdict,) = wrong.verdicts
    assert verdict.status is Status.NOT_DETECTED
    assert _found(wrong)[0] == 0.0
    searched = {check.name: check for check in verdict.checks}["E6 exhaustive search"]
    assert (searched.outcome, searched.reason) == (Outcome.NOT_RUN, "the RECS was not found in E6")


@pytest.mark.parametrize("convention", [OS_ICD_CONVENTION, OPPOSITE])
def test_every_consumer_reads_group_delays_in_the_convention_of_the_processor(convention: GroupDelayConvention) -> None:
    """In the wrong one E6 is expected 310 m beside where it is: farther than the hand-over search looks.

    The bank of correlators reaches so far on its early side only.
    """
    assistance = _assistance(CipherMode.CTR, convention)
    (other,) = {OS_ICD_CONVENTION, OPPOSITE} - {convention}
    right, wrong = _step(assistance, CipherMode.CTR, convention), _step(assistance, CipherMode.CTR, other)
    assert [verdict.status for verdict in right.verdicts] == [Status.AUTHENTIC]
    assert abs(right.verdicts[0].range_offset_m) < 10.0
    assert _found(right) == (1.0, 1.0)
    early = convention is not OS_ICD_CONVENTION
    assert [verdict.status for verdict in wrong.verdicts] == [Status.SPOOFED if early else Status.NOT_DETECTED]
    assert _found(wrong) == (0.0, 1.0)  # the exhaustive one looks 1 ms around
