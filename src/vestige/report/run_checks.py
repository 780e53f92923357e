"""Show the checks, thresholds and false alarms of a run in sections of the run's page."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import xarray
from jaxtyping import Bool

from vestige.campaign.levels import failures
from vestige.campaign.outcomes import due_verdicts
from vestige.campaign.results_processor import processor_of_results
from vestige.campaign.statistics import Proportion, binomial_test, false_alarms
from vestige.campaign.store.attributes import CheckColumns, attributes_of, check_columns
from vestige.campaign.verdicts import VerdictCounts, range_limit_m
from vestige.records.checks import CheckName, CheckSeries
from vestige.report.markup import Html, element, figure, number, section, table
from vestige.scenario.stored import StoredScenario

_SURE = 0.05  # significance level of the two-sided test against a budget, as in the 95 % intervals


def checks_section(
    results: xarray.Dataset,
    scenario: StoredScenario,
    checks: Sequence[CheckSeries],
    of_level: Sequence[Html],
) -> Html:
    """Return the section about the checks of E6, the checks of the level, and the checks in `checks` ("Monitors")."""
    processor, attributes = scenario.processor, attributes_of(results)
    power, distance = (check_columns(results, name) for name in (CheckName.E6_POWER, CheckName.E1_E6_RANGE))
    due = due_verdicts(results)
    own = f" Your own checks: {', '.join(processor.checks)}; their counts are below." if processor.checks else ""
    parts = [
        element("p", f"Mitigation level {processor.level}; the {processor.detector} detector gives the verdicts.{own}"),
        table(
            "Checks of steps 1 and 2",
            ("check", "threshold", "meaning of the threshold", "failed", "passed", "not run"),
            [
                (
                    "E6 power",
                    _span(power.threshold),
                    "signals missing; a found signal needs a correlator above "
                    f"{number(attributes.threshold_sigma, 4, 'σ')}, P_fa = {number(attributes.p_fa, 2)}",
                    *_results(power, due),
                ),
                (
                    "E1–E6 range",
                    f"±{number(range_limit_m(results), 4, 'm')}",
                    f"κσ of the error budget, σ = {number(processor.budget.sigma_m, 3, 'm')}",
                    *_results(distance, due),
                ),
            ],
            numbers_from=3,
        ),
    ]
    parts += of_level
    if checks:
        parts += [
            figure(
                "checks",
                "Monitors",
                "Statistic of each check over its threshold, against time; the table below has the numbers.",
                "Height: |statistic| over threshold, the largest of all satellites in each stretch. The dashed line is "
                "the threshold; values above the threshold are marked.",
            ),
            table(
                "Thresholds of the monitors",
                ("check", "budget of a test", "threshold", "unit"),
                [(one.name, _budget(one), _span(one.threshold), one.unit) for one in checks],
            ),
        ]
    return section("checks", "Checks and thresholds", *parts)


def false_alarms_section(results: xarray.Dataset, counts: VerdictCounts, checks: Sequence[CheckSeries]) -> Html:
    """Return the section with the false alarms of verdicts, of single correlators on noise, and of `checks`."""
    taps = false_alarms(results, processor_of_results(results))
    rows = [
        ("verdicts without an attack", "", *_counted(counts.false_alarms)),
        ("single correlators on noise", number(attributes_of(results).p_fa, 2), *_counted(taps)),
    ]
    parts = [
        table(
            "Counted in this run, exact 95 % intervals", ("", "budget", "alarms", "of", "rate", "95 % interval"), rows
        )
    ]
    if counts.attacked:
        parts.insert(
            0, element("p", "Epochs under attack are left out of the first line: an alarm there is not a false alarm.")
        )
    if counts.false_alarms.trials:
        a_day, low, high = (number(value, 3) for value in counts.false_alarms_a_day)
        parts.append(
            element(
                "p",
                f"A satellite that sends a RECS as often as this one, {number(counts.recs_a_day, 5)} a day, "
                f"has {a_day} false alarms a day ({low} to {high}).",
            )
        )
    if checks:
        attacked = "The run has an attack: alarms of these checks may be true ones. " if counts.attacked else ""
        note = (
            f"{attacked}▲ and ▼: the rate differs from the budget (exact two-sided test at 5 %), or exceeds the "
            "upper limit."
        )
        head = ("check", "budget", "alarms", "of", "rate", "95 % interval", "")
        parts += [
            table(
                "Monitors", head, [(one.name, _budget(one), *_counted(failures(one)), _judged(one)) for one in checks]
            ),
            element("p", note),
        ]
    return section("false-alarms", "False alarms", *parts)


def _results(check: CheckColumns, due: Bool[np.ndarray, "n m"]) -> tuple[str, str, str]:
    """Return how many of the due tests failed, passed and were not run, as texts."""
    failed, passed, not_run = (number(int(np.count_nonzero(due & (check.result == value)))) for value in (1, 0, -1))
    return failed, passed, not_run


def _counted(found: Proportion) -> tuple[str, str, str, str]:
    interval = f"{number(found.low, 2)} to {number(found.high, 2)}" if found.trials else "–"
    return number(found.successes), number(found.trials), number(found.value, 3), interval


def _budget(check: CheckSeries) -> str:
    return f"{'' if check.exact else '≤ '}{number(check.p_fa, 2)}"


def _judged(check: CheckSeries) -> Html:
    """Return a mark that says whether the rate of a check's alarms agrees with the budget of the check."""
    found = failures(check)
    if not found.trials:
        return element("span", "not run", class_="mark unmeasured", data_sign="○")
    exceeds = found.low > check.p_fa
    differs = binomial_test(found.successes, found.trials, check.p_fa) < _SURE if check.exact else exceeds
    if not differs:
        return element("span", "within", class_="mark agrees", data_sign="✓")
    return element("span", "more" if exceeds else "fewer", class_="mark differs", data_sign="▲" if exceeds else "▼")


def _span(threshold: np.ndarray) -> str:
    """Return the threshold as text; if the thresholds differ, the smallest and the largest threshold."""
    known = threshold[np.isfinite(threshold)]
    if not known.size:
        return "–"
    low, high = float(known.min()), float(known.max())
    return number(low) if math.isclose(low, high, rel_tol=1e-3) else f"{number(low)} to {number(high)}"
