"""Write verdicts snapshot by snapshot as text, JSON or CSV, so that no verdict has to be kept in memory."""

from __future__ import annotations

import csv
import json
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from vestige.acas_processor.checks.power.e6_power import TOO_WEAK
from vestige.acas_processor.levels import ALARMS
from vestige.cli.outputs.verdict_lines import (
    PositionEntry,
    PositionLine,
    StateLine,
    VerdictEntry,
    VerdictLine,
    VerdictRow,
)
from vestige.cli.recordings.advice import NOT_ON_E1, NOT_ON_E6, WEAK_ON_E1
from vestige.cli.terminal import echo
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.errors import VestigeError
from vestige.navigation.position_fix import UNKNOWNS
from vestige.output import replacement
from vestige.records import Outcome, Status, Verdict

if TYPE_CHECKING:
    from vestige.acas_processor.monitoring.alarm import StateChange
    from vestige.acas_processor.processor import Step

VERDICT_COLUMNS = tuple(VerdictRow.__annotations__)
FAILED = 3  # exit status if the verdicts match the value of --fail-on


@dataclass(slots=True)
class Tally:
    """Counts of snapshots, positions and verdicts in a recording, and the satellites that were found on E1."""

    tracked: Set[int] = frozenset()  # satellites that tracking found on E1, at a RECS or at another time
    too_early: str = ""  # warning that RECS were sent before E1 had ranges; "" without such RECS
    no_recs: str = ""  # reason why the assistance folder has no RECS for this recording; "" if unknown
    has_orbits: bool = True  # whether the processor has the orbits of any satellite
    snapshots: int = 0
    positions: int = 0
    alarmed: bool = False  # whether any verdict or state was an alarm
    weak: bool = False  # whether a satellite was too weak on E1 for a verdict
    counts: Counter[str] = field(default_factory=Counter)
    missed: set[int] = field(default_factory=set)
    seen: set[int] = field(default_factory=set)

    def add(self, step: Step) -> None:
        """Count a snapshot with its verdicts and positions, and note alarms and the satellites on E1."""
        self.snapshots += 1
        self.positions += len(step.positions)
        self.counts.update(verdict.status.name for verdict in step.verdicts)
        self.alarmed |= any(one.alarm for one in step.changes) or any(one.status in ALARMS for one in step.verdicts)
        self.weak |= any(one.reason.startswith(TOO_WEAK) for one in step.verdicts)
        self.missed |= step.unseen
        self.seen |= step.state.on_e1.keys()

    @property
    def not_seen_on_e1(self) -> list[int]:
        """Satellites with RECS that were never found on E1."""
        return sorted(self.missed - self.seen - self.tracked)

    @property
    def nothing(self) -> str:
        """Reason why there is no verdict; empty if there is a verdict."""
        if self.counts:
            return ""
        if self.too_early:
            return self.too_early
        if self.missed & self.tracked:
            return "no verdict: satellites of the RECS were tracked, but not when their RECS came"
        if self.missed:
            return "no verdict: no satellite of the RECS is seen on E1"
        return f"no verdict: {self.no_recs or 'no RECS was transmitted during this recording'}"

    @property
    def no_position(self) -> str:
        """Reason why there is no position; empty if there is a position."""
        if self.positions:
            return ""
        if not self.counts[Status.AUTHENTIC.name]:
            why = "no satellite is AUTHENTIC"
        elif not self.has_orbits:
            why = "there are no orbits; give --navigation FILE, a RINEX navigation file of that day"
        else:
            why = f"a position needs {UNKNOWNS} AUTHENTIC satellites with orbits in one snapshot"
        return f"no position was computed, because {why}"

    @property
    def advice(self) -> tuple[str, ...]:
        """Lines that name likely causes if the verdicts are missing or of no use; () otherwise.

        The result has lines if there is no verdict, or if all verdicts are NOT_DETECTED. The result also has lines if
        all verdicts are NOT_AVAILABLE, and a satellite was too weak on E1 for a verdict.
        """
        if not self.counts:
            if self.too_early:
                return (self.nothing,)
            if self.not_seen_on_e1:
                return (f"no verdict: {NOT_ON_E1[0]}", *NOT_ON_E1[1:])
            if self.no_recs:
                return (self.nothing,)
            return (f"{self.nothing}; `vestige inspect RECORDING` says what the recording holds",)
        if set(self.counts) == {Status.NOT_DETECTED.name}:
            return NOT_ON_E6
        return WEAK_ON_E1 if self.weak and set(self.counts) == {Status.NOT_AVAILABLE.name} else ()

    def fails(self, limit: str | None) -> bool:
        """Return whether the verdicts match the value of `--fail-on`: `spoofed`, `alarm` or `unauthenticated`."""
        if limit == "unauthenticated":
            return set(self.counts) != {Status.AUTHENTIC.name}
        return self.alarmed if limit == "alarm" else limit is not None and Status.SPOOFED.name in self.counts

    def __str__(self) -> str:
        return ", ".join(f"{n} {name}" for name, n in self.counts.items()) or "nothing"


