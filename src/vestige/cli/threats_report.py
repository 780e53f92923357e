"""What `vestige threats` prints: a table for people, JSON for programs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from io import StringIO

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from vestige.campaign.statistics import Proportion
from vestige.campaign.threat_matrix import LEVEL, Cell, row_of
from vestige.campaign.threat_outcome import Agreement
from vestige.cli.campaign_report import as_json
from vestige.scenario.threats import LEVELS, Threat

_LONG = 1e6
WIDTH = 160  # of the table at least: on a narrower terminal lines wrap, and nothing is cut off
_STYLES = {Agreement.DIFFERS: "bold red", Agreement.UNDECIDED: "yellow", Agreement.AGREES: "green"}


def threats_json(cells: Sequence[Cell], threats: Sequence[Threat]) -> str:
    """Return the table, and the expectations of all levels."""
    expected = [
        {
            "threat": threat.id,
            "attack": threat.name,
            "source": threat.source,
            "expected": {level: threat.outcome(level)[0] for level in LEVELS},
            "measured_levels": [LEVEL] if cells else [],
        }
        for threat in threats
    ]
    return as_json({"threats": expected, "level_1": [row_of(cell) for cell in cells]})


def threats_text(cells: Sequence[Cell], threats: Sequence[Threat], level: int | None) -> str:
    """Return the table of level 1, and below it what it cannot show, why it differs, and the other levels."""
    runs = max((cell.found.detected.trials for cell in cells), default=0)
    table = Table(
        title=f"Mitigation level 1, {runs} runs of each scene, 95 % intervals in %",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    table.add_column("")
    table.add_column("attack", min_width=34)
    for name in ("expected", "measured", "detected", "mitigated", "missed", "no verdict"):
        table.add_column(name, no_wrap=True)
    for name in ("by\nchance", "alarm\nafter (s)", "worst\naccepted (m)"):
        table.add_column(name, justify="right")
    shown = ""
    for cell in cells:
        if cell.case.row and cell.case.threat != shown:
            shown = cell.case.threat
            table.add_row(f"[bold]{shown}[/]", f"[bold]{cell.case.row.name}[/]")
        table.add_row(*_cells(cell))
    notes = [_alarms(cell) for cell in cells if not cell.attacked]
    notes += [
        f"{cell.case.threat} {cell.case.scene}: {cell.agreement.value.lower()}: {cell.case.note}"
        for cell in cells
        if cell.agreement in (Agreement.DIFFERS, Agreement.UNDECIDED) and cell.case.note
    ]
    notes += [f"{threat.id}: shown by {threat.shows}" for threat in threats if threat.shows]
    parts = [_rendered(table), *notes]
    if level is None and threats:
        parts += ["", *(expectations_text(threats, other) for other in LEVELS if other != LEVEL)]
    return "\n".join(parts)


def expectations_text(threats: Sequence[Threat], level: int) -> str:
    """Return what is expected of a level that is not measured yet."""
    table = Table(title=f"Mitigation level {level}: expected, not measured yet", box=SIMPLE_HEAD)
    for name in ("", "attack", "expected", "by", "source"):
        table.add_column(name, overflow="fold")
    for threat in threats:
        table.add_row(threat.id, threat.name, *threat.outcome(level), threat.source.replace("[", r"\["))
    return _rendered(table)


def _cells(cell: Cell) -> list[str]:
    row, found = cell.case.row, cell.found
    expected = row.outcome(LEVEL)[0] if row else "–"
    agrees = f"[{_STYLES[cell.agreement]}]{cell.agreement.value}[/]" if cell.agreement in _STYLES else "–"
    name = f"  {cell.case.scene}" if row else cell.case.scene
    if not cell.attacked:
        return ["", name, expected, agrees, f"{found.alarms.successes} of {found.alarms.trials}", *6 * ["–"]]
    return [
        "",
        name,
        expected,
        agrees,
        *(_share(one) for one in (found.detected, found.mitigated, found.missed, found.denied)),
        f"{found.by_chance.successes}",
        _number(found.time_to_detect_s),
        _number(found.worst_accepted_m),
    ]


def _alarms(cell: Cell) -> str:
    a_day, low, high = cell.found.alarms_a_day
    return (
        f"{cell.case.threat} {cell.case.scene}: {a_day:.2g} false alarms a day (95 %: {low:.2g} to {high:.2g}), "
        f"one RECS each {cell.found.interval_s:g} s"
    )


def _share(found: Proportion) -> str:
    return f"{found.successes:3d} ({100 * found.low:.0f}–{100 * found.high:.0f})"


def _number(value: float) -> str:
    if not math.isfinite(value):
        return "–"
    return f"{value:.0f}" if abs(value) < _LONG else f"{value:.2g}"


def _rendered(table: Table) -> str:
    """Return a table as text, in colour at a terminal."""
    terminal = Console()
    text = StringIO()
    width = max(WIDTH, terminal.width if terminal.is_terminal else 0)
    Console(file=text, width=width, force_terminal=terminal.is_terminal, highlight=False).print(table)
    return "\n".join(line.rstrip() for line in text.getvalue().splitlines())
