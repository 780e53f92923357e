from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evidence_builder import evidence, outcome
from vestige.acas_processor.checks.check import confirmed
from vestige.acas_processor.checks.e1_e6_range import RangeCheck
from vestige.acas_processor.checks.power.e6_power import E6PowerCheck
from vestige.acas_processor.levels import LEVELS, NO_CAUSE, OPTIONAL, OTHERS, Scope, combine, is_alarm
from vestige.records import Outcome, Status
from vestige.records.checks import CheckName

STATUSES = tuple(Status)


@pytest.mark.parametrize(
    ("given_", "outcomes"),
    [
        ({"noise_power": 1.0, "tap": [[5]], "range_offset_m": 0.0}, "pp"),
        ({"noise_power": 1.0, "tap": [[5]], "range_offset_m": 26.5}, "pp"),
        ({"noise_power": 1.0, "tap": [[5]], "range_offset_m": -26.5}, "pp"),
        ({"noise_power": 1.0, "tap": [[5]], "range_offset_m": 26.7}, "pf"),
        ({"noise_power": 1.0, "tap": [[5]], "range_offset_m": -50.0}, "pf"),
        ({"noise_power": 1.0, "predicted_pd": 0.99}, "fn"),
        ({"noise_power": 1.0, "predicted_pd": 0.9}, "fn"),
        ({"noise_power": 1.0, "predicted_pd": np.nextafter(0.9, 0)}, "nn"),
        ({"noise_power": 1.0}, "nn"),
        ({}, "nn"),
    ],
)
def test_the_minimum_defence(given_: dict[str, object], outcomes: str) -> None:
    names = {"p": Outcome.PASS, "f": Outcome.FAIL, "n": Outcome.NOT_RUN}
    found = [outcome(check, evidence(**given_)) for check in (E6PowerCheck(), RangeCheck())]  # type: ignore[arg-type]
    assert [one.outcome for one in found] == [names[letter] for letter in outcomes]
    assert all(one.reason for one in found if one.outcome is not Outcome.PASS)


def test_the_range_limit_is_kappa_sigma_and_passes_itself() -> None:
    """3σ of the uncorrected budget is 26.6 m (protocol reference, receiver test)."""
    limit_m = RangeCheck().limit_m
    assert limit_m == pytest.approx(26.6, abs=0.05)
    for sign in (-1.0, 1.0):
        for of_limit, expected in ((1.0, Outcome.PASS), (1.0 + 1e-12, Outcome.FAIL)):
            assert outcome(RangeCheck(), evidence(range_offset_m=sign * of_limit * limit_m)).outcome is expected


@pytest.mark.parametrize(
    ("name", "status"),
    [
        (CheckName.E6_POWER, Status.NOT_DETECTED),
        (CheckName.E1_E6_RANGE, Status.SPOOFED),
        (CheckName.E6_SECOND_SIGNAL, Status.SPOOFED),  # somebody sends what the satellite did not
        (CheckName.E1_VESTIGIAL_SEARCH, Status.SPOOFED),
        (CheckName.E6_EXHAUSTIVE_SEARCH, Status.SPOOFED),
        (CheckName.OSNMA_AGREEMENT, Status.SPOOFED),
    ],
)
def test_what_finds_a_second_sender_says_spoofed_and_all_else_is_suspicion(name: CheckName, status: Status) -> None:
    found, cause = combine(3, {name: np.array([[True]])}, np.ones((1, 1), np.bool_))
    assert STATUSES[found[0, 0]] is status
    assert LEVELS[3][cause[0, 0]].name is name
    graver = {spec.name for spec in LEVELS[3] if spec.failure is not Status.SUSPECT}
    assert len(graver) == 6
    assert name in graver


def test_levels_are_those_of_the_paper() -> None:
    """[WFO, Sec. IV]: level 2 adds steps 3 to 5; level 3 replaces 4 and 5, and bridges."""
    steps = {level: {spec.step for spec in specs} for level, specs in LEVELS.items()}
    assert steps == {1: {1, 2}, 2: {1, 2, 3, 4, 5}, 3: {1, 2, 3, 4, 5, 7}}
    names = {level: [spec.name for spec in specs] for level, specs in LEVELS.items()}
    assert set(names[1]) < set(names[2]) < set(names[3])
    assert set(names[3]) | {spec.name for spec in OPTIONAL} == set(CheckName)
    assert all(len(set(of_level)) == len(of_level) for of_level in names.values())
    assert "E6 exhaustive search" not in names[2]


