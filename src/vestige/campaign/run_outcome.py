"""Compute the outcome of an attack in one run at one mitigation level: detected, mitigated, missed, denied.

Theory of operation
-------------------
A run is one campaign, with or without attacks. The caller gives a window of time, usually from the first start of an
attack to the last stop. The epochs in this window are *attacked*. Without an attack, all alarms in the window are false
alarms. `levels.py` gives the verdicts, the ranges in use, and the error of each range in use (`range_errors.py`). The
first RECS after the stop counts as well if an epoch since the previous RECS was attacked, because the verdict of this
RECS concerns that epoch, too. An error is *harmful* if the error exceeds twice the limit of the range check, 2κσ. The
noise of E6 can hide a smaller error from the range check. Several outcomes may be true for a run:

    detected     an alarm (SUSPECT, SPOOFED, NOT_DETECTED) of any satellite in attacked epochs or with the next RECS
    missed       a range with a harmful error was in use at any time
    protected    no range with a harmful error was in use in the last quarter of the attack
    mitigated    protected, and more than half of the ranges of satellites in view were in use in this quarter
    denied       more than half of the attacked RECS of the satellites in view had no verdict (NOT_AVAILABLE)

**False alarms.** An alarm begins in an epoch with an alarm if the previous epoch had no alarm. The budget of alarms is
an upper limit. Usually, nearly all of this budget belongs to the range check, whose assumed σ is larger than the
standard deviation of the real error. The budget of the range check is therefore given separately. Failures of single
tests are compared with their budgets in three groups:

* the checks whose probability can be chosen;
* the checks whose probability can be chosen and is exact (`AlarmShare.exact`), with a lower and an upper limit;
* the range check, whose budget is an upper limit.

`budgets` has two numbers for each check that has a budget: the number of its failures after confirmation, and the
number that the budget allows.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING, Protocol

import numpy as np
from jaxtyping import Bool, Float, Int8

from vestige.acas_processor.levels import POSITION, is_alarm
from vestige.campaign.columns.sky_columns import true_place_m
from vestige.campaign.levels import LevelVerdicts, level_verdicts
from vestige.campaign.range_errors import recs_since, worst_of
from vestige.constants import DAY_S
from vestige.records import Status
from vestige.records.checks import AlarmShare, CheckName
from vestige.scenario.campaign import CampaignScenario

if TYPE_CHECKING:
    import xarray

HALF = 0.5
HARMLESS = "no alarm, no harm"
_LAST = 0.25  # share of the attack's RECS that belongs to the last part of the attack
_HARMFUL = 2.0  # multiple of κσ above which an error is harmful


@dataclass(frozen=True, slots=True, kw_only=True)
class OutcomeCounts:
    """Counts of alarms and failed tests of a run or of many runs, and the numbers that the budgets allow."""

    duration_s: float  # duration of the attacked epochs; without an attack, duration of the window
    alarms: int  # number of alarms that began in the attacked epochs; without an attack, in the window
    budget_alarms: float  # number of alarms that the budget allows
    budget_range_alarms: float  # the range check's part of `budget_alarms`
    failures: int  # number of failed tests of the checks whose p_fa can be chosen
    budget_failures: float  # number of `failures` that the budget allows
    exact_failures: int  # number of failed tests of the checks whose p_fa can be chosen and is exact
    budget_exact_failures: float  # number of `exact_failures` that the budget allows
    range_failures: int  # number of failed tests of the range check, whose p_fa is an upper limit
    budget_range_failures: float  # number of `range_failures` that the budget allows


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOutcome(OutcomeCounts):
    """Outcome of one run at one level."""

    # outcomes as defined in the docstring of this module; without an attack `detected` means a false alarm
    detected: bool
    mitigated: bool
    protected: bool
    missed: bool
    denied: bool
    time_to_detect_s: float  # time from the first attacked epoch to the first alarm; NaN without alarm
    # each failed check with the time of its first failure in s after the first attacked epoch, in order of time:
    # `C/N0 0; RAIM 31`
    checks: str
    # each check with the number of its failed tests after confirmation, and the number that its budget allows:
    # `E6 power 3 2.9; RAIM 0 0.01`
    budgets: str
    # error of a range in use with the largest magnitude, with its sign; NaN if no range was in use
    worst_range_m: float
    worst_position_m: float  # largest error of a position in use; NaN if no position was in use

    @property
    def word(self) -> str:
        """Outcome of the run in at most four words."""
        return outcome_word(self.detected, self.mitigated, self.missed, self.denied)


class JudgedRun(Protocol):
    """Verdicts of a level on a run of n epochs and m satellites: the part of `LevelVerdicts` that outcomes need."""

    @property
    def status(self) -> Int8[np.ndarray, "n m"]:
        """Verdict of each satellite at each epoch, as the position in `Status`."""

    @property
    def recs(self) -> Bool[np.ndarray, " n"]:
        """Epochs with RECS."""

    @property
    def seen(self) -> Bool[np.ndarray, "n m"]:
        """Epochs and satellites in view."""

    @property
    def range_error_m(self) -> Float[np.ndarray, "n m"]:
        """Error of the range in use in m, as in `range_errors_m`; NaN if no range is in use."""

    @property
    def begins(self) -> Bool[np.ndarray, " n"]:
        """Epochs with an alarm of any satellite that are the first epoch or follow an epoch without alarms."""

    @property
    def budget(self) -> Mapping[CheckName | str, AlarmShare]:
        """Share of each check in the budget of false alarms."""

    @property
    def tests(self) -> Mapping[CheckName | str, Bool[np.ndarray, "*n"]]:
        """Epochs and satellites at which each check was made."""

    @property
    def failed(self) -> Mapping[CheckName | str, Bool[np.ndarray, "*n"]]:
        """Epochs and satellites at which each check failed."""

    def first_failures(self, rows: Bool[np.ndarray, " n"]) -> tuple[tuple[str, int], ...]:
        """Return the checks that failed in the selected epochs, each with its first failed epoch, in order of time."""


def run_outcome(
    found: JudgedRun,
    time_s: Float[np.ndarray, " n"],
    attacked: Bool[np.ndarray, " n"],
    limit_m: float,
    position_m: Float[np.ndarray, " n"],
) -> RunOutcome:
    """Return the outcome of one run at one level.

    `attacked` is True in the attacked epochs. `limit_m` is the limit of the range check, κσ. `position_m` is the error
    of the position in use, in m; NaN if no position is in use.
    """
    alarm = is_alarm(found.status).any(axis=1)
    here = np.flatnonzero(attacked)
    with_recs = recs_since(found.recs, attacked)
    counted = attacked | with_recs
    error_m = found.range_error_m[with_recs]
    harmful = np.abs(error_m) > _HARMFUL * limit_m
    last = max(1, round(_LAST * error_m.shape[0]))
    seen = found.seen[with_recs]
    use = np.isfinite(error_m[-last:][seen[-last:]])
    none = found.status[with_recs][seen] == POSITION[Status.NOT_AVAILABLE]
    first = np.flatnonzero(alarm & counted)
    begin_s = float(time_s[here[0]]) if here.size else nan
    duration_s = here.size * float(np.median(np.diff(time_s))) if time_s.size > 1 else 0.0
    chosen = {name for name, share in found.budget.items() if share.chosen}
    failures, budget_failures = _failures(found, attacked, chosen)
    exact_failures, budget_exact = _failures(found, attacked, {name for name in chosen if found.budget[name].exact})
    range_failures, budget_range = _failures(found, attacked, {CheckName.E1_E6_RANGE})
    range_share = found.budget.get(CheckName.E1_E6_RANGE)
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
        mitigated=bool(protected and use.size and np.mean(use) > HALF),
        protected=bool(protected),
        missed=bool(harmful.any()),
        denied=bool(none.size and np.mean(none) > HALF),
        time_to_detect_s=float(time_s[first[0]]) - begin_s if first.size else nan,
        checks="; ".join(f"{name} {float(time_s[place]) - begin_s:g}" for name, place in found.first_failures(counted)),
        budgets="; ".join(f"{name} {failed} {budget!r}" for name, failed, budget in _by_check(found, attacked)),
        worst_range_m=worst_of(error_m),
        worst_position_m=worst_of(position_m[with_recs]),
    )


def _failures(found: JudgedRun, attacked: Bool[np.ndarray, " n"], names: Set[CheckName | str]) -> tuple[int, float]:
    """Return the number of failed tests of the named checks in attacked epochs, and the number that budgets allow."""
    made = [name for name in found.failed if name in names and name in found.budget]
    return (
        sum(int(np.count_nonzero(found.failed[name][attacked])) for name in made),
        float(sum(found.budget[name].p_fa * np.count_nonzero(found.tests[name][attacked]) for name in made)),
    )


def _by_check(found: JudgedRun, attacked: Bool[np.ndarray, " n"]) -> Iterator[tuple[str, int, float]]:
    """Yield each check that has a budget, its number of failed tests, and the number that the budget allows."""
    for name, failed in found.failed.items():
        if name in found.budget:
            tests = int(np.count_nonzero(found.tests[name][attacked]))
            yield str(name), int(np.count_nonzero(failed[attacked])), float(found.budget[name].confirmed_p_fa * tests)


def outcome_word(detected: bool, mitigated: bool, missed: bool, denied: bool) -> str:
    """Return the outcome of an attack in at most four words."""
    if mitigated and (detected or missed):
        return "mitigated late" if missed else "mitigated"
    if missed:
        return "detected, missed" if detected else "missed"
    if detected:
        return "detected"
    return "no verdict" if denied else HARMLESS


def outcomes_of(
    scenario: CampaignScenario, results: xarray.Dataset, levels: Sequence[int], window_s: tuple[float, float]
) -> tuple[RunOutcome, ...]:
    """Return the outcome of one campaign in a time window at each level.

    Level 1 is possible with any scenario. Levels above 1 need a sky, or a processor of level 2 or 3. `window_s`
    contains the beginning and the end of the window in s after the start of the campaign; the end is excluded.
    """
    time_s = results["time_s"].values
    counted = (time_s >= window_s[0]) & (time_s < window_s[1])
    nowhere = np.full(time_s.size, np.nan)
    return tuple(
        run_outcome(
            found,
            time_s,
            counted,
            found.processor.range_limit_m,
            nowhere if scenario.constellation is None else _position_error_m(scenario, results, found),
        )
        for found in level_verdicts(results, levels)
    )


def _position_error_m(
    scenario: CampaignScenario, results: xarray.Dataset, found: LevelVerdicts
) -> Float[np.ndarray, " n"]:
    """Return the error of the position from ranges in use, in m; NaN without such a position."""
    if found.position is None:
        return np.full(results.sizes["epoch"], np.nan)
    place_m = true_place_m(scenario, results["time_s"].values, results["truth_clock_m"].values)
    return np.linalg.norm(found.position.position_m - place_m, axis=1)
