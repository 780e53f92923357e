"""Write the output of `vestige run` for a campaign or a sweep of campaigns: text for people, JSON for programs."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import xarray

from vestige.campaign.levels import verdicts_of_run
from vestige.campaign.range_errors import worst_range_m
from vestige.campaign.results_processor import processor_of_results
from vestige.campaign.run_outcome import RunOutcome
from vestige.campaign.statistics import Proportion, detectors_of, false_alarms, summarise
from vestige.campaign.store.attributes import attributes_of, scenario_of
from vestige.campaign.sweep.sweep import Row
from vestige.campaign.verdicts import verdict_counts
from vestige.cli.campaigns.attack_report import attack_lines, attack_values, range_words
from vestige.cli.campaigns.level_report import level_lines, level_values
from vestige.records import Status
from vestige.theory.thresholds import probability_of_detection


def campaign_json(results: xarray.Dataset) -> str:
    """Return the rates of detections and false alarms, and the attack reports, as the text of a JSON object.

    If the campaign has verdicts between RECS (`verdicts_of_run`), the object also has the outcome at the level of the
    scenario.
    """
    attributes = attributes_of(results)
    judged, level = verdicts_of_run(results)
    return as_json(
        {
            "epochs": results.sizes["epoch"],
            "fidelity": attributes.fidelity,
            "signal": attributes.signal,
            "cn0_dbhz": attributes.cn0_dbhz,
            "p_fa": attributes.p_fa,
            "p_d_theory": _theory(results),
            "false_alarms": asdict(false_alarms(results, processor_of_results(results))),
            "detectors": {name: asdict(summarise(results, name)) for name in detectors_of(results)},
            "attack": attack_values(judged),
            **({"worst_range_m": worst_range_m(results)} if scenario_of(results).attack else {}),
            **({} if level is None else {"verdicts": level_values(results, level)}),
        }
    )


def campaign_text(results: xarray.Dataset, store: Path) -> str:
    """Return the rates of detections and false alarms, and the verdicts of a campaign, as a few lines of text."""
    attributes = attributes_of(results)
    strength = f"C/N0 {attributes.cn0_dbhz:g} dBHz" if attributes.signal else "no signal"
    lines = [
        f"{store}: {results.sizes['epoch']} epochs, {attributes.fidelity}, {strength}, P_fa {attributes.p_fa:g}",
        f"false alarms of single correlators on noise: {_count(false_alarms(results, processor_of_results(results)))}",
    ]
    if attributes.signal:
        lines.append(f"theory with thermal noise only, delay on a correlator: P_d {_theory(results):.7f}")
    judged, level = verdicts_of_run(results)
    counts = verdict_counts(judged)
    if undecided := counts.of[Status.NOT_AVAILABLE]:
        lines.append(
            f"NOT_AVAILABLE: {undecided} of {counts.due} verdicts; there is no key, or no proof of reception before "
            "its "
            "disclosure, or the signal is too weak"
        )
    for name in detectors_of(results):
        lines += _detector_lines(results, name) if attributes.signal else _alarm_line(results, name)
    if level is not None:
        lines += level_lines(results, level)
    elif scenario_of(results).attack and results.sizes["satellite"] > 1:
        lines.append(f"all satellites: {range_words(worst_range_m(results))}")
    return "\n".join([*lines, *attack_lines(judged)])


def sweep_json(rows: Sequence[Row]) -> str:
    """Return the rows of a sweep as a JSON object."""
    return as_json({"campaigns": [asdict(row) for row in rows]})


def sweep_table(rows: Sequence[Row], file: Path) -> str:
    """Return a table of a sweep, with a line for each campaign, and a last line that names the file of the table.

    A line has the counts of the campaign, and the theoretical P_d of a signal exactly on a correlator. If any row has
    an outcome (`Row.outcome`), each line has level and outcome of the run instead, with the missed detections. `file`
    is the CSV file with the same rows.
    """
    if any(row.outcome is not None for row in rows):
        return "\n".join([*_columns(_outcome_cells(rows)), f"table: {file}"])
    keys = list(rows[0].settings)
    detectors = _detectors(rows)
    missed = [f"missed {name}" for name in detectors]
    table = [
        [*keys, "counted", *missed, "P_d", "95 % interval", "theory", "false alarms per correlator", "95 % interval"]
    ]
    for row in rows:
        found, alarms = row.detections[row.detector], row.false_alarms
        table.append(
            [
                *(str(row.settings[key]) for key in keys),
                str(row.epochs),
                *("" if one is None else str(one.trials - one.successes) for one in map(row.detections.get, detectors)),
                f"{found.value:.5f}",
                f"{found.low:.5f} to {found.high:.5f}",
                f"{row.p_d_theory:.5f}" if row.signal else "no signal",
                f"{alarms.successes} of {alarms.trials}",
                f"{alarms.low:.2g} to {alarms.high:.2g}",
            ]
        )
    return "\n".join([*_columns(table), f"table: {file}"])


def _detectors(rows: Sequence[Row]) -> list[str]:
    """Return the names of the detectors in all rows, each name once."""
    return list(dict.fromkeys(name for row in rows for name in row.detections))


def _outcome_cells(rows: Sequence[Row]) -> list[list[str]]:
    """Return the table of a sweep whose rows have outcomes, as lists of cells; the first list is the heading."""
    keys = list(rows[0].settings)
    names = [
        "level",
        "outcome",
        "first alarm",
        "by",
        "mitigated",
        "largest range error in use",
        "largest position error",
    ]
    detectors = _detectors(rows)
    table = [[*keys, *names, *(f"missed {name}" for name in detectors)]]
    for row in rows:
        settings = [str(row.settings[key]) for key in keys]
        counts = [row.detections.get(name) for name in detectors]
        missed = ["" if one is None else f"{one.trials - one.successes} of {one.trials}" for one in counts]
        table.append([*settings, str(row.level), *_outcome_words(row.outcome), *missed])
    return table


def _outcome_words(found: RunOutcome | None) -> list[str]:
    if found is None:
        return ["not judged", "", "", "", "", ""]
    first, _, _ = found.checks.partition("; ")
    return [
        found.word,
        f"after {found.time_to_detect_s:g} s" if found.detected else "none",
        first.rpartition(" ")[0],
        "yes" if found.mitigated else "no",
        *(
            "none in use" if math.isnan(worst) else f"{worst:.4g} m"
            for worst in (found.worst_range_m, found.worst_position_m)
        ),
    ]


def _columns(table: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines; each column is as wide as its widest cell."""
    widths = [max(len(cells[i]) for cells in table) for i in range(len(table[0]))]
    return ["  ".join(cell.rjust(width) for cell, width in zip(cells, widths, strict=True)) for cells in table]


