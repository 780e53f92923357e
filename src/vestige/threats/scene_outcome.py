"""Compute the outcome of an attack in many runs at a mitigation level, and compare this outcome with the expectation.

A statement about an attack is tested in many runs with different seeds. The statement is accepted if the exact
confidence interval of its probability lies above ½. If the interval contains ½, the runs are not conclusive. An
expectation is one of these words, with its statement:

    pass         without an attack: alarms, failed tests, and failures of each check are not more frequent than their
                 budgets allow, and failures with an exact budget are not less frequent than this budget
    detect       detected
    mitigate     mitigated
    miss         missed or denied, and not detected: the attack succeeds without an alarm
    deny         denied, and not missed
    partial      detected in about half of the runs: the interval contains ½

Checks can have budgets of failures. Let p be the Poisson probability of at least the counted number of failures.
A check exceeds its budget if p is below `ERROR` divided by the number of the level's checks that have a budget. So a
level whose checks all keep their budgets is reported to exceed a budget in at most 5 % of all measurements.

The outcome of a single run is defined in `campaign/run_outcome.py`. Some checks, such as clock and RAIM, use common
data of some seconds at neighbouring epochs. So failures of these checks occur in groups of up to `_GROUP`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from enum import Enum
from math import isfinite, nan
from statistics import median
from typing import Any

import numpy as np
from scipy.special import pdtrc

from vestige.acas_processor.levels import LEVELS, TestCadence
from vestige.campaign.range_errors import worst_of
from vestige.campaign.run_outcome import HALF, HARMLESS, OutcomeCounts, RunOutcome, outcome_word
from vestige.campaign.statistics import Proportion, count_interval, proportion
from vestige.constants import DAY_S

MIXED = "mixed"  # word for a scene in which no outcome occurs in more than half of the runs
ERROR = 0.05  # probability that a level whose checks all keep their budgets is reported to exceed a budget
_GROUP = 3  # largest number of failed tests that one event causes; neighbouring clock and RAIM tests use common data

# Checks that test once per RECS and satellite, so that neighbouring failures are separate events.
_WITH_RECS = {str(row.name) for level in LEVELS.values() for row in level if row.cadence is TestCadence.RECS}


class Agreement(Enum):
    """Agreement of a measured outcome with the expected outcome."""

    AGREES = "as expected"
    DIFFERS = "DIFFERS"
    UNDECIDED = "undecided"
    NOT_EXPECTED = ""  # the table has no expected outcome


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckShare:
    """Number of runs in which a check failed, and median time in s of its first failure in these runs."""

    name: str
    failed: Proportion
    time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckBudget:
    """Number of failures of a check, and number of failures that the check's own budget allows without an attack."""

    name: str
    failures: int  # number of tests that failed, after confirmation
    budget: float

    def exceeded(self, checks: int) -> bool:
        """Return whether failures significantly exceed the budget; `checks` is the number of checks with a budget."""
        group = 1 if self.name in _WITH_RECS else _GROUP
        return poisson_tail(math.ceil(self.failures / group), self.budget / group) < ERROR / checks


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneOutcome(OutcomeCounts):
    """Outcome of an attack in many runs at one level; counts are sums over all runs."""

    # Share of the runs with each outcome.
    detected: Proportion
    mitigated: Proportion
    protected: Proportion
    missed: Proportion
    denied: Proportion
    succeeded: Proportion  # share of the runs that are missed or denied
    harmless: Proportion  # share of the runs that are neither detected nor missed nor denied
    # Share of the runs without the attack that have an alarm in the same epochs. A scene without an attack has none of
    # these runs.
    by_chance: Proportion
    checks: tuple[CheckShare, ...]  # checks that failed in any run, sorted by frequency, then by time of the failure
    budgets: tuple[CheckBudget, ...] = ()  # failures and budget of each check that has a budget
    time_to_detect_s: float  # median time in s from attack to alarm in runs with an alarm; NaN without any alarm
    worst_range_m: float  # error of a range in use with the largest magnitude in all runs, with its sign, in m
    worst_position_m: float  # largest error in m of a position in use, in all runs

    def a_day(self, name: str) -> tuple[float, float, float]:
        """Return the daily rate of a count, and the limits of the exact confidence interval of the rate."""
        return tuple(one * DAY_S / self.duration_s for one in count_interval(getattr(self, name)))  # type: ignore[return-value]

    @property
    def word(self) -> str:
        """Outcome that more than half of the runs have, in a few words; `MIXED` if there is no such outcome."""
        shares = (self.detected, self.mitigated, self.missed, self.denied)
        word = outcome_word(*(share.value > HALF for share in shares))
        return MIXED if word == HARMLESS and self.harmless.value <= HALF else word

    @property
    def exceeded(self) -> tuple[CheckBudget, ...]:
        """Checks that failed significantly more often than their own budgets allow."""
        return tuple(one for one in self.budgets if one.exceeded(len(self.budgets)))

    @property
    def keeps_budget(self) -> bool:
        """Whether alarms and failed tests keep their budgets, and checks with an exact budget fail often enough."""
        bounds = (
            (self.alarms, self.budget_alarms),
            (self.failures / _GROUP, self.budget_failures / _GROUP),
            (self.exact_failures / _GROUP, self.budget_exact_failures / _GROUP),
            (self.range_failures / _GROUP, self.budget_range_failures / _GROUP),
        )
        enough = count_interval(self.exact_failures / _GROUP)[2] >= self.budget_exact_failures / _GROUP
        return enough and not self.exceeded and all(count_interval(count)[1] <= budget for count, budget in bounds)


