from __future__ import annotations

from dataclasses import dataclass, replace
from math import isnan, nan
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vestige.campaign.levels import LevelVerdicts
from vestige.campaign.run_outcome import RunOutcome, run_outcome
from vestige.campaign.statistics import count_interval, proportion
from vestige.records import Status
from vestige.records.checks import AlarmShare, CheckName
from vestige.threats.scene_outcome import Agreement, CheckBudget, SceneOutcome, agreement, poisson_tail, scene_outcome

A, P, S, D, N = (
    list(Status).index(status)
    for status in (Status.AUTHENTIC, Status.SUSPECT, Status.SPOOFED, Status.NOT_DETECTED, Status.NOT_AVAILABLE)
)
LIMIT_M = 26.0


@dataclass(frozen=True, kw_only=True)
class Verdicts:
    """What a level says, made up: the part of `LevelVerdicts` that outcomes look at."""

    status: np.ndarray
    state: np.ndarray
    tests: dict[CheckName, np.ndarray]
    failed: dict[CheckName, np.ndarray]
    budget: dict[CheckName, AlarmShare]
    recs: np.ndarray
    seen: np.ndarray
    range_error_m: np.ndarray

    alarm = LevelVerdicts.alarm
    begins = LevelVerdicts.begins
    first_failures = LevelVerdicts.first_failures


def verdicts_of(status: list[int], used_m: list[float] | None = None) -> Verdicts:
    """Return verdicts of one satellite with a RECS each 30 s; `used_m` are ranges in use."""
    column = np.array(status, np.int8)[:, None]
    n, everywhere = len(status), np.ones((len(status), 1), np.bool_)
    return Verdicts(
        status=column,
        state=column,
        tests={CheckName.E1_CN0: everywhere},
        failed={CheckName.E1_CN0: column == P},
        budget={CheckName.E1_CN0: AlarmShare(p_fa=0.01, alarms_a_day=28.8, chosen=True)},
        recs=np.ones(n, np.bool_),
        seen=everywhere,
        range_error_m=np.array([0.0] * n if used_m is None else used_m, dtype=np.float64)[:, None],
    )


def of(status: list[int], used_m: list[float] | None = None, first: int = 0) -> RunOutcome:
    """Return what came of such a run, attacked from `first` on."""
    found, n = verdicts_of(status, used_m), len(status)
    position_m = np.abs(found.range_error_m[:, 0]) / 2
    return run_outcome(found, 30.0 * np.arange(n), np.arange(n) >= first, LIMIT_M, position_m)


def test_a_wrong_range_in_use_without_an_alarm_is_missed() -> None:
    found = of([A] * 8, [0, 0, 10, 40, -60, 80, 100, 120])
    assert (found.detected, found.missed, found.protected, found.mitigated) == (False, True, False, False)
    assert (found.worst_range_m, found.worst_position_m) == (120, 60)
    assert isnan(found.time_to_detect_s)


@pytest.mark.parametrize("alarm", [P, S, D])
def test_an_alarm_with_nothing_in_use_protects_and_does_not_mitigate(alarm: int) -> None:
    found = of([alarm, A, A, A, *[alarm] * 4], [0, 0, 0, 51.9, nan, nan, nan, nan], first=1)
    assert (found.detected, found.missed, found.protected, found.mitigated) == (True, False, True, False)
    assert found.time_to_detect_s == 90.0  # of the epochs from the first attacked one on
    assert found.duration_s == 210.0
    assert found.worst_range_m == 51.9


def test_right_ranges_at_the_end_mitigate() -> None:
    found = of([S] * 8, [nan, nan, 90, nan, 2, 2, nan, 2])
    assert (found.detected, found.missed, found.protected, found.mitigated) == (True, True, True, False)
    assert of([S] * 8, [nan, nan, 90, nan, 2, 2, 2, 2]).mitigated
    assert not of([S] * 8, [2, 2, 2, 2, 2, 2, 2, 90]).protected


def test_harmful_is_beyond_twice_what_the_range_test_allows() -> None:
    assert not of([A] * 4, [0, 0, 0, -2 * LIMIT_M]).missed
    assert of([A] * 4, [0, 0, 0, -2.001 * LIMIT_M]).missed


