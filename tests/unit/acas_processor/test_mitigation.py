from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import START
from vestige.acas_processor.error_budget import ErrorBudget
from vestige.acas_processor.mitigation import LEVELS, Limits, decide, status_block
from vestige.records import CorrelatorBank, Detection, Measurement, Outcome, SatelliteMeasurement, Status, Verdict

LIMITS = Limits(budget=ErrorBudget.uncorrected())
BANK = CorrelatorBank(offsets_m=np.zeros(1), taps=np.zeros(1, np.complex128), noise_power=1.0, integration_s=0.016)


def _verdict(satellite: SatelliteMeasurement) -> Verdict:
    measurement = Measurement(index=4, time=START, satellites=(satellite,), observations={}, front_end={})
    (verdict,) = decide(measurement, 1, LIMITS)
    return verdict


def _detected(offset_m: float) -> SatelliteMeasurement:
    detection = Detection(tap=5, magnitude=9.0, phase_rad=0.0, threshold=5.7, range_offset_m=offset_m)
    return SatelliteMeasurement(svid=7, bank=BANK, detection=detection, predicted_pd=0.999, available_at=START)


@pytest.mark.parametrize(
    ("satellite", "status", "outcomes"),
    [
        (_detected(0.0), Status.AUTHENTIC, "pp"),
        (_detected(26.5), Status.AUTHENTIC, "pp"),
        (_detected(-26.5), Status.AUTHENTIC, "pp"),
        (_detected(26.7), Status.SPOOFED, "pf"),
        (_detected(-50.0), Status.SPOOFED, "pf"),
        (SatelliteMeasurement(svid=7, bank=BANK, predicted_pd=0.99), Status.NOT_DETECTED, "fn"),
        (SatelliteMeasurement(svid=7, bank=BANK, predicted_pd=0.5), Status.NOT_AVAILABLE, "nn"),
        (SatelliteMeasurement(svid=7, bank=BANK), Status.NOT_AVAILABLE, "nn"),
        (SatelliteMeasurement(svid=7, unavailable="no key"), Status.NOT_AVAILABLE, "nn"),
    ],
)
def test_status_of_every_combination(satellite: SatelliteMeasurement, status: Status, outcomes: str) -> None:
    verdict = _verdict(satellite)
    assert verdict.status is status
    names = {"p": Outcome.PASS, "f": Outcome.FAIL, "n": Outcome.NOT_RUN}
    assert [check.outcome for check in verdict.checks] == [names[letter] for letter in outcomes]
    assert verdict.reason
    assert verdict.index == 4


def test_every_check_that_did_not_pass_says_why() -> None:
    for satellite in (_detected(99.0), SatelliteMeasurement(svid=7, unavailable="no key")):
        assert all(check.reason for check in _verdict(satellite).checks if check.outcome is not Outcome.PASS)


def test_the_range_limit_is_kappa_sigma() -> None:
    """3σ of the uncorrected budget is 26.6 m (protocol reference, receiver test)."""
    checks = _verdict(_detected(1.0)).checks
    assert checks[1].threshold == pytest.approx(26.6, abs=0.05)


@given(
    st.lists(
        st.tuples(st.booleans(), st.floats(-60, 60), st.one_of(st.floats(0, 1), st.just(float("nan")))), min_size=1
    )
)
def test_a_block_gets_the_status_of_its_epochs(epochs: list[tuple[bool, float, float]]) -> None:
    detected, offsets, predicted = (np.array(column) for column in zip(*epochs, strict=True))
    block = status_block(detected, offsets.astype(float), predicted.astype(float), LIMITS)
    for status, (found, offset, pd) in zip(block, epochs, strict=True):
        one = replace(_detected(offset), predicted_pd=pd)
        assert list(Status)[status] is _verdict(one if found else replace(one, detection=None)).status


def test_levels_are_a_table() -> None:
    assert set(LEVELS) == {1}
