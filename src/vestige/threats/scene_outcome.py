"""What came of an attack at one mitigation level, run by run: detected, mitigated, missed, denied.

Theory of operation
-------------------
A run is one campaign with one attack; *attacked* are its epochs from the attack's start to its stop. `levels.py` says
what a level makes of it: statuses, and with every RECS the ranges that are in use, with the largest error that the
attack made of them since the RECS before. What the RECS after the stop says of that time counts as well. An error is
*harmful* beyond twice what the range test allows, 2κσ: smaller ones may pass because the noise of E6 makes up for them.
Of a run is said, and more than one may be true,

    detected     an alarm (SUSPECT, SPOOFED, NOT_DETECTED) of any satellite while the attack acts or with the RECS after
    missed       a harmful range was in use at any time
    protected    none was in the last quarter of the attack
    mitigated    protected, and in the last quarter more than half of the ranges were in use: the receiver goes on
    denied       in more than half of the attacked RECS of a satellite there was no verdict (NOT_AVAILABLE)

A statement about an attack is made of many runs with other seeds, and holds if the exact interval of its probability
lies above one half. Where the interval holds one half, nothing is said. An expectation is such a statement:

    pass         without an attack neither alarms nor failures of single tests are more frequent than their budget,
                 nor failures less frequent where the budget is exact
    detect       detected
    mitigate     mitigated
    miss         missed or denied, and not detected: the attack succeeds unnoticed
    deny         denied, and not missed
    partial      detected, and not: the interval holds one half

**False alarms.** A user sees alarms that are held: one begins where none stood before. Their budget is an upper bound,
and nearly all of it is that of the range check, whose σ is wider than the errors: it is given apart. So the failures of
single tests are counted beside them: of the checks whose probability is the budget's choice, against the number that it
gives them; of those among them that are exact (`alarm_budget.EXACT`), on both sides; and of the range check, against
its bound. Neighbouring epochs share the noise of some seconds, so that failures come in groups of up to `_GROUP`.

All functions are pure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from enum import Enum
from math import isfinite, nan
from statistics import median
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from vestige.acas_processor.alarm_budget import EXACT, RANGE
from vestige.acas_processor.levels import ALARMS
from vestige.campaign.levels import LevelVerdicts
from vestige.campaign.outcomes import position
from vestige.campaign.statistics import Proportion, count_interval, proportion
from vestige.records import Status
from vestige.records.checks import CheckName

DAY_S = 86_400.0
_HALF = 0.5
_LAST = 0.25  # of the attack's RECS: how it ends
_HARMFUL = 2.0  # times κσ
_SUMS = (
    "alarms",
    "budget_alarms",
    "budget_range_alarms",
    "failures",
    "budget_failures",
    "exact_failures",
    "budget_exact_failures",
    "range_failures",
    "budget_range_failures",
    "duration_s",
)
_GROUP = 3  # failures of one event: the clock's checks look at the same nine seconds, RAIM at the same slow errors


class Agreement(Enum):
    """How a measurement compares with an expectation."""

    AGREES = "as expected"
    DIFFERS = "DIFFERS"
    UNDECIDED = "undecided"
    NOT_EXPECTED = ""  # nothing was


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOutcome:
    """What came of one run at one level.

    Attributes
    ----------
    duration_s
        How long the epochs that count are: those of the attack, or all if there is none.
    alarms, budget_alarms
        Alarms that began in them, and how many the budget allows.
    budget_range_alarms
        The range check's part of that.
    failures, budget_failures
        Tests that failed, of the checks whose p_fa is chosen, and how many the budget gives them.
    exact_failures, budget_exact_failures
        The same of those among them whose budget is exact.
    range_failures, budget_range_failures
        The same of the range check, whose p_fa is a bound.
    detected, mitigated, protected, missed, denied
        See the top of this module; without an attack only `detected` can be true, by chance.
    time_to_detect_s
        From the first attacked epoch to the first with an alarm; NaN if there is none.
    checks
        Each check that failed, with the time of its first failure after the first attacked epoch in s, the earliest
        first: `C/N0 0; RAIM 31`.
    worst_range_m, worst_position_m
        Errors of largest magnitude of a range and of a position that were in use; NaN if nothing was.
    """

    duration_s: float
    alarms: int
    budget_alarms: float
    budget_range_alarms: float
    failures: int
    budget_failures: float
    exact_failures: int
    budget_exact_failures: float
    range_failures: int
    budget_range_failures: float
    detected: bool
    mitigated: bool
    protected: bool
    missed: bool
    denied: bool
    time_to_detect_s: float
    checks: str
    worst_range_m: float
    worst_position_m: float

    @property
    def word(self) -> str:
        """What came of it in one or two words."""
        return _word(self.detected, self.mitigated, self.missed, self.denied)


def run_outcome(
    found: LevelVerdicts,
    time_s: Float[np.ndarray, " n"],
    attacked: Bool[np.ndarray, " n"],
    limit_m: float,
    position_m: Float[np.ndarray, " n"],
) -> RunOutcome:
    """Return what came of one run at one level.

    Parameters
    ----------
    found
        What the level makes of the results.
    time_s
        Of the epochs.
    attacked
        Which epochs count.
    limit_m
        What the range test allows, κσ.
    position_m
        Error of the position in use; NaN where there is none.
    """
    alarm = np.isin(found.status, [position(one) for one in ALARMS]).any(axis=1)
    here = np.flatnonzero(attacked)
    with_recs = _recs_of(attacked, found.recs)
    counted = attacked | with_recs
    error_m = found.range_error_m[with_recs]
    harmful = np.abs(error_m) > _HARMFUL * limit_m
    last = max(1, round(_LAST * error_m.shape[0]))
    seen = found.seen[with_recs]
    use = np.isfinite(error_m[-last:][seen[-last:]])
    none = found.status[with_recs][seen] == position(Status.NOT_AVAILABLE)
    first = np.flatnonzero(alarm & counted)
    begin_s = float(time_s[here[0]]) if here.size else nan
    duration_s = here.size * float(np.median(np.diff(time_s))) if time_s.size > 1 else 0.0
    chosen = {name for name, share in found.budget.items() if share.chosen}
    failures, budget_failures = _failures(found, attacked, chosen)
    exact_failures, budget_exact = _failures(found, attacked, chosen & EXACT)
    range_failures, budget_range = _failures(found, attacked, {RANGE})
    range_share = found.budget.get(RANGE)
    protected = not harmful[-last:].any()
    return RunOutcome(
        duration_s=duration_s,
        alarms=int(np.count_nonzero(found.begins & attacked)),
        budget_alarms=duration_s / DAY_S * sum(share.alarms_a_day for share in found.budget.values()),
        budget_range_alarms=duration_s / DAY_S * (0.0 if range_share is None else range_share.alarms_a_day),
        failures=failures,
        budget_failures=budget_failures,
        exact_failures=exact_failures,
        budget_exact_failures=budget_exact,
        range_failures=range_failures,
        budget_range_failures=budget_range,
        detected=bool(first.size),
        mitigated=bool(protected and use.size and np.mean(use) > _HALF),
        protected=bool(protected),
        missed=bool(harmful.any()),
        denied=bool(none.size and np.mean(none) > _HALF),
        time_to_detect_s=float(time_s[first[0]]) - begin_s if first.size else nan,
        checks="; ".join(f"{name} {float(time_s[place]) - begin_s:g}" for name, place in found.first_failures(counted)),
        worst_range_m=_worst(error_m),
        worst_position_m=_worst(position_m[with_recs]),
    )


def _failures(found: LevelVerdicts, attacked: Bool[np.ndarray, " n"], names: Set[CheckName | str]) -> tuple[int, float]:
    """Return how many tests of checks failed, and how many the budget gives them."""
    made = [name for name in found.failed if name in names and name in found.budget]
    return (
        sum(int(np.count_nonzero(found.failed[name][attacked])) for name in made),
        float(sum(found.budget[name].p_fa * np.count_nonzero(found.tests[name][attacked]) for name in made)),
    )


def _word(detected: bool, mitigated: bool, missed: bool, denied: bool) -> str:
    if mitigated and (detected or missed):
        return "mitigated late" if missed else "mitigated"
    if missed:
        return "detected, missed" if detected else "missed"
    if detected:
        return "detected"
    return "no verdict" if denied else "no alarm, no harm"


def _recs_of(attacked: Bool[np.ndarray, " n"], recs: Bool[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Return the RECS that an attack can have to do with: it acted since the RECS before, be it over by now."""
    places = np.flatnonzero(recs)
    acted = np.diff(np.cumsum(attacked)[places], prepend=0) > 0
    found = np.zeros(recs.size, np.bool_)
    found[places[acted]] = True
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckShare:
    """In how many runs a check failed, and the median time of its first failure in those."""

    name: str
    failed: Proportion
    time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneOutcome:
    """What came of an attack in many runs at one level.

    Attributes
    ----------
    detected, mitigated, protected, missed, denied
        Runs of which it is true.
    succeeded
        Runs that are missed or denied.
    by_chance
        Runs without the attack that have an alarm in the same epochs; none were made if the scene has no attack.
    checks
        Those that failed in any run, the most frequent and then the earliest first.
    alarms, budget_alarms, budget_range_alarms, failures, budget_failures, exact_failures, budget_exact_failures
        Sums over all runs.
    range_failures, budget_range_failures, duration_s
        Sums over all runs.
    time_to_detect_s
        Median of the runs with an alarm; NaN without any.
    worst_range_m, worst_position_m
        Of all runs.
    """

    detected: Proportion
    mitigated: Proportion
    protected: Proportion
    missed: Proportion
    denied: Proportion
    succeeded: Proportion
    by_chance: Proportion
    checks: tuple[CheckShare, ...]
    alarms: int
    budget_alarms: float
    budget_range_alarms: float
    failures: int
    budget_failures: float
    exact_failures: int
    budget_exact_failures: float
    range_failures: int
    budget_range_failures: float
    duration_s: float
    time_to_detect_s: float
    worst_range_m: float
    worst_position_m: float

    def a_day(self, name: str) -> tuple[float, float, float]:
        """Return how often a day something is that was counted, and the ends of the exact interval of its mean."""
        return tuple(one * DAY_S / self.duration_s for one in count_interval(getattr(self, name)))  # type: ignore[return-value]

    @property
    def word(self) -> str:
        """What came of it in most runs, in one or two words."""
        shares = (self.detected, self.mitigated, self.missed, self.denied)
        return _word(*(share.value > _HALF for share in shares))

    @property
    def keeps_budget(self) -> bool:
        """Whether alarms and failures of single tests are as frequent as their budgets allow."""
        bounds = (
            (self.alarms, self.budget_alarms),
            (self.failures / _GROUP, self.budget_failures / _GROUP),
            (self.exact_failures / _GROUP, self.budget_exact_failures / _GROUP),
            (self.range_failures / _GROUP, self.budget_range_failures / _GROUP),
        )
        enough = count_interval(self.exact_failures / _GROUP)[2] >= self.budget_exact_failures / _GROUP
        return enough and all(count_interval(count)[1] <= budget for count, budget in bounds)


