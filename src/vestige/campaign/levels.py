"""Make the verdicts of each mitigation level on a campaign, with the true errors of the ranges in use.

The results contain the receiver's measurements (`measured_columns`). `level_verdicts` makes verdicts from these
measurements again, at the level of the scenario or at another level. The same code makes the verdicts of `vestige
process`. This module adds the errors of the ranges in use (`range_errors.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int8

from vestige.acas_processor.levels import GRAVITY, LEVELS, POSITION, is_alarm
from vestige.acas_processor.measurement import MeasurementBlock
from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.campaign.columns.measured_columns import (
    E1_COLUMNS,
    MEASURED_COLUMNS,
    OSNMA_COLUMNS,
    Judged,
    measured_block,
)
from vestige.campaign.columns.own_check_columns import OWN_CHECK_COLUMNS
from vestige.campaign.range_errors import range_errors_m
from vestige.campaign.results_processor import processor_of_results
from vestige.campaign.scenario_plan import SCENARIO_COLUMNS
from vestige.campaign.statistics import Proportion, proportion
from vestige.campaign.store.attributes import attributes_of, scenario_of
from vestige.errors import VestigeError
from vestige.own_parts import digest
from vestige.records import Assistance, Status
from vestige.records.checks import AlarmShare, CheckName, CheckSeries
from vestige.scenario.stored import StoredScenario

if TYPE_CHECKING:
    import xarray

_READ = MEASURED_COLUMNS | E1_COLUMNS | OSNMA_COLUMNS | SCENARIO_COLUMNS | OWN_CHECK_COLUMNS


@dataclass(frozen=True, kw_only=True, eq=False)
class LevelVerdicts(VerdictBlock):
    """Verdicts of a level on a campaign of n epochs and m satellites, with the errors of the ranges in use."""

    processor: AcasProcessor  # processor that made the verdicts
    budget: Mapping[CheckName | str, AlarmShare]  # share of each check in the budget of false alarms
    seen: Bool[np.ndarray, "n m"]  # whether the satellite is in view
    # error of the range in use in m, as in `range_errors_m`; NaN if no range is in use
    range_error_m: Float[np.ndarray, "n m"]

    @cached_property
    def tests(self) -> Mapping[CheckName | str, Bool[np.ndarray, "*n"]]:
        """Epochs and satellites at which each check was made."""
        return {name: series.run for name, series in self.checks.items()}

    @property
    def recs(self) -> Bool[np.ndarray, " n"]:
        """Epochs with RECS."""
        return self.measured.snapshots.recs

    @property
    def not_run(self) -> tuple[str, ...]:
        """Checks of the level that never ran in this campaign."""
        names = (spec.name for spec in self.processor.specs)
        return tuple(str(name) for name in names if name not in self.tests or not self.tests[name].any())

    @property
    def own_counts(self) -> Mapping[str, tuple[int, int]]:
        """Number of tests, and of failures after confirmation, for each of the user's checks at this level."""
        return {
            one.name: (int(np.count_nonzero(self.tests[one.name])), int(np.count_nonzero(self.failed[one.name])))
            for one in self.processor.own_of_level
        }

    @property
    def alarm(self) -> Bool[np.ndarray, "n m"]:
        """Epochs and satellites with an alarm as state."""
        return is_alarm(self.state)

    @property
    def begins(self) -> Bool[np.ndarray, " n"]:
        """Epochs with an alarm of any satellite that are the first epoch or follow an epoch without alarms."""
        return alarm_begins(self.state)

    def of_recs(self) -> Int8[np.ndarray, "n m"]:
        """Return the gravest verdict since the previous RECS in epochs with RECS; NOT_AVAILABLE in other epochs."""
        by_gravity = np.array([POSITION[one] for one in GRAVITY], np.int8)
        gravity = np.argsort(by_gravity)[self.status]
        verdict = np.full(self.status.shape, POSITION[Status.NOT_AVAILABLE], np.int8)
        after = 0
        for place in np.flatnonzero(self.recs).tolist():
            verdict[place] = by_gravity[gravity[after : place + 1].max(axis=0)]
            after = place + 1
        return verdict

    def first_failures(self, rows: Bool[np.ndarray, " n"]) -> tuple[tuple[str, int], ...]:
        """Return the checks that failed in the selected epochs, each with its first failed epoch, in order of time."""
        return failures_in_order(self.failed, rows)


def level_verdicts(
    results: xarray.Dataset, levels: Sequence[int] = tuple(LEVELS), *, alarms_per_day: float | None = None
) -> tuple[LevelVerdicts, ...]:
    """Return the verdicts of mitigation levels on a campaign.

    Verdicts of level 1 can be made from the results of any campaign. Levels above 1 need a sky, or a processor of level
    2 or 3. `alarms_per_day` replaces the value in the processor's `MonitoringSettings`; None keeps this value.

    `VestigeError` is raised if the results have no valid scenario, if columns for the levels are missing, or if the
    code of a user's class has changed since the run.
    """
    _check_level(results, max(levels))
    processor, measured = measured_of(results)
    monitoring = processor.monitoring
    if alarms_per_day is not None:
        monitoring = replace(monitoring, alarms_per_day=alarms_per_day)
    return tuple(
        _verdicts(results, replace(processor, level=level, monitoring=monitoring), measured) for level in levels
    )


