"""Write the output of `vestige threats`: a table for people, JSON for programs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from io import StringIO

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from vestige.campaign.statistics import Proportion
from vestige.cli.campaigns.campaign_report import as_json
from vestige.constants import DAY_S
from vestige.threats.matrix import SceneCell
from vestige.threats.scene_outcome import Agreement, SceneOutcome
from vestige.threats.scenes import LEVEL_NUMBERS, Threat
from vestige.threats.table import statistics_of

_LONG = 1e6
WIDTH = 196  # least width of the table in characters; on a narrower terminal lines wrap, and nothing is cut off
_STYLES = {Agreement.DIFFERS: "bold red", Agreement.UNDECIDED: "yellow", Agreement.AGREES: "green"}


def threats_json(cells: Sequence[SceneCell], threats: Sequence[Threat], levels: Sequence[int] = LEVEL_NUMBERS) -> str:
    """Return the measured cells at `levels`, and the expected outcomes at all levels, as the text of a JSON object."""
    expected = [
        {
            "threat": threat.id,
            "attack": threat.name,
            "source": threat.source,
            "expected": {level: threat.outcome(level)[0] for level in LEVEL_NUMBERS},
        }
        for threat in threats
    ]
    found = [
        {
            "threat": cell.case.threat,
            "scene": cell.case.scene,
            "level": cell.level,
            "expected": cell.expected,
            "agreement": cell.agreement.value,
            **statistics_of(cell),
            "checks": [asdict(one) for one in cell.found.checks],
        }
        for cell in cells
        if cell.level in levels
    ]
    return as_json({"threats": expected, "settings": _settings(cells), "cells": found})


def threats_text(cells: Sequence[SceneCell], levels: Sequence[int] = LEVEL_NUMBERS) -> str:
    """Return a table of attacks by level, failed checks with their times, false alarms, and reasons for differences."""
    shown = [cell for cell in cells if cell.level in levels]
    attacked = [cell for cell in shown if cell.attacked]
    quiet = [cell for cell in shown if not cell.attacked]
    settings = _settings(shown)
    parts = (
        [
            f"Every scene was run with {', '.join(settings)}. The expected outcomes are for scenes without these "
            "settings."
        ]
        if settings
        else []
    )
    parts += [_rendered(_attacks(attacked)), _rendered(_checks(attacked, max(levels)))] if attacked else []
    parts += [_rendered(_false_alarms(quiet)), _rendered(_by_check(quiet))] if quiet else []
    parts += [
        f"{cell.case.threat} {cell.case.scene}, level {cell.level}: {cell.agreement.value.lower()}: {cell.note}"
        for cell in shown
        if cell.note
    ]
    return "\n".join(parts)


def _settings(cells: Sequence[SceneCell]) -> list[str]:
    """Return the settings that replaced values in every scene."""
    return list(dict.fromkeys(one for cell in cells for one in cell.case.settings))


def _attacks(cells: Sequence[SceneCell]) -> Table:
    runs = max(cell.found.detected.trials for cell in cells)
    title = f"{runs} runs of each scene: number of runs with each outcome, and 95 % interval of its share in %"
    table = Table(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("attack", width=34)
    for name in ("level", "expected", "measured", "", "detected", "mitigated", "missed"):
        table.add_column(name, no_wrap=True)
    for name in ("by\nchance", "alarm\nafter (s)", "worst\nrange (m)", "worst\nposition (m)"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("first check", no_wrap=True)
    before: tuple[str, str] = ("", "")
    for cell in cells:
        case = cell.case
        if case.row and case.threat != before[0]:
            table.add_row(f"[bold]{case.threat} {case.row.name}[/]")
        table.add_row(f"  {case.scene}" if (case.threat, case.scene) != before else "", *_values(cell))
        before = case.threat, case.scene
    return table


def _values(cell: SceneCell) -> list[str]:
    found = cell.found
    agrees = f"[{_STYLES[cell.agreement]}]{cell.agreement.value}[/]" if cell.agreement in _STYLES else ""
    first = min(found.checks, key=lambda one: (one.time_s, -one.failed.successes), default=None)
    return [
        str(cell.level),
        cell.expected or "–",
        found.word,
        agrees,
        *(_share(one) for one in (found.detected, found.mitigated, found.missed)),
        f"{found.by_chance.successes}",
        _number(found.time_to_detect_s),
        _number(found.worst_range_m),
        _number(found.worst_position_m),
        first.name if first else "",
    ]


def _checks(cells: Sequence[SceneCell], level: int) -> Table:
    """Return the failed checks of a level for each attack, with number of runs and median time of first failure."""
    title = f"Level {level}: failed checks, the earliest first, with number of runs and median time of first failure"
    table = Table(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("scene", width=34)
    table.add_column("checks")
    for cell in cells:
        if cell.level == level:
            found = sorted(cell.found.checks, key=lambda one: (one.time_s, -one.failed.successes))
            text = "; ".join(
                f"{one.name} {one.failed.successes}/{one.failed.trials}, {one.time_s:.3g} s" for one in found
            )
            table.add_row(f"{cell.case.threat} {cell.case.scene}", text or "none")
    return table


def _false_alarms(cells: Sequence[SceneCell]) -> Table:
    table = Table(
        title="False alarms a day without an attack, with 95 % intervals", box=SIMPLE_HEAD, padding=(0, 2, 0, 0)
    )
    for name in (
        "scene",
        "level",
        "days",
        "alarms that a user sees",
        "at most: range check + rest",
        "failures of range check",
        "at most",
        "other single failures",
        "budget",
        "of these exact",
        "budget",
        "",
        "checks",
    ):
        table.add_column(name)
    for cell in cells:
        found, values = cell.found, statistics_of(cell)
        table.add_row(
            cell.case.scene,
            str(cell.level),
            f"{values['days']:.2g}",
            _a_day(found.a_day("alarms")),
            _bounds(found),
            *(
                text
                for name in ("range_failures", "failures", "exact_failures")
                for text in (_a_day(found.a_day(name)), f"{values[f'budget_{name}_a_day']:.2g}")
            ),
            f"[{_STYLES[cell.agreement]}]{cell.agreement.value}[/]" if cell.agreement in _STYLES else "",
            ", ".join(one.name for one in found.checks),
        )
    return table


def _by_check(cells: Sequence[SceneCell]) -> Table:
    """Return how often checks failed without an attack, and how many failures the budgets of these checks allow."""
    title = "Failures of each check without an attack, and the number that its budget allows; * budget exceeded"
    table = Table(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in ("scene", "level", "days", "failures of budget"):
        table.add_column(name)
    for cell in cells:
        found = cell.found
        over = {one.name for one in found.exceeded}
        text = "; ".join(
            f"{one.name} {one.failures} of {one.budget:.2g}{' *' if one.name in over else ''}"
            for one in found.budgets
            if one.failures
        )
        table.add_row(cell.case.scene, str(cell.level), f"{found.duration_s / DAY_S:.2g}", text or "none failed")
    return table


def _bounds(found: SceneOutcome) -> str:
    days = found.duration_s / DAY_S
    range_a_day = found.budget_range_alarms / days
    return f"{range_a_day:.2g} + {found.budget_alarms / days - range_a_day:.2g}"


def expectations_text(threats: Sequence[Threat], level: int) -> str:
    """Return the expected outcomes of the attacks at a level, with reasons, as the text of a table."""
    table = Table(title=f"Mitigation level {level}: expected", box=SIMPLE_HEAD)
    for name in ("", "attack", "expected", "by", "source"):
        table.add_column(name, overflow="fold")
    for threat in threats:
        table.add_row(threat.id, threat.name, *threat.outcome(level), threat.source.replace("[", r"\["))
    return _rendered(table)


def _a_day(found: tuple[float, float, float]) -> str:
    value, low, high = found
    return f"{value:.2g} ({low:.2g} to {high:.2g})"


def _share(found: Proportion) -> str:
    return f"{found.successes:3d} ({100 * found.low:.0f}–{100 * found.high:.0f})"


def _number(value: float) -> str:
    if not math.isfinite(value):
        return "–"
    return f"{value:.0f}" if abs(value) < _LONG else f"{value:.2g}"


def _rendered(table: Table) -> str:
    """Return a table as text, with colours if standard output is a terminal."""
    terminal = Console()
    text = StringIO()
    width = max(WIDTH, terminal.width if terminal.is_terminal else 0)
    Console(file=text, width=width, force_terminal=terminal.is_terminal, highlight=False).print(table)
    return "\n".join(line.rstrip() for line in text.getvalue().splitlines())