def scene_outcome(runs: Sequence[RunOutcome], chance: Sequence[RunOutcome]) -> SceneOutcome:
    """Return the outcome of a scene at one level, from `runs` with the attack and from `chance` without the attack."""

    def share(name: str) -> Proportion:
        return proportion(sum(getattr(run, name) for run in runs), len(runs))

    counts: dict[str, Any] = {one.name: sum(getattr(run, one.name) for run in runs) for one in fields(OutcomeCounts)}
    shares: dict[str, Any] = {name: share(name) for name in ("detected", "mitigated", "protected", "missed", "denied")}
    times_s = [run.time_to_detect_s for run in runs if isfinite(run.time_to_detect_s)]
    return SceneOutcome(
        **shares,
        **counts,
        succeeded=proportion(sum(run.missed or run.denied for run in runs), len(runs)),
        harmless=proportion(sum(not (run.detected or run.missed or run.denied) for run in runs), len(runs)),
        by_chance=proportion(sum(run.detected for run in chance), len(chance)),
        checks=_check_shares(runs),
        budgets=_check_budgets(runs),
        time_to_detect_s=median(times_s) if times_s else nan,
        worst_range_m=worst_of(np.array([run.worst_range_m for run in runs])),
        worst_position_m=worst_of(np.array([run.worst_position_m for run in runs])),
    )


def _check_shares(runs: Sequence[RunOutcome]) -> tuple[CheckShare, ...]:
    times_s: dict[str, list[float]] = {}
    for run in runs:
        for entry in filter(None, run.checks.split("; ")):
            name, _, time = entry.rpartition(" ")
            times_s.setdefault(name, []).append(float(time))
    shares = [
        CheckShare(name=name, failed=proportion(len(times), len(runs)), time_s=median(times))
        for name, times in times_s.items()
    ]
    return tuple(sorted(shares, key=lambda one: (-one.failed.successes, one.time_s)))


def _check_budgets(runs: Sequence[RunOutcome]) -> tuple[CheckBudget, ...]:
    sums: dict[str, tuple[int, float]] = {}
    for run in runs:
        for entry in filter(None, run.budgets.split("; ")):
            name, failures, budget = entry.rsplit(" ", 2)
            before = sums.get(name, (0, 0.0))
            sums[name] = before[0] + int(failures), before[1] + float(budget)
    return tuple(CheckBudget(name=name, failures=failures, budget=budget) for name, (failures, budget) in sums.items())


def poisson_tail(count: int, mean: float) -> float:
    """Return the Poisson probability of `count` or more events, if their mean number is `mean`."""
    return float(pdtrc(count - 1, mean)) if count > 0 else 1.0


def agreement(expected: str, found: SceneOutcome) -> Agreement:
    """Return how a measurement compares with an expected outcome; an empty string means no expectation.

    The function raises `ValueError` if the expected outcome is unknown.
    """
    if not expected:
        return Agreement.NOT_EXPECTED
    often, seldom = _often, _seldom
    kept = found.keeps_budget
    rules: Mapping[str, tuple[bool, bool]] = {
        "pass": (kept, not kept),
        "detect": (often(found.detected), seldom(found.detected)),
        "mitigate": (often(found.mitigated), seldom(found.mitigated)),
        "miss": (often(found.succeeded) and seldom(found.detected), seldom(found.succeeded) or often(found.detected)),
        "deny": (often(found.denied) and seldom(found.missed), seldom(found.denied) or often(found.missed)),
        "partial": (
            not often(found.detected) and not seldom(found.detected),
            often(found.detected) or seldom(found.detected),
        ),
    }
    if expected not in rules:
        raise ValueError(f"outcome: found {expected!r}, expected one of {', '.join(rules)}")
    holds, fails = rules[expected]
    return Agreement.AGREES if holds else Agreement.DIFFERS if fails else Agreement.UNDECIDED


def _often(found: Proportion) -> bool:
    return found.low > HALF


def _seldom(found: Proportion) -> bool:
    return found.high < HALF
