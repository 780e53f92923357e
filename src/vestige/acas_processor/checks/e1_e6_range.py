"""Check whether the E6 range agrees with the E1 range within κσ [WFO, Sec. IV-A, step 2; TAES2023, Eq. 21-24]."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from vestige.acas_processor.checks.check import series_of
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.position.error_budget import ErrorBudget
from vestige.records.checks import CheckName, CheckSeries

KAPPA = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RangeCheck:
    """Check whether the range difference between E6 and E1 is at most κσ, with σ from the error budget."""

    name: ClassVar = CheckName.E1_E6_RANGE
    unit: ClassVar = "m"
    budget: ErrorBudget = field(default_factory=ErrorBudget.uncorrected)  # error budget that gives σ
    kappa: float = KAPPA  # κ, factor of σ

    @property
    def p_fa(self) -> float:
        """False-alarm probability of one test; an upper limit if σ is larger than the 1σ error of the range offset."""
        return math.erfc(self.kappa / math.sqrt(2))

    @property
    def limit_m(self) -> float:
        """κσ, the largest |range offset| that passes, in m."""
        return self.kappa * self.budget.sigma_m

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block of epochs."""
        offset_m = np.asarray(evidence.measured.detected.range_offset_m, np.float64)

        def explain(epoch: int, satellite: int) -> str:
            offset = offset_m[epoch, satellite]
            if np.isnan(offset):
                return "nothing detected"
            return f"E6 is {offset:+.1f} m from the E1 prediction, more than {self.limit_m:.1f} m"

        return series_of(self, offset_m, np.full(evidence.shape, self.limit_m), explain)
