"""Check whether the pseudoranges of an epoch agree: RAIM by residuals.

See `navigation/raim.py` for the theory. The check does not detect an attack that shifts the ranges of all satellites
consistently, in time or in position.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.checks.check import Monitor, series_of
from vestige.acas_processor.evidence import Evidence
from vestige.navigation.position_fix import UNKNOWNS, Fix
from vestige.navigation.raim import (
    NOT_EXCLUDED,
    chi_square_statistic,
    chi_square_threshold,
    degrees_of_freedom,
    exclude_one,
    missed_detection,
    redundancy,
)
from vestige.records.checks import CheckName, CheckSeries


@dataclass(frozen=True, slots=True, kw_only=True)
class RaimMonitor(Monitor):
    """Monitor that compares the residuals of a fix with the assumed standard deviations of its pseudoranges."""

    name: ClassVar = CheckName.RAIM
    unit: ClassVar = "sigma²"
    p_fa: float = 1e-5

    def threshold(self, fix: Fix) -> Float[np.ndarray, " n"]:
        """Return the threshold of every epoch; NaN without redundant ranges."""
        return chi_square_threshold(degrees_of_freedom(fix.weight), self.p_fa)

    def probability_of_detection(
        self, fix: Fix, column: int, bias_m: Float[np.ndarray, " k"]
    ) -> Float[np.ndarray, " k"]:
        """Return the probability that a bias on the satellite of `column` is detected in the first epoch of a fix."""
        share = redundancy(fix.geometry[:1], fix.weight[:1]).unexplained[0, column]
        freedom = int(degrees_of_freedom(fix.weight[:1])[0])
        return 1 - missed_detection(bias_m**2 * fix.weight[0, column] * share, freedom, self.p_fa)

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results for a block; if a single satellite explains a failure, the reason names this satellite."""
        fix, snapshots = evidence.measured.fix, evidence.measured.snapshots
        nothing = np.full(evidence.shape[0], np.nan)
        used = np.zeros(evidence.shape[0], np.int64) if fix is None else fix.satellites
        statistic = nothing if fix is None else fix.raim_statistic
        threshold = chi_square_threshold(used - UNKNOWNS, self.p_fa)

        def explain(epoch: int, _satellite: int) -> str:
            if fix is None or not used[epoch]:
                return "no position fix"
            if used[epoch] <= UNKNOWNS:
                return f"{used[epoch]} satellites give a position, but no further range to compare"
            one = fix.at(epoch)
            parts = redundancy(one.geometry, one.weight)
            culprit = int(exclude_one(parts, one.residual_m, one.weight, self.p_fa)[0])
            if culprit == NOT_EXCLUDED:
                return "the pseudoranges do not agree, and no single satellite explains it"
            return f"the pseudoranges do not agree; without E{snapshots.svids[culprit]:02d} they do"

        return series_of(self, statistic, threshold, explain, exact=fix is not None and not fix.bounded)


def raim_statistic(fix: Fix) -> Float[np.ndarray, " n"]:
    """Return the weighted sum of squared residuals of every epoch; NaN without redundant ranges."""
    enough = fix.valid & (degrees_of_freedom(fix.weight) > 0)
    return np.where(enough, chi_square_statistic(fix.residual_m, fix.weight), np.nan)
