"""Count the verdicts of a campaign by status, and count its false alarms.

A verdict is due in an epoch with RECS for each satellite in view. A due verdict that is an alarm (`ALARMS`) is a false
alarm if the satellite is not under attack in this epoch. In a campaign with an attack, all satellites and epochs
without an attack give the rate of false alarms. NOT_AVAILABLE verdicts do not count as trials, because the receiver
made no decision.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
import xarray

from vestige.acas_processor.levels import POSITION, is_alarm
from vestige.campaign.outcomes import attacked_epochs, due_verdicts
from vestige.campaign.statistics import Proportion, proportion
from vestige.campaign.store.attributes import check_columns, scenario_of
from vestige.constants import DAY_S
from vestige.records import Status
from vestige.records.checks import CheckName


@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictCounts:
    """Number of verdicts of each status in a campaign, and the proportion of false alarms."""

    due: int  # number of verdicts that were due
    of: dict[Status, int]  # number of due verdicts of each status
    attacked: int  # number of verdicts that were due under attack
    false_alarms: Proportion  # proportion of alarms among the available verdicts without an attack
    recs_a_day: float  # number of RECS of one satellite in a day, for `false_alarms_a_day`

    @property
    def false_alarms_a_day(self) -> tuple[float, float, float]:
        """Number of false alarms of one satellite in a day, then lower and upper end of its confidence interval."""
        rate = self.false_alarms
        return rate.value * self.recs_a_day, rate.low * self.recs_a_day, rate.high * self.recs_a_day


def verdict_counts(results: xarray.Dataset) -> VerdictCounts:
    """Return the number of due verdicts of each status in a campaign, and the proportion of false alarms."""
    due = due_verdicts(results)
    status = results["status"].transpose("epoch", "satellite").values
    attacked = attacked_epochs(results)
    alarm = is_alarm(status)
    quiet = due & ~attacked & (status != POSITION[Status.NOT_AVAILABLE])
    return VerdictCounts(
        due=int(np.count_nonzero(due)),
        of={one: int(np.count_nonzero(due & (status == POSITION[one]))) for one in Status},
        attacked=int(np.count_nonzero(due & attacked)),
        false_alarms=proportion(int(np.count_nonzero(quiet & alarm)), int(np.count_nonzero(quiet))),
        recs_a_day=DAY_S / scenario_of(results).recs_interval_s,
    )


def range_limit_m(results: xarray.Dataset) -> float:
    """Return the threshold of the range check in m, from the stored results.

    The function raises `VestigeError` if the results have no range check.
    """
    return float(np.max(check_columns(results, CheckName.E1_E6_RANGE).threshold))


def results_digest(results: xarray.Dataset) -> str:
    """Return the SHA-256 of the names, types, shapes and values of all variables.

    The hash does not depend on the chunks of the store.
    """
    digest = hashlib.sha256()
    for name in sorted(map(str, results.variables)):
        values = results[name].values
        if values.dtype.kind in "TOU":
            values = np.array([str(text) for text in values])
        digest.update(f"{name} {values.dtype} {values.shape}\n".encode())
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()
