from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import START
from vestige.acas_processor.error_budget import ErrorBudget
from vestige.acas_processor.minimum_defence import Limits, minimum_block
from vestige.acas_processor.mitigation import LEVELS, Scope, combine, combine_block, confirmed_block, decide
from vestige.measurement import Detection, Measurement, SatelliteMeasurement
from vestige.records import CheckResult, CorrelatorBank, Outcome, Status, Verdict

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


@pytest.mark.parametrize(
    ("name", "status"),
    [
        ("E6 power", Status.NOT_DETECTED),
        ("E1-E6 range", Status.SPOOFED),
        ("E6 second signal", Status.SPOOFED),  # somebody sends what the satellite did not
        ("E1 vestigial search", Status.SPOOFED),
        ("E6 exhaustive search", Status.SPOOFED),
        ("OSNMA agreement", Status.SPOOFED),
    ],
)
def test_what_finds_a_second_sender_says_spoofed_and_all_else_is_suspicion(name: str, status: Status) -> None:
    failure = CheckResult(name=name, outcome=Outcome.FAIL, unit="", reason="it failed")
    assert combine(3, [failure]) == (status, "it failed")
    graver = {row.name for row in LEVELS[3] if row.failure is not Status.SUSPECT}
    assert len(graver) == 6
    assert name in graver


@given(
    st.lists(
        st.tuples(st.booleans(), st.floats(-60, 60), st.one_of(st.floats(0, 1), st.just(float("nan")))), min_size=1
    )
)
def test_a_block_gets_the_status_of_its_epochs(epochs: list[tuple[bool, float, float]]) -> None:
    detected, offsets, predicted = (np.array(column) for column in zip(*epochs, strict=True))
    failed, available = minimum_block(detected, offsets.astype(float), predicted.astype(float), LIMITS)
    block = combine_block(1, failed, available[:, None])[:, 0]
    for status, (found, offset, pd) in zip(block, epochs, strict=True):
        one = replace(_detected(offset), predicted_pd=pd)
        assert list(Status)[status] is _verdict(one if found else replace(one, detection=None)).status


def test_levels_are_those_of_the_paper() -> None:
    """[WFO, Sec. IV]: level 2 adds steps 3 to 5; level 3 replaces 4 and 5, and bridges."""
    steps = {level: {row.step for row in rows} for level, rows in LEVELS.items()}
    assert steps == {1: {1, 2}, 2: {1, 2, 3, 4, 5}, 3: {1, 2, 3, 4, 5, 7}}
    names = {level: [row.name for row in rows] for level, rows in LEVELS.items()}
    assert set(names[1]) < set(names[2]) < set(names[3])
    assert all(len(set(of_level)) == len(of_level) for of_level in names.values())
    assert "E6 exhaustive search" not in names[2]


def test_only_the_check_that_errs_by_itself_is_confirmed() -> None:
    """Power–distortion fails of itself in 0.6 % of its tests [WESSON18], of three in a row in 2e-7."""
    confirmed = {row.name: row.confirm for row in LEVELS[3] if row.confirm != 1}
    assert confirmed == {"power-distortion": 3}


_OUTCOMES = {"p": Outcome.PASS, "f": Outcome.FAIL, "n": Outcome.NOT_RUN}


def _checks(level: int, letters: str) -> list[CheckResult]:
    return [
        CheckResult(name=row.name, outcome=_OUTCOMES[letter], reason=row.name)
        for row, letter in zip(LEVELS[level], letters, strict=True)
    ]


@pytest.mark.parametrize(
    ("failing", "status"),
    [
        ((), Status.AUTHENTIC),
        (("C/N0",), Status.SUSPECT),
        (("RAIM", "E6 power"), Status.NOT_DETECTED),
        (("E6 power", "E1 vestigial search"), Status.SPOOFED),
        (("E1 received power", "E1-E6 range"), Status.SPOOFED),
        (("power-distortion",), Status.AUTHENTIC),  # is of level 3
    ],
)
def test_the_gravest_failure_counts(failing: tuple[str, ...], status: Status) -> None:
    checks = [
        CheckResult(name=row.name, outcome=Outcome.FAIL if row.name in failing else Outcome.PASS, reason=row.name)
        for row in LEVELS[3]
    ]
    assert combine(2, checks)[0] is status
    assert combine(2, checks[::-1])[0] is status


@pytest.mark.parametrize("name", ["E1 vestigial search", "E6 exhaustive search"])
@pytest.mark.parametrize("level", [2, 3])
def test_who_sends_one_satellite_twice_may_send_them_all(name: str, level: int) -> None:
    of_level = name in {row.name for row in LEVELS[level]}
    second = CheckResult(name=name, outcome=Outcome.FAIL, reason="2 signals")
    satellites = (_detected(0.0), replace(_detected(0.0), svid=8), replace(_detected(99.0), svid=9))
    measurement = Measurement(index=0, time=START, satellites=satellites, observations={}, front_end={})
    found = decide(measurement, level, LIMITS, {8: (second,)}, {8: -300.0})
    drifting = {8: (second,), 7: (CheckResult(name="C/N0", outcome=Outcome.FAIL, reason="its own"),)}
    assert decide(measurement, level, LIMITS, drifting)[0].reason == "its own"
    statuses = [verdict.status for verdict in found]
    expected = [Status.SUSPECT, Status.SPOOFED] if of_level else [Status.AUTHENTIC, Status.AUTHENTIC]
    assert statuses == [*expected, Status.SPOOFED]
    assert found[0].reason == ("E08: more than one signal" if of_level else "all checks passed")
    assert found[1].true_offset_m == -300.0
    failed = {name: np.array([[False, True, False]]), "E1-E6 range": np.array([[False, False, True]])}
    block = combine_block(level, failed, np.ones((1, 3), np.bool_))
    assert [list(Status)[one] for one in block[0]] == statuses


def test_what_was_not_run_is_said() -> None:
    status, reason = combine(2, _checks(2, "pp" + "n" * 12))
    assert status is Status.AUTHENTIC
    assert "not run: E1 received power, E6 received power, C/N0" in reason
    assert combine(2, _checks(2, "n" + "p" * 13))[0] is Status.NOT_AVAILABLE


@given(st.sampled_from(sorted(LEVELS)), st.data())
def test_blocks_combine_as_epochs_do(level: int, data: st.DataObject) -> None:
    n = len(LEVELS[level])
    letters = data.draw(st.lists(st.text("pfn", min_size=n, max_size=n), min_size=1, max_size=5))
    failed = {
        row.name: np.array([[one[k] == "f"] if row.scope is Scope.SATELLITE else one[k] == "f" for one in letters])
        for k, row in enumerate(LEVELS[level])
    }
    available = np.array([[all(letter != "n" for letter in one[:2])] for one in letters])
    block = combine_block(level, failed, available)[:, 0]
    assert [list(Status)[status] for status in block] == [combine(level, _checks(level, one))[0] for one in letters]


@given(st.lists(st.sampled_from("pfn"), min_size=1, max_size=30), st.integers(1, 4))
def test_confirmation_counts_failures_in_a_row(letters: list[str], confirm: int) -> None:
    failed, run = np.array([one == "f" for one in letters]), np.array([one != "n" for one in letters])
    expected, count = [], 0
    for one in letters:
        count = count + 1 if one == "f" else count if one == "n" else 0
        expected.append(one == "f" and count >= confirm)
    assert confirmed_block(failed, run, confirm).tolist() == expected
    assert confirmed_block(failed[:, None], run[:, None], confirm)[:, 0].tolist() == expected
