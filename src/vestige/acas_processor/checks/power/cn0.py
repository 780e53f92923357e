"""Compare the C/N0 of a satellite with the value expected from its elevation and the antenna.

    ΔC = C/N0 − expected,    |ΔC| ≤ K √(σ_estimator² + σ_model²),    K from P_fa, two-sided

The standard deviation of the estimator is known (`sample_processor/cn0.py`). The standard deviation of the model
(antenna pattern, satellite power, slow fading) is larger. Noise and meaconing lower the C/N0, and an overpowered
spoofer raises the C/N0. A matched-power spoofer leaves the C/N0 nearly unchanged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.checks.check import LevelMonitor, series_of
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.monitoring.baseline import Quantity
from vestige.records.checks import CheckName, CheckSeries


@dataclass(frozen=True, slots=True, kw_only=True)
class Cn0Monitor(LevelMonitor):
    """Monitor that compares the C/N0 of a satellite with its expected value."""

    name: ClassVar = CheckName.E1_CN0
    sigma_estimator_db: float = 0.3
    sigma_model_db: float = 1.5  # standard deviation of the true C/N0 about its expected value, in dB
    p_fa: float = 1e-6

    @property
    def sigma_db(self) -> float:
        """Standard deviation of ΔC without interference, in dB."""
        return math.hypot(self.sigma_estimator_db, self.sigma_model_db)

    def statistic(
        self, cn0_dbhz: Float[np.ndarray, "*n"], expected_dbhz: Float[np.ndarray, "*n"]
    ) -> Float[np.ndarray, "*n"]:
        """Return ΔC, the measured minus the expected C/N0, in dB."""
        return cn0_dbhz - expected_dbhz

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block of epochs."""
        reference = evidence.references[Quantity.E1_CN0_DBHZ]
        measured = evidence.observed[Quantity.E1_CN0_DBHZ]
        statistic = self.statistic(measured, reference.value)
        threshold = self.threshold_db * reference.growth

        def explain(epoch: int, satellite: int) -> str:
            here = (epoch, satellite)
            if np.isnan(measured[here]):
                return "C/N0 on E1 is not known"
            if np.isnan(statistic[here]):
                return reference.why_unknown(here)
            return f"C/N0 is {statistic[here]:+.1f} dB from its expected value, more than {threshold[here]:.1f} dB"

        return series_of(self, statistic, threshold, explain)