def test_what_the_recs_after_an_attack_authenticates_is_counted() -> None:
    """An attack that is over before the next RECS: that RECS says AUTHENTIC of the ranges in between."""
    recs = np.arange(12) % 4 == 0
    attacked = np.isin(np.arange(12), (5, 6))
    used_m = np.where(np.arange(12) == 8, 90.0, np.where(recs, 0.0, nan))
    found = replace(verdicts_of([A] * 12, used_m.tolist()), recs=recs)
    outcome = run_outcome(found, 30.0 * np.arange(12), attacked, LIMIT_M, np.abs(used_m) / 2)
    assert (outcome.missed, outcome.detected, outcome.worst_range_m, outcome.worst_position_m) == (True, False, 90, 45)
    alarmed = replace(found, status=np.where(np.arange(12)[:, None] == 8, S, A).astype(np.int8))
    assert run_outcome(alarmed, 30.0 * np.arange(12), attacked, LIMIT_M, used_m).time_to_detect_s == 90.0
    later = replace(found, status=np.where(np.arange(12)[:, None] == 9, S, A).astype(np.int8))
    assert not run_outcome(later, 30.0 * np.arange(12), attacked, LIMIT_M, used_m).detected


@given(
    errors_m=arrays(np.float64, (12, 1), elements=st.sampled_from([nan, 0.0, 40.0, -53.0, 90.0, -400.0])),
    positions_m=arrays(np.float64, 12, elements=st.sampled_from([nan, 5.0, 700.0])),
    attacked=arrays(np.bool_, 12),
    every=st.integers(1, 5),
)
def test_no_wrong_range_or_position_in_use_is_left_out(
    errors_m: np.ndarray, positions_m: np.ndarray, attacked: np.ndarray, every: int
) -> None:
    recs = np.arange(12) % every == 0
    errors_m, positions_m = np.where(recs[:, None], errors_m, nan), np.where(recs, positions_m, nan)
    found = replace(verdicts_of([A] * 12), recs=recs, range_error_m=errors_m)
    outcome = run_outcome(found, 30.0 * np.arange(12), attacked, LIMIT_M, positions_m)
    ranges, places, since = [], [], False
    for epoch in range(12):  # an attack counts until the RECS that follows it
        since = since or bool(attacked[epoch])
        if recs[epoch] and since:
            ranges += [one for one in errors_m[epoch] if not isnan(one)]
            places += [positions_m[epoch]] if not isnan(positions_m[epoch]) else []
        since = since and not recs[epoch]
    assert outcome.missed == any(abs(one) > 2 * LIMIT_M for one in ranges)
    for worst, all_of_them in ((outcome.worst_range_m, ranges), (outcome.worst_position_m, places)):
        assert isnan(worst) if not all_of_them else abs(worst) == max(map(abs, all_of_them))


def test_no_verdict_is_denial() -> None:
    assert of([N, N, N, A], [nan, nan, nan, 0]).denied
    assert not of([N, N, A, A], [nan, nan, 0, 0]).denied  # more than half


def test_alarms_and_failures_are_counted_against_their_budget() -> None:
    found = of([A, P, P, A, S, A, A, A])
    assert (found.alarms, found.failures) == (2, 2)
    assert found.budget_alarms == pytest.approx(28.8 * 240 / 86_400)
    assert found.budget_failures == pytest.approx(0.08)
    assert found.checks == "C/N0 30"
    assert (found.exact_failures, found.budget_exact_failures, found.range_failures) == (0, 0.0, 0)
    assert found.budget_range_alarms == found.budget_range_failures == 0.0
    assert of([A, P, P, A], first=2).alarms == 0  # that one stood before


def test_the_range_check_and_exact_checks_are_counted_apart() -> None:
    found, n = verdicts_of([A, S, P, A]), 4
    names = (CheckName.E6_POWER, CheckName.E1_E6_RANGE, CheckName.RAIM)
    failed = {name: np.arange(n)[:, None] == place for place, name in enumerate(names, 1)}
    own = AlarmShare(p_fa=0.25, alarms_a_day=50.0, chosen=False)
    found = replace(
        found,
        tests=dict(found.tests) | dict.fromkeys(names, np.ones((n, 1), np.bool_)),
        failed=dict(found.failed) | failed,
        budget=dict(found.budget) | dict.fromkeys(names, own) | {CheckName.RAIM: replace(own, chosen=True, exact=True)},
    )
    outcome = run_outcome(found, 30.0 * np.arange(n), np.ones(n, np.bool_), LIMIT_M, np.full(n, nan))
    assert (outcome.failures, outcome.budget_failures) == (2, pytest.approx(0.04 + 1.0))
    assert (outcome.exact_failures, outcome.budget_exact_failures) == (1, 1.0)
    assert (outcome.range_failures, outcome.budget_range_failures) == (1, 1.0)
    assert outcome.budget_range_alarms == pytest.approx(50.0 * 120 / 86_400)
    assert outcome.budget_alarms == pytest.approx((28.8 + 150.0) * 120 / 86_400)