def alarm_begins(state: Int8[np.ndarray, "n m"]) -> Bool[np.ndarray, " n"]:
    """Return the epochs with an alarm of any satellite that are the first epoch or follow an epoch without alarms."""
    stands = np.any(is_alarm(state), axis=1)
    return stands & np.concatenate([[True], np.logical_not(stands[:-1])])


def failures_in_order(
    failed: Mapping[CheckName | str, Bool[np.ndarray, "*n"]], rows: Bool[np.ndarray, " n"]
) -> tuple[tuple[str, int], ...]:
    """Return the checks that failed in the selected epochs, each with its first failed epoch, in order of time."""
    found = []
    for name, of_check in failed.items():
        any_satellite = of_check if of_check.ndim == 1 else of_check.any(axis=1)
        where = np.flatnonzero(any_satellite & rows)
        if where.size:
            found.append((str(name), int(where[0])))
    return tuple(sorted(found, key=lambda one: one[1]))


def judged_by(results: xarray.Dataset, change: Callable[[AcasProcessor], AcasProcessor]) -> LevelVerdicts:
    """Return the verdicts of a processor with other settings on a campaign.

    `change` takes the campaign's processor and returns the processor that makes the verdicts.

    `VestigeError` is raised if the results have no valid scenario, if columns for the level of the returned processor
    are missing, or if the code of a user's class has changed since the run.
    """
    processor, measured = measured_of(results)
    changed = change(processor)
    _check_level(results, changed.level)
    return _verdicts(results, changed, measured)


def failures(check: CheckSeries) -> Proportion:
    """Return the proportion of failed tests of a check, before confirmation."""
    return proportion(int(np.count_nonzero(check.failed)), int(np.count_nonzero(check.run)))


def verdicts_of_run(results: xarray.Dataset) -> tuple[xarray.Dataset, LevelVerdicts | None]:
    """Return the results of a run with one verdict for each RECS, and the verdicts of all epochs.

    The results of a run at level 1 without user's checks are returned unchanged, with None, because this run has no
    verdicts between RECS. The results of a run that has not ended (coordinate `epoch`) are also returned unchanged,
    with None.
    """
    if not judged_between_recs(results) or "epoch" in results.coords:
        return results, None
    (found,) = level_verdicts(results, (scenario_of(results).processor.level,))
    return results.assign(status=(("epoch", "satellite"), found.of_recs())), found


def judged_between_recs(results: xarray.Dataset) -> bool:
    """Return whether a run has verdicts between RECS: at a level above 1, or with user's checks."""
    processor = scenario_of(results).processor
    return processor.level > 1 or bool(processor.checks)


def highest_level(results: xarray.Dataset) -> int:
    """Return the highest mitigation level for which verdicts can be made from results.

    The results must have E1 correlators or columns for user's checks. Without E1 correlators, the result is the level
    of the scenario.
    """
    of_own_checks = "e1_taps" not in results and set(OWN_CHECK_COLUMNS) <= set(results.data_vars)
    return scenario_of(results).processor.level if of_own_checks else max(LEVELS)


def measured_of(results: xarray.Dataset) -> tuple[AcasProcessor, MeasurementBlock]:
    """Return the processor of a campaign's receiver, and the receiver's measurements in all epochs."""
    scenario = scenario_of(results)
    _check_own_parts(scenario, attributes_of(results).own_parts)
    processor = processor_of_results(results)
    columns = {
        name: results.variables[name].transpose(*column.dims).values
        for name, column in _READ.items()
        if name in results
    }
    of = Judged(scenario=scenario, processor=processor, svids=tuple(results["svid"].values.tolist()))
    epoch = np.rint(columns["time_s"] / scenario.interval_s).astype(np.int64)
    return processor, measured_block(of, epoch, columns)


def _check_level(results: xarray.Dataset, level: int) -> None:
    if level > 1 and "e1_taps" not in results:
        raise VestigeError("results of a campaign: found no e1_taps, expected a [constellation], or level 2 or 3")


def _check_own_parts(scenario: StoredScenario, recorded: str) -> None:
    """Raise `VestigeError` if the code of a user's detector, attack, error model or check changed since the run."""
    for kind in scenario.own_kinds:
        found = f"{kind}@{digest(kind)}"
        if found not in recorded.split():
            raise VestigeError(
                f"results of a campaign: own_parts: found {found} now, expected {recorded}, as in the run"
            )


def _verdicts(results: xarray.Dataset, processor: AcasProcessor, measured: MeasurementBlock) -> LevelVerdicts:
    block, _ = processor.assess(None, measured, Assistance())
    return LevelVerdicts(
        **{one.name: getattr(block, one.name) for one in fields(block)},
        processor=processor,
        budget=processor.false_alarm_budget(block),
        seen=_seen(results),
        range_error_m=range_errors_m(results, block.range_in_use_m, block.earlier),
    )


def _seen(results: xarray.Dataset) -> Bool[np.ndarray, "n m"]:
    if "in_view" in results:
        return results["in_view"].transpose("epoch", "satellite").values.astype(np.bool_)
    return np.ones((results.sizes["epoch"], results.sizes["satellite"]), np.bool_)
