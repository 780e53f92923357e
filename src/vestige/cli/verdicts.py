"""How verdicts are printed and written."""

from __future__ import annotations

import csv
import json
import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records import Measurement, Outcome, SatelliteMeasurement, Verdict

COLUMNS = (
    "gst_week",
    "gst_second",
    "svid",
    "level",
    "status",
    "magnitude_sigma",
    "threshold_sigma",
    "range_offset_m",
    "range_limit_m",
    "true_offset_m",
    "cn0_e1_dbhz",
    "doppler_e6_hz",
    "available_at",
    "reason",
)


def _row(verdict: Verdict, measurement: Measurement) -> dict[str, Any]:
    """Return one verdict as a flat row; what was not measured is None."""
    satellite = _satellite(verdict, measurement)
    observation = measurement.observations.get(verdict.svid)
    power = verdict.checks[0]
    return {
        "gst_week": verdict.time.week,
        "gst_second": verdict.time.second + verdict.time.fraction,
        "svid": verdict.svid,
        "level": verdict.level,
        "status": verdict.status.name,
        "magnitude_sigma": _number(power.statistic),
        "threshold_sigma": _number(power.threshold),
        "range_offset_m": _number(verdict.range_offset_m),
        "range_limit_m": _number(verdict.checks[1].threshold),
        "true_offset_m": _number(verdict.true_offset_m),
        "cn0_e1_dbhz": None if observation is None else _number(observation.cn0_dbhz),
        "doppler_e6_hz": None if satellite.handover is None else satellite.handover.doppler_hz,
        "available_at": None if verdict.available_at is None else str(verdict.available_at),
        "reason": verdict.reason,
    }


def _rows(verdicts: Sequence[Verdict], measurements: Sequence[Measurement]) -> list[dict[str, Any]]:
    by_index = {measurement.index: measurement for measurement in measurements}
    return [_row(verdict, by_index[verdict.index]) for verdict in verdicts]


def _satellite(verdict: Verdict, measurement: Measurement) -> SatelliteMeasurement:
    return next(one for one in measurement.satellites if one.svid == verdict.svid)


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value


def print_table(
    verdicts: Sequence[Verdict], measurements: Sequence[Measurement], *, hardware_bias_s: float, unseen: Sequence[int]
) -> None:
    """Print the verdicts for a person."""
    rows = _rows(verdicts, measurements)
    last = None
    for verdict, row in zip(verdicts, rows, strict=True):
        if verdict.index != last:
            if last is not None:
                _print_not_run(one for one in verdicts if one.index == last)
            known = f", known from {verdict.available_at}" if verdict.available_at else ""
            click.echo(f"\nsnapshot {verdict.index}: {verdict.time}, level {verdict.level}{known}")
            click.echo("  sat   E1 C/N0   E6 peak   E6-E1 range   verdict")
            last = verdict.index
        cn0, magnitude, offset = row["cn0_e1_dbhz"], row["magnitude_sigma"], row["range_offset_m"]
        click.echo(
            f"  E{verdict.svid:02d}   "
            f"{'   - ' if cn0 is None else f'{cn0:4.1f} dBHz'} "
            f"{'     -   ' if magnitude is None else f'{magnitude:6.1f} σ '}"
            f"{'         -    ' if offset is None else f'{offset:+9.1f} m   '}  "
            f"{verdict.status.name}{'' if verdict.status.name == 'AUTHENTIC' else f': {verdict.reason}'}"
        )
        if row["true_offset_m"] is not None:
            click.echo(f"{'':46}its earliest signal is {-row['true_offset_m']:.1f} m nearer than E1 says: the true one")
    _print_not_run(one for one in verdicts if one.index == last)
    if not verdicts:
        why = "no satellite of the RECS is seen on E1" if unseen else "no RECS is of this recording's time"
        click.echo(f"no verdict: {why}; vestige inspect says what is there")
    counts = Counter(verdict.status.name for verdict in verdicts)
    click.echo(f"\nhardware bias E6-E1 used: {hardware_bias_s * SPEED_OF_LIGHT_MPS:+.1f} m")
    if unseen:
        click.echo(f"RECS, but not seen on E1: {' '.join(f'E{svid:02d}' for svid in unseen)}")
    click.echo("result: " + (", ".join(f"{n} {name}" for name, n in counts.items()) or "nothing"))


def _print_not_run(verdicts: Iterable[Verdict]) -> None:
    """Print which checks beyond steps 1 and 2 could not be run for any satellite of a snapshot, one line a reason."""
    why = defaultdict(list)
    for name, reason in dict.fromkeys(
        (check.name, check.reason) for one in verdicts for check in one.checks[2:] if check.outcome is Outcome.NOT_RUN
    ):
        why[reason].append(name)
    for reason, names in why.items():
        click.echo(f"  not run: {', '.join(dict.fromkeys(names))}: {reason}")


def print_json(
    verdicts: Sequence[Verdict],
    measurements: Sequence[Measurement],
    *,
    hardware_bias_s: float,
    unseen: Sequence[int],
    remarks: Mapping[str, Any],
) -> None:
    """Print the verdicts for a program: one JSON object, numbers in full precision."""
    entries = []
    for verdict, row in zip(verdicts, _rows(verdicts, measurements), strict=True):
        checks = [
            {
                "name": check.name,
                "outcome": check.outcome.name,
                "statistic": _number(check.statistic),
                "threshold": _number(check.threshold),
                "unit": check.unit,
                "reason": check.reason,
            }
            for check in verdict.checks
        ]
        entries.append(row | {"snapshot": verdict.index, "checks": checks})
    result = {
        "hardware_bias_m": hardware_bias_s * SPEED_OF_LIGHT_MPS,
        "not_seen_on_e1": list(unseen),
        "verdicts": entries,
    } | dict(remarks)
    click.echo(json.dumps(result, allow_nan=False))


def write_csv(path: Path, verdicts: Sequence[Verdict], measurements: Sequence[Measurement]) -> None:
    """Write the verdicts as a table."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        writer.writeheader()
        writer.writerows(_rows(verdicts, measurements))