def test_without_epochs() -> None:
    none = of([A, A], [0, 0], first=5)
    assert (none.duration_s, none.detected, none.missed, none.denied, none.mitigated) == (
        0.0,
        False,
        False,
        False,
        False,
    )


def _run(**what: bool | int | float | str) -> RunOutcome:
    usual = {
        "duration_s": 86_400.0, "alarms": 0, "budget_alarms": 3.0, "budget_range_alarms": 2.0,
        "failures": 0, "budget_failures": 1.0, "exact_failures": 0, "budget_exact_failures": 0.5,
        "range_failures": 0, "budget_range_failures": 2.0,
        "detected": False, "mitigated": True, "protected": True, "missed": False, "denied": False, "checks": "",
        "budgets": "",
        "time_to_detect_s": nan, "worst_range_m": nan, "worst_position_m": nan,
    }  # fmt: skip
    return RunOutcome(**(usual | what))  # type: ignore[arg-type]


def test_a_scene_counts_its_runs() -> None:
    runs = [
        _run(detected=True, alarms=4, time_to_detect_s=30.0, worst_range_m=-90.0, checks="C/N0 2; RAIM 30"),
        _run(detected=True, alarms=1, time_to_detect_s=90.0, worst_range_m=20.0, missed=True, checks="C/N0 4"),
        _run(denied=True),
    ]
    found = scene_outcome(runs, [_run(detected=True), _run(), _run()])
    assert (found.detected, found.mitigated) == (proportion(2, 3), proportion(3, 3))
    assert (found.missed, found.denied, found.succeeded) == (proportion(1, 3), proportion(1, 3), proportion(2, 3))
    assert found.by_chance == proportion(1, 3)
    assert (found.alarms, found.budget_alarms, found.duration_s) == (5, 9.0, 3 * 86_400)
    assert (found.time_to_detect_s, found.worst_range_m) == (60.0, -90.0)
    assert found.a_day("alarms")[0] == pytest.approx(5 / 3)
    assert [(one.name, one.failed, one.time_s) for one in found.checks] == [
        ("C/N0", proportion(2, 3), 3.0),
        ("RAIM", proportion(1, 3), 30.0),
    ]


def test_the_interval_of_a_count() -> None:
    """Textbook: none seen, 3.689 at 95 %; five seen, 1.623 to 11.668."""
    assert count_interval(0) == pytest.approx((0, 0, 3.6889), abs=1e-4)
    assert count_interval(5) == pytest.approx((5, 1.6235, 11.6683), abs=1e-4)


SUMS = {
    "alarms": 0, "budget_alarms": 62.0, "budget_range_alarms": 61.0, "failures": 0, "budget_failures": 2.0,
    "exact_failures": 0, "budget_exact_failures": 1.0, "range_failures": 0, "budget_range_failures": 61.0,
    "duration_s": 86_400.0,
}  # fmt: skip


def _scene(n: int = 20, **counts: float) -> SceneOutcome:
    usual = {"detected": 0, "mitigated": 0, "protected": n, "missed": 0, "denied": 0, "succeeded": 0, "by_chance": 0}
    usual["harmless"] = n - max(int(counts.get(name, 0)) for name in ("detected", "missed", "denied"))
    shares = {name: proportion(int(counts.get(name, count)), n) for name, count in usual.items()}
    sums: dict[str, Any] = SUMS | {name: count for name, count in counts.items() if name in SUMS}
    return SceneOutcome(
        **shares, **sums, checks=(), time_to_detect_s=nan, worst_range_m=nan, worst_position_m=nan
    )  # fmt: skip


YES, NO, MAYBE = Agreement.AGREES, Agreement.DIFFERS, Agreement.UNDECIDED


