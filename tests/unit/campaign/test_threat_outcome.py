from __future__ import annotations

from math import isnan, nan

import numpy as np
import pytest

from vestige.campaign.statistics import proportion
from vestige.campaign.threat_outcome import (
    Agreement,
    RunOutcome,
    SceneOutcome,
    agreement,
    run_outcome,
    scene_outcome,
)
from vestige.records import Status

A, P, S, D, N = (
    list(Status).index(status)
    for status in (Status.AUTHENTIC, Status.SUSPECT, Status.SPOOFED, Status.NOT_DETECTED, Status.NOT_AVAILABLE)
)
LIMIT_M = 26.0


def of(status: list[int], error_m: list[float] | None = None, first: int = 0) -> RunOutcome:
    """Return what came of a run with a RECS each 30 s, attacked from `first` on."""
    results = {"time_s": 30.0 * np.arange(len(status)), "status": np.array(status, np.int8)[:, None]}
    if error_m is not None:
        results["truth_e1_worst_error_m"] = np.array(error_m)[:, None]
    return run_outcome(results, np.arange(len(status)) >= first, LIMIT_M)


def test_an_attack_that_is_accepted_is_missed() -> None:
    found = of([A] * 8, [0, 0, 10, 40, -60, 80, 100, 120])
    assert (found.detected, found.missed, found.mitigated, found.denied) == (False, True, False, False)
    assert found.worst_accepted_m == 120
    assert isnan(found.time_to_detect_s)


@pytest.mark.parametrize("alarm", [P, S, D])
def test_an_alarm_before_any_harm(alarm: int) -> None:
    found = of([alarm, A, A, A, alarm, alarm, alarm, alarm], [0, 0, 0, 51.9, 80, 100, 120, 140], first=1)
    assert (found.detected, found.missed, found.mitigated) == (True, False, True)
    assert found.time_to_detect_s == 90.0  # of the epochs from the first attacked one on
    assert (found.epochs, found.alarms) == (7, 4)
    assert found.worst_accepted_m == 51.9


def test_harmful_is_beyond_twice_what_the_range_test_allows() -> None:
    assert not of([A] * 4, [0, 0, 0, -2 * LIMIT_M]).missed
    assert of([A] * 4, [0, 0, 0, -2.001 * LIMIT_M]).missed


def test_harm_that_ends_in_an_alarm_was_missed_and_is_mitigated() -> None:
    found = of([A, A, A, S, S, S, S, S], [0, 60, 100, 200, 300, 300, 300, 300])
    assert (found.detected, found.missed, found.mitigated) == (True, True, True)


def test_an_alarm_that_ends_in_harm_is_not_mitigated() -> None:
    found = of([A, S, S, A, A, A, A, A], [0, 60, 100, 200, 300, 300, 300, 300])
    assert (found.detected, found.missed, found.mitigated) == (True, True, False)


def test_no_verdict_does_no_harm() -> None:
    found = of([N, N, N, A], [500, 500, 500, 0])
    assert (found.detected, found.missed, found.mitigated, found.denied) == (False, False, True, True)
    assert not of([N, N, A, A], [0, 0, 0, 0]).denied  # more than half


def test_without_an_attack_and_without_epochs() -> None:
    assert of([A, A, D]) == RunOutcome(
        epochs=3, alarms=1, detected=True, mitigated=True, missed=False, denied=False,
        time_to_detect_s=60.0, worst_accepted_m=0.0,
    )  # fmt: skip
    none = of([A, A], [0, 0], first=5)
    assert (none.epochs, none.detected, none.missed, none.denied) == (0, False, False, False)


def _run(**what: bool | int | float) -> RunOutcome:
    usual = {"epochs": 10, "alarms": 0, "detected": False, "mitigated": True, "missed": False, "denied": False}
    return RunOutcome(**({"time_to_detect_s": nan, "worst_accepted_m": nan} | usual | what))  # type: ignore[arg-type]


def test_a_scene_counts_its_runs() -> None:
    runs = [
        _run(detected=True, alarms=4, time_to_detect_s=30.0, worst_accepted_m=-90.0),
        _run(detected=True, alarms=1, time_to_detect_s=90.0, worst_accepted_m=20.0, missed=True, mitigated=False),
        _run(denied=True),
    ]
    found = scene_outcome(runs, [_run(detected=True), _run(), _run()], interval_s=30.0, kappa=3.0)
    assert (found.detected, found.mitigated) == (proportion(2, 3), proportion(2, 3))
    assert (found.missed, found.denied, found.by_chance) == (proportion(1, 3), proportion(1, 3), proportion(1, 3))
    assert found.alarms == proportion(5, 30)
    assert (found.time_to_detect_s, found.worst_accepted_m) == (60.0, -90.0)
    assert found.alarms_a_day[0] == pytest.approx(2880 * 5 / 30)


def _scene(n: int = 20, **counts: int) -> SceneOutcome:
    usual = {"detected": 0, "mitigated": n, "missed": 0, "denied": 0, "by_chance": 0}
    shares = {name: proportion(count, n) for name, count in (usual | counts).items() if name != "alarms"}
    return SceneOutcome(
        **shares, alarms=proportion(counts.get("alarms", 0), 1000), time_to_detect_s=nan, worst_accepted_m=nan,
        interval_s=30.0, kappa=3.0,
    )  # fmt: skip


YES, NO, MAYBE = Agreement.AGREES, Agreement.DIFFERS, Agreement.UNDECIDED


@pytest.mark.parametrize(
    ("expected", "counts", "how"),
    [
        ("detect", {"detected": 20}, YES),
        ("detect", {"detected": 10}, MAYBE),
        ("detect", {"detected": 0}, NO),
        ("miss", {"missed": 20}, YES),
        ("miss", {"missed": 20, "detected": 20}, NO),
        ("miss", {"missed": 20, "detected": 10}, MAYBE),
        ("miss", {}, NO),
        ("mitigate", {"detected": 20}, YES),
        ("mitigate", {"mitigated": 1}, NO),
        ("deny", {"denied": 20}, YES),
        ("deny", {"denied": 20, "missed": 20}, NO),
        ("deny", {}, NO),
        ("partial", {"detected": 10}, YES),
        ("partial", {"detected": 20}, NO),
        ("pass", {"alarms": 0}, YES),
        ("pass", {"alarms": 3}, YES),  # of 1000, 2.7 are allowed
        ("pass", {"alarms": 30}, NO),
        ("", {}, Agreement.NOT_EXPECTED),
    ],
)
def test_agreement(expected: str, counts: dict[str, int], how: Agreement) -> None:
    assert agreement(expected, _scene(**counts)) is how


def test_agreement_with_nothing_known() -> None:
    with pytest.raises(ValueError, match="perhaps"):
        agreement("perhaps", _scene())