def test_only_the_check_that_errs_by_itself_is_confirmed() -> None:
    """Power–distortion fails of itself in 0.6 % of its tests [WESSON18], of three in a row in 2e-7."""
    assert {spec.name: spec.confirm for spec in LEVELS[3] if spec.confirm != 1} == {"power-distortion": 3}


@pytest.mark.parametrize(
    ("failing", "status"),
    [
        ((), Status.AUTHENTIC),
        ((CheckName.E1_CN0,), Status.SUSPECT),
        ((CheckName.RAIM, CheckName.E6_POWER), Status.NOT_DETECTED),
        ((CheckName.E6_POWER, CheckName.E1_VESTIGIAL_SEARCH), Status.SPOOFED),
        ((CheckName.E1_RECEIVED_POWER, CheckName.E1_E6_RANGE), Status.SPOOFED),
        ((CheckName.POWER_DISTORTION,), Status.AUTHENTIC),  # is of level 3
    ],
)
def test_the_gravest_failure_counts(failing: tuple[CheckName, ...], status: Status) -> None:
    failed = {spec.name: np.array([[spec.name in failing]]) for spec in LEVELS[3]}
    for some in (failed, dict(reversed(failed.items()))):
        assert STATUSES[combine(2, some, np.ones((1, 1), np.bool_))[0][0, 0]] is status


@pytest.mark.parametrize("name", [CheckName.E1_VESTIGIAL_SEARCH, CheckName.E6_EXHAUSTIVE_SEARCH])
@pytest.mark.parametrize("level", [2, 3])
def test_who_sends_one_satellite_twice_may_send_them_all(name: CheckName, level: int) -> None:
    of_level = name in {spec.name for spec in LEVELS[level]}
    failed = {name: np.array([[False, True, False]]), CheckName.E1_E6_RANGE: np.array([[False, False, True]])}
    status, cause = combine(level, failed, np.ones((1, 3), np.bool_))
    expected = [Status.SUSPECT, Status.SPOOFED] if of_level else [Status.AUTHENTIC, Status.AUTHENTIC]
    assert [STATUSES[one] for one in status[0]] == [*expected, Status.SPOOFED]
    assert cause[0, 0] == (OTHERS if of_level else NO_CAUSE)
    own = failed | {CheckName.E1_CN0: np.array([[True, False, False]])}
    assert LEVELS[level][combine(level, own, np.ones((1, 3), np.bool_))[1][0, 0]].name is CheckName.E1_CN0


@given(st.sampled_from(sorted(LEVELS)), st.data())
def test_the_status_is_that_of_the_gravest_failure_written_out(level: int, data: st.DataObject) -> None:
    specs = LEVELS[level]
    letters = data.draw(st.lists(st.text("pfn", min_size=len(specs), max_size=len(specs)), min_size=1, max_size=5))
    failed = {
        spec.name: np.array([[one[k] == "f"] if spec.scope is Scope.SATELLITE else one[k] == "f" for one in letters])
        for k, spec in enumerate(specs)
    }
    available = np.array([[one[0] != "n"] for one in letters])
    status, _ = combine(level, failed, available)
    gravity = [Status.NOT_AVAILABLE, Status.AUTHENTIC, Status.SUSPECT, Status.NOT_DETECTED, Status.SPOOFED]
    for found, one in zip(status[:, 0], letters, strict=True):
        failures = [spec.failure for spec, letter in zip(specs, one, strict=True) if letter == "f"]
        quiet = Status.AUTHENTIC if one[0] != "n" else Status.NOT_AVAILABLE
        assert STATUSES[found] is max([quiet, *failures], key=gravity.index)
        assert bool(is_alarm(np.array([found]))[0]) is bool(failures)


@given(
    st.lists(st.sampled_from("pfn"), min_size=1, max_size=30), st.integers(1, 4), st.integers(0, 4), st.integers(0, 30)
)
def test_confirmation_counts_failures_in_a_row(letters: list[str], confirm: int, streak: int, cut: int) -> None:
    failed, run = np.array([one == "f" for one in letters]), np.array([one != "n" for one in letters])
    streak, expected = min(streak, confirm), []
    count = streak
    for one in letters:
        count = count + 1 if one == "f" else count if one == "n" else 0
        expected.append(one == "f" and count >= confirm)
    before = np.array([streak])
    assert confirmed(failed, run, confirm, before).tolist() == expected
    assert confirmed(failed[:, None], run[:, None], confirm, before)[:, 0].tolist() == expected