@pytest.mark.parametrize(
    ("expected", "counts", "how"),
    [
        ("detect", {"detected": 20}, YES),
        ("detect", {"detected": 14}, MAYBE),  # 70 %, but the interval begins at 45.7 %
        ("detect", {"detected": 15}, YES),  # 50.9 %
        ("detect", {"detected": 10}, MAYBE),
        ("detect", {"detected": 6}, MAYBE),  # its end is 54.3 %
        ("detect", {"detected": 5}, NO),
        ("detect", {"detected": 0}, NO),
        ("miss", {"succeeded": 20}, YES),
        ("miss", {"succeeded": 20, "detected": 20}, NO),
        ("miss", {"succeeded": 20, "detected": 10}, MAYBE),
        ("miss", {}, NO),
        ("mitigate", {"mitigated": 20}, YES),
        ("mitigate", {"mitigated": 1}, NO),
        ("deny", {"denied": 20}, YES),
        ("deny", {"denied": 20, "missed": 20}, NO),
        ("deny", {}, NO),
        ("partial", {"detected": 10}, YES),
        ("partial", {"detected": 20}, NO),
        ("pass", {}, YES),
        ("pass", {"alarms": 7, "budget_alarms": 3.0}, YES),  # the interval of 7 begins at 2.81
        ("pass", {"alarms": 12, "budget_alarms": 3.0}, NO),
        ("pass", {"alarms": 60}, YES),  # of 62, if nothing else says that the budget is not kept
        ("pass", {"alarms": 60, "failures": 60}, NO),
        ("pass", {"failures": 6}, YES),  # two events of three epochs; their interval begins at 0.24, of 0.67
        ("pass", {"failures": 12}, NO),  # four events: 1.09
        ("pass", {"failures": 9, "exact_failures": 9, "budget_failures": 100.0}, NO),  # 0.62 of 0.33
        ("pass", {"budget_exact_failures": 11.0, "budget_failures": 11.0}, YES),  # none of 3.67; the end is 3.69
        ("pass", {"budget_exact_failures": 11.2, "budget_failures": 11.2}, NO),  # a test that is never done
        ("pass", {"failures": 0, "budget_failures": 90.0}, YES),  # a bound
        ("pass", {"range_failures": 90}, YES),
        ("pass", {"range_failures": 120}, NO),
        ("", {}, Agreement.NOT_EXPECTED),
    ],
)
def test_agreement(expected: str, counts: dict[str, int], how: Agreement) -> None:
    assert agreement(expected, _scene(**counts)) is how


@pytest.mark.parametrize(
    ("counts", "word"),
    [
        ({"detected": 20, "mitigated": 20}, "mitigated"),
        ({"detected": 20, "mitigated": 20, "missed": 20}, "mitigated late"),
        ({"detected": 20}, "detected"),
        ({"detected": 20, "missed": 20}, "detected, missed"),
        ({"missed": 20}, "missed"),
        ({"denied": 20}, "no verdict"),
        ({}, "no alarm, no harm"),
        ({"missed": 9}, "no alarm, no harm"),
        ({"missed": 10}, "mixed"),
        ({"detected": 10, "missed": 10, "harmless": 0}, "mixed"),
        ({"detected": 7, "missed": 7, "harmless": 6}, "mixed"),
    ],
)
def test_the_word_of_a_cell(counts: dict[str, int], word: str) -> None:
    assert _scene(**counts).word == word


def test_no_check_lends_its_budget_to_another() -> None:
    """E6 power fails 82 times where its own budget is 45; the range check, which never fails, has 62 to spare."""
    spare = CheckBudget(name="E1-E6 range", failures=0, budget=62.0)
    lent = CheckBudget(name="E6 power", failures=82, budget=45.0)
    scene = _scene(alarms=82, budget_alarms=107.0)
    assert agreement("pass", scene) is YES
    assert agreement("pass", replace(scene, budgets=(lent, spare))) is NO
    assert replace(scene, budgets=(lent, spare)).exceeded == (lent,)
    kept = replace(lent, failures=57)  # 3.1 % for 57 or more of 45, against 2.5 % for each of two checks
    assert agreement("pass", replace(scene, budgets=(kept, spare))) is YES
    assert agreement("pass", replace(scene, budgets=(kept,))) is NO


def test_failures_between_recs_are_counted_in_groups() -> None:
    clock = CheckBudget(name="clock slope", failures=3, budget=0.1)  # one event
    assert not clock.exceeded(1) or poisson_tail(1, 0.1 / 3) < 0.05
    assert replace(clock, failures=4).exceeded(1)
    assert CheckBudget(name="E6 power", failures=3, budget=0.1).exceeded(1)


def test_the_poisson_tail() -> None:
    assert poisson_tail(0, 2.0) == 1.0
    assert poisson_tail(1, 2.0) == pytest.approx(1 - np.exp(-2.0))


def test_runs_count_the_failures_of_each_check() -> None:
    outcome = of([A, P, P, A, S, A, A, A])
    assert outcome.budgets == "C/N0 2 0.08"
    (one,) = scene_outcome([outcome, outcome], []).budgets
    assert (one.name, one.failures, one.budget) == ("C/N0", 4, pytest.approx(0.16))


def test_agreement_with_nothing_known() -> None:
    with pytest.raises(ValueError, match="perhaps"):
        agreement("perhaps", _scene())