def scene_outcome(runs: Sequence[RunOutcome], chance: Sequence[RunOutcome]) -> SceneOutcome:
    """Return what came of the runs of a scene at one level, and of those without its attack."""

    def share(name: str) -> Proportion:
        return proportion(sum(getattr(run, name) for run in runs), len(runs))

    counts: dict[str, Any] = {name: sum(getattr(run, name) for run in runs) for name in _SUMS}
    shares: dict[str, Any] = {name: share(name) for name in ("detected", "mitigated", "protected", "missed", "denied")}
    times_s = [run.time_to_detect_s for run in runs if isfinite(run.time_to_detect_s)]
    return SceneOutcome(
        **shares,
        **counts,
        succeeded=proportion(sum(run.missed or run.denied for run in runs), len(runs)),
        by_chance=proportion(sum(run.detected for run in chance), len(chance)),
        checks=_check_shares(runs),
        time_to_detect_s=median(times_s) if times_s else nan,
        worst_range_m=_worst(np.array([run.worst_range_m for run in runs])),
        worst_position_m=_worst(np.array([run.worst_position_m for run in runs])),
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


def _worst(values: Float[np.ndarray, "..."]) -> float:
    known = values[np.isfinite(values)]
    return float(known[np.argmax(np.abs(known))]) if known.size else nan


def agreement(expected: str, found: SceneOutcome) -> Agreement:
    """Return how a measurement compares with an expected outcome; an empty one is none.

    Raises
    ------
    ValueError
        If there is no such outcome.
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
        raise ValueError(f"outcome {expected!r}: {', '.join(rules)}")
    holds, fails = rules[expected]
    return Agreement.AGREES if holds else Agreement.DIFFERS if fails else Agreement.UNDECIDED


def _often(found: Proportion) -> bool:
    return found.low > _HALF


def _seldom(found: Proportion) -> bool:
    return found.high < _HALF