def _detector_lines(results: xarray.Dataset, name: str) -> list[str]:
    found = summarise(results, name)
    rate = found.detections
    if not rate.trials:
        return [f"{name:8s} detector: no RECS was correlated"]
    low_m, high_m = found.cluster_m
    return [
        f"{name:8s} detector: {found.misses} missed, P_d {rate.value:.6f} "
        f"({100 * rate.confidence:g} %: {rate.low:.6f} to {rate.high:.6f})",
        f"  range offset: mean {found.range_offset_mean_m:+.2f} m, 1σ {found.range_offset_std_m:.2f} m",
        f"  early flank of the correlation peak, where outliers cluster: {found.cluster.successes} range offsets "
        f"between {low_m:g} and {high_m:g} m",
        "  percentiles: " + ", ".join(f"{p:g} % {value:+.1f} m" for p, value in found.percentiles_m.items()),
    ]


def _alarm_line(results: xarray.Dataset, name: str) -> list[str]:
    return [f"{name:8s} detector: false alarms in {_count(summarise(results, name).detections)} banks"]


def _count(found: Proportion) -> str:
    interval = f"{100 * found.confidence:g} %: {found.low:.3g} to {found.high:.3g}"
    return f"{found.successes} of {found.trials}, {found.value:.3g} ({interval})"


def _theory(results: xarray.Dataset) -> float:
    attributes = attributes_of(results)
    if attributes.cn0_dbhz is None:
        return math.nan
    return float(probability_of_detection(attributes.cn0_dbhz, attributes.integration_s, attributes.p_fa))


def as_json(value: Any) -> str:
    """Return nested results as a JSON object; a number that is not finite becomes null."""
    return json.dumps(_finite(value), allow_nan=False)


def _finite(value: Any) -> Any:
    """Return nested results with None for each number that is not finite, which JSON cannot express."""
    if isinstance(value, dict):
        return {str(key): _finite(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
