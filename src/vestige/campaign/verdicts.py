"""The verdicts of a campaign, counted: how often each status, how often an alarm without an attack.

A verdict is due where a RECS was sent by a satellite in view. An alarm (`ALARMS`) in such an epoch without an attack is
a false one; with an attack somewhere, the epochs before and after it say how often. Verdicts that are NOT_AVAILABLE are
no trials: nothing was decided.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
import xarray

from vestige.acas_processor.levels import POSITION, is_alarm
from vestige.campaign.outcomes import attacked_epochs, due_verdicts
from vestige.campaign.statistics import Proportion, proportion
from vestige.campaign.store.results import attributes_of, scenario_of
from vestige.constants import DAY_S
from vestige.records import Status
from vestige.scenario.scenario_processor import Overhead, receiver_processor


@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictCounts:
    """Number of verdicts of each status in a campaign, and the rate of false alarms."""

    due: int  # verdicts that were due
    of: dict[Status, int]
    attacked: int  # verdicts that were due under attack
    false_alarms: Proportion  # alarms without an attack, of the verdicts without an attack that were available
    recs_a_day: float  # RECS of one satellite in a day: times `false_alarms`, the false alarms of a satellite in a day

    @property
    def false_alarms_a_day(self) -> tuple[float, float, float]:
        """False alarms of one satellite in a day, and the ends of the interval."""
        rate = self.false_alarms
        return rate.value * self.recs_a_day, rate.low * self.recs_a_day, rate.high * self.recs_a_day


def verdict_counts(results: xarray.Dataset) -> VerdictCounts:
    """Return how often a campaign had each status, in epochs in which a verdict was due."""
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
    """Return κσ, the largest range offset that passes the range check of this campaign."""
    scenario, attributes = scenario_of(results), attributes_of(results)
    overhead = Overhead(attributes.satellites_expected, attributes.cn0_e1_expected_dbhz)
    return receiver_processor(scenario, overhead, None).range_limit_m


def results_digest(results: xarray.Dataset) -> str:
    """Return the SHA-256 of all names, types and values: equal for equal bits, however the store is cut."""
    digest = hashlib.sha256()
    for name in sorted(map(str, results.variables)):
        values = results[name].values
        if values.dtype.kind in "TOU":
            values = np.array([str(text) for text in values])
        digest.update(f"{name} {values.dtype} {values.shape}\n".encode())
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()