def _row(verdict: Verdict, step: Step) -> VerdictRow:
    """Return a verdict as a flat row; a value that was not measured is None."""
    measured = step.block.measured
    epoch = int(np.flatnonzero(measured.snapshots.index == verdict.index)[0])
    here = (epoch, measured.snapshots.svids.index(verdict.svid))
    return {
        "gst_week": verdict.time.week,
        "gst_second": verdict.time.second + verdict.time.fraction,
        "svid": verdict.svid,
        "level": verdict.level,
        "status": verdict.status.name,
        "magnitude_sigma": _number(float(measured.detected.magnitude_sigma[here])),
        "threshold_sigma": measured.detected.threshold_sigma if measured.detected.tap[here] >= 0 else None,
        "range_offset_m": _number(verdict.range_offset_m),
        "range_limit_m": _number(verdict.checks[1].threshold),
        "true_offset_m": _number(verdict.true_offset_m),
        "cn0_e1_dbhz": _number(float(measured.snapshots.e1.cn0_dbhz[here])),
        "doppler_e6_hz": _number(float(measured.doppler_e6_hz[here])),
        "available_at": None if verdict.available_at is None else str(verdict.available_at),
        "reason": verdict.reason,
    }


def _number(value: float) -> float | None:
    """Return a number for JSON; None if nothing was measured, or the number is infinite (saturated front end)."""
    return value if math.isfinite(value) else None


def entries(step: Step) -> list[VerdictEntry]:
    """Return the verdicts of a snapshot with their checks as values for JSON; numbers have full precision."""
    return [
        {
            **_row(verdict, step),
            "snapshot": verdict.index,
            "checks": [
                {
                    "name": check.name,
                    "outcome": check.outcome.name,
                    "statistic": _number(check.statistic),
                    "threshold": _number(check.threshold),
                    "unit": check.unit,
                    "reason": check.reason,
                }
                for check in verdict.checks
            ],
        }
        for verdict in step.verdicts
    ]


def positions(step: Step) -> list[PositionEntry]:
    """Return the positions from ranges in use of a snapshot as values for JSON; the list may be empty."""
    return [
        {
            "snapshot": found.index,
            "time": str(found.time),
            "available_at": str(found.available_at),
            "latency_s": found.latency_s,
            "latitude_deg": found.latitude_deg,
            "longitude_deg": found.longitude_deg,
            "height_m": found.height_m,
            "horizontal_sigma_m": found.horizontal_sigma_m,
            "vertical_sigma_m": found.vertical_sigma_m,
            "svids": list(found.svids),
            "earlier": list(found.earlier),
            "orbits_authenticated": found.orbits_authenticated,
        }
        for found in step.positions
    ]


def lines(step: Step) -> list[str]:
    """Return a JSON text with the field `kind` for each verdict, position and change of a satellite's state."""
    objects: list[VerdictLine | PositionLine | StateLine] = [{"kind": "verdict", **entry} for entry in entries(step)]
    objects += [{"kind": "position", **entry} for entry in positions(step)]
    objects += [_change(change, int(step.block.measured.snapshots.index[-1])) for change in step.changes]
    return [json.dumps(one, allow_nan=False) for one in objects]


def _change(change: StateChange, snapshot: int) -> StateLine:
    return {
        "kind": "state",
        "gst_week": change.time.week,
        "gst_second": change.time.second + change.time.fraction,
        "svid": change.svid,
        "before": change.before.name,
        "after": change.after.name,
        "alarm": change.alarm,
        "reason": change.reason,
        "snapshot": snapshot,
    }


def print_snapshot(step: Step) -> None:
    """Print the verdicts and the position of a snapshot, and the checks that were not run, as text."""
    for verdict in step.verdicts[:1]:
        known_at = next((one.available_at for one in step.verdicts if one.available_at), None)
        known = f", known from {known_at}" if known_at else ""
        echo("", f"snapshot {verdict.index}: {verdict.time}, level {verdict.level}{known}")
        echo("  sat   E1 C/N0   E6 peak   E6-E1 range   verdict")
    for verdict in step.verdicts:
        row = _row(verdict, step)
        cn0, magnitude, offset = row["cn0_e1_dbhz"], row["magnitude_sigma"], row["range_offset_m"]
        echo(
            f"  E{verdict.svid:02d}   "
            f"{'   - ' if cn0 is None else f'{cn0:4.1f} dBHz'} "
            f"{'     -   ' if magnitude is None else f'{magnitude:6.1f} σ '}"
            f"{'         -    ' if offset is None else f'{offset:+9.1f} m   '}  "
            f"{verdict.status.name}{'' if verdict.status.name == 'AUTHENTIC' else f': {verdict.reason}'}"
        )
        if row["true_offset_m"] is not None:
            echo(f"{'':46}the true signal is the earliest signal, {-row['true_offset_m']:.1f} m nearer than E1 says")
    _print_position(step)
    _print_not_run(step.verdicts)


