"""Run a sweep, which is one campaign for each value of a setting, and write a table of the results.

In a sweep of several settings, a value means a combination of values of these settings.

The results of a sweep are in a folder. Each value has its own store, such as `receiver.cn0_dbhz=28.zarr`. `run` would
write the same store for a scenario with this value. The store can therefore be resumed, opened and plotted like any
other store. The folder also has `sweep.csv` with a row for each value. Curves are drawn from this table, which is
written again after each value. If the scenario has an attack, a level above 1 or checks that the user wrote, the row of
a complete campaign also has the outcome of the run (`run_outcome.py`).

The campaign of a value ends when all epochs of its scenario are measured. If a width is required (`Width`), the
campaign ends earlier, as soon as the confidence interval of the probability of a detection is narrow enough. The width
of the interval is evaluated after each chunk in the order of the chunks. The epochs that count therefore depend neither
on the number of workers nor on interruptions.

All values share the scenario's seed, unless `seed` is a setting of the sweep. Neighbouring points of a curve therefore
have the same noise, and similar estimation errors. A sweep of `seed` shows the size of these errors.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vestige.campaign.columns.measured_columns import Columns
from vestige.campaign.plan import CHUNK_EPOCHS
from vestige.campaign.range_errors import window_of
from vestige.campaign.results_processor import processor_of_results
from vestige.campaign.run import ExecutorChoice, RunProgress, run
from vestige.campaign.run_outcome import RunOutcome, outcomes_of
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import Proportion, enough, false_alarms, summarise
from vestige.campaign.store.attributes import attributes_of
from vestige.campaign.sweep.sweep_axes import Value, store_name
from vestige.crypto.file_bytes import read_text
from vestige.errors import InputFileError
from vestige.output import replacement
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.tables.processor_table import ProcessorTable
from vestige.theory.thresholds import probability_of_detection

if TYPE_CHECKING:
    import xarray

SWEEP_TABLE = "sweep.csv"
_MAX_FILE_BYTES = 1 << 24  # upper limit of the table's size; the table of 1000 campaigns has 1 MB
_FIRST_RESULT = "cn0_dbhz"  # first column of the table after the keys of the sweep


@dataclass(frozen=True, slots=True, kw_only=True)
class Width:
    """Required width of the confidence interval of a probability that is estimated from a count."""

    # upper minus lower end of the interval; if `relative`, this difference divided by the smaller of the estimated
    # probabilities of a detection and of a miss
    width: float
    relative: bool = False

    def reached(self, successes: int, trials: int) -> bool:
        """Return whether the confidence interval after `successes` in `trials` is narrow enough."""
        rarer = min(successes, trials - successes)
        if self.relative and not rarer:
            return False
        return enough(successes, trials, self.width * (rarer / trials if self.relative else 1.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """Result of one campaign of a sweep."""

    settings: Mapping[str, Value]
    store: str  # name of the campaign's store in the folder of the sweep
    cn0_dbhz: float
    p_fa: float
    integration_s: float
    signal: bool
    detector: str  # detector of the scenario, whose detections decide when the campaign ends
    epochs: int
    # proportion of detections by name of the detector; without a signal, the detections are false alarms
    detections: Mapping[str, Proportion]
    p_d_theory: float  # P_d in theory (Marcum Q) for a signal exactly on a correlator; NaN without signal
    false_alarms: Proportion  # proportion of single correlators with noise only that exceed the threshold
    level: int
    # outcome at `level`, from the first start to the last stop of the attacks. The outcome is None for a campaign that
    # ended early, and for a campaign at level 1 without attacks and without checks that the user wrote.
    outcome: RunOutcome | None


def run_sweep(
    campaigns: Sequence[tuple[Mapping[str, Value], CampaignScenario]],
    folder: Path,
    *,
    width: Width | None = None,
    workers: int = 1,
    executor: ExecutorChoice = "threads",
    chunk_epochs: int = CHUNK_EPOCHS,
    progress: Callable[[str, RunProgress], None] | None = None,
) -> Iterator[Row]:
    """Yield the row of each campaign as soon as the campaign ends, and write the rows so far to `sweep.csv`.

    `campaigns` has the settings of each campaign, and the scenario with these settings. Stored epochs are not measured
    again. A campaign stops when the confidence interval of the probability of a detection is as narrow as `width`.
    Without `width`, all epochs are measured. `progress` is called with the name of a campaign's store and the progress
    of the campaign.

    The function raises `InputFileError` if `folder` is the store of one campaign, or if the table in `folder` belongs
    to a sweep of other keys. The new sweep would overwrite this table.
    """
    _check_folder(folder, {key for settings, _ in campaigns for key in settings})
    rows: list[Row] = []
    for settings, scenario in campaigns:
        name = store_name(settings)
        results = run(
            ScenarioPlan(scenario=scenario),
            folder / name,
            workers=workers,
            executor=executor,
            chunk_epochs=chunk_epochs,
            progress=None if progress is None else lambda now, name=name: progress(name, now),  # type: ignore[misc]
            enough=None if width is None else _Counter(scenario.processor, width),
        )
        attributes = attributes_of(results)
        cn0_dbhz, signal = scenario.receiver.cn0_dbhz, scenario.receiver.signal
        theory = (
            probability_of_detection(cn0_dbhz, attributes.integration_s, attributes.p_fa) if signal else float("nan")
        )
        rows.append(
            Row(
                settings=settings,
                store=name,
                cn0_dbhz=cn0_dbhz,
                p_fa=attributes.p_fa,
                integration_s=attributes.integration_s,
                signal=signal,
                detector=scenario.processor.detector,
                epochs=results.sizes["epoch"],
                detections={
                    detector: summarise(results, detector).detections for detector in scenario.processor.detectors
                },
                p_d_theory=theory,
                false_alarms=false_alarms(results, processor_of_results(results)),
                level=scenario.processor.level,
                outcome=_outcome(scenario, results),
            )
        )
        _write_table(folder / SWEEP_TABLE, rows)
        yield rows[-1]


def _outcome(scenario: CampaignScenario, results: xarray.Dataset) -> RunOutcome | None:
    level = scenario.processor.level
    plain = level == 1 and not scenario.attack and not scenario.processor.checks
    if plain or results.sizes["epoch"] < scenario.epochs:
        return None
    return outcomes_of(scenario, results, (level,), window_of(scenario))[0]


class _Counter:
    """Counter of the detections of one detector; a call adds a chunk, and returns whether the campaign may end."""

    def __init__(self, processor: ProcessorTable, width: Width) -> None:
        self._detector, self._width = list(processor.detectors).index(processor.detector), width
        self._detections = self._decisions = 0

    def __call__(self, results: Columns) -> bool:
        correlated = ~np.isnan(results["noise_power"])
        self._decisions += int(np.count_nonzero(correlated))
        self._detections += int(np.count_nonzero((results["tap_index"][self._detector] >= 0) & correlated))
        return self._width.reached(self._detections, self._decisions)


def _check_folder(folder: Path, keys: set[str]) -> None:
    """Raise `InputFileError` if `folder` is the store of a campaign, or has the table of a sweep of other keys."""
    if (folder / "zarr.json").exists():
        raise InputFileError(folder, "sweep", "the store of one campaign", "a folder of its own for the sweep")
    if not (folder / SWEEP_TABLE).exists():
        return
    expected = "the table of a sweep"
    try:
        text = read_text(folder / SWEEP_TABLE, at_most=_MAX_FILE_BYTES, expected=expected)
        heading = next(csv.reader(StringIO(text, newline="")), [])
    except csv.Error as error:
        raise InputFileError(folder / SWEEP_TABLE, "heading", str(error), expected) from error
    before = heading[: heading.index(_FIRST_RESULT)] if _FIRST_RESULT in heading else heading
    if set(before) != keys:
        raise InputFileError(
            folder / SWEEP_TABLE, "keys", ", ".join(before), f"{', '.join(sorted(keys))}, as in this sweep"
        )


def _write_table(path: Path, rows: Sequence[Row]) -> None:
    """Write all rows to the table of a sweep; an interruption leaves the old file or the complete new file."""
    table = [_cells(row) for row in rows]
    with replacement(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(name for cells in table for name in cells)))
        writer.writeheader()
        writer.writerows(table)


def _cells(row: Row) -> dict[str, object]:
    """Return the cells of a row by column name; a row without a signal has no columns of detections."""
    detected: dict[str, object] = {"trials": next(iter(row.detections.values())).trials}
    for detector, counted in row.detections.items():
        detected |= {f"detections_{detector}": counted.successes}
        detected |= {f"p_d_{detector}": counted.value, f"low_{detector}": counted.low, f"high_{detector}": counted.high}
    alarms = row.false_alarms
    return {
        **row.settings,
        _FIRST_RESULT: row.cn0_dbhz,
        "integration_s": row.integration_s,
        "p_fa": row.p_fa,
        "epochs_counted": row.epochs,
        **(detected | {"p_d_theory": row.p_d_theory} if row.signal else {}),
        "false_alarm_trials": alarms.trials,
        "false_alarms": alarms.successes,
        "low_false_alarm": alarms.low,
        "high_false_alarm": alarms.high,
        **_outcome_cells(row),
        "store": row.store,
    }


def _outcome_cells(row: Row) -> dict[str, object]:
    """Return the cells of a row's outcome, with the column names of `threats.csv`; empty without an outcome."""
    found = row.outcome
    if found is None:
        return {}
    return {
        "level": row.level,
        "word": found.word,
        "alarms": found.alarms,
        **{name: int(getattr(found, name)) for name in ("detected", "mitigated", "protected", "missed", "denied")},
        "time_to_detect_s": found.time_to_detect_s,
        "worst_range_m": found.worst_range_m,
        "worst_position_m": found.worst_position_m,
        "checks": found.checks,
    }