def _print_position(step: Step) -> None:
    for found in step.positions:
        earlier = f", {len(found.earlier)} of them from the earliest of several signals" if found.earlier else ""
        unproven = "" if found.orbits_authenticated else ", orbits not authenticated"
        echo(
            f"  position {found.latitude_deg:.6f}° {found.longitude_deg:.6f}° {found.height_m:.1f} m "
            f"(1σ {found.horizontal_sigma_m:.1f} m, height {found.vertical_sigma_m:.1f} m) "
            f"from {len(found.svids)} authentic ranges{earlier}{unproven}, known after {found.latency_s:.1f} s"
        )


def print_changes(step: Step) -> None:
    """Print which satellites changed their state with a snapshot, one line of text for each change."""
    for change in step.changes:
        what = "ALARM" if change.alarm else "state"
        why = f": {change.reason}" if change.reason and change.after is not Status.AUTHENTIC else ""
        echo(f"{what} {change.time} E{change.svid:02d}: {change.before.name} -> {change.after.name}{why}")


def _print_not_run(verdicts: Iterable[Verdict]) -> None:
    """Print the checks that were not run for at least one satellite, one line of text for each reason.

    The first two checks of a verdict, E6 power and E1–E6 range, are left out.
    """
    why = defaultdict(list)
    for name, reason in dict.fromkeys(
        (check.name, check.reason) for one in verdicts for check in one.checks[2:] if check.outcome is Outcome.NOT_RUN
    ):
        why[reason].append(name)
    for reason, names in why.items():
        echo(f"  not run: {', '.join(dict.fromkeys(names))}: {reason}")


def print_table(steps: Iterable[Step], tally: Tally, *, hardware_bias_s: float) -> None:
    """Print each verdict as text as soon as it is known, count the verdicts in `tally`, and print the counts."""
    for step in steps:
        print_snapshot(step)
        tally.add(step)
    if tally.advice:
        echo("", *tally.advice)
    echo("", f"hardware bias E6-E1 used: {hardware_bias_s * SPEED_OF_LIGHT_MPS:+.1f} m")
    print_not_seen(tally)
    echo(f"result: {tally}")


def print_not_seen(tally: Tally, put: Callable[[str], None] = echo) -> None:
    """Print the satellites with RECS that were never found on E1, if there are any."""
    if unseen := tally.not_seen_on_e1:
        put(f"satellites with RECS that were not seen on E1: {' '.join(f'E{svid:02d}' for svid in unseen)}")


def print_json(steps: Iterable[Step], tally: Tally, *, hardware_bias_s: float, remarks: Mapping[str, Any]) -> None:
    """Print all verdicts as a single JSON object, each verdict as soon as it is known, and count them in `tally`.

    Numbers have full precision.
    """
    separator: str = ""
    found: list[PositionEntry] = []
    head = {"hardware_bias_m": hardware_bias_s * SPEED_OF_LIGHT_MPS} | dict(remarks)
    echo(json.dumps(head, allow_nan=False).removesuffix("}") + ', "verdicts": [', nl=False)
    for step in steps:
        for entry in entries(step):
            echo(separator + json.dumps(entry, allow_nan=False), nl=False)
            separator = ", "
        found += positions(step)
        tally.add(step)
    echo(f'], "positions": {json.dumps(found)}, "not_seen_on_e1": {json.dumps(tally.not_seen_on_e1)}}}')


def exit_status(tally: Tally, limit: str | None) -> None:
    """End the command with the exit status `FAILED` if the verdicts match the value of `--fail-on`."""
    if tally.fails(limit):
        click.get_current_context().exit(FAILED)


@contextmanager
def csv_writer(path: Path) -> Iterator[Callable[[Step], None]]:
    """Yield a function that writes the verdicts of a snapshot to a CSV file.

    After Ctrl-C or damaged input the file contains the verdicts so far, if there are any. The exception then has a note
    that names the file.
    """
    stop: BaseException | None = None
    with replacement(path) as part, part.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, VERDICT_COLUMNS)
        writer.writeheader()
        written = False

        def write(step: Step) -> None:
            nonlocal written
            writer.writerows(_row(verdict, step) for verdict in step.verdicts)
            written = True

        try:
            yield write
        except (KeyboardInterrupt, VestigeError) as error:
            if not written:
                raise
            stop = error
    if stop is not None:
        stop.add_note(f"{path} has the verdicts until then")
        raise stop
