"""Check the received power of a band, measured directly or with the gain that the AGC sets [AKOS12].

The power before the gain control is averaged over W T independent samples, with the bandwidth W and the averaging time
T. The average has the standard deviation 4.343/√(W T) dB, which is 0.03 dB for 2 MHz and 10 ms. Drifts of temperature
and gain (σ_system) are larger, and determine the threshold:

    ΔP = P − P_nominal,    |ΔP| ≤ K √(σ_system² + (4.343 dB)²/(W T)),    K from P_fa, two-sided

A gain control keeps the power at its output constant. So a receiver that reports only the gain also reports the power:
ΔP = −Δgain.

The power of the satellites lies below the noise. A spoofer adds η times the power of the satellites, so the received
power rises more in a narrower band around the signals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vestige.acas_processor.checks.check import LevelMonitor, series_of
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.monitoring.baseline import Quantity
from vestige.records import Band
from vestige.records.checks import CheckName, CheckSeries

DB_PER_NEPER = 10 / math.log(10)  # 4.343 dB: factor from a small relative change of a power to dB


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivedPowerMonitor(LevelMonitor):
    """Monitor that compares the power of a band with its usual value."""

    band: Band
    sigma_system_db: float = 0.3  # standard deviation of the power that drift of gain and temperature causes
    bandwidth_hz: float = 2e6  # W, bandwidth of the power measurement
    averaging_s: float = 0.01  # T, averaging time of the power measurement
    p_fa: float = 1e-6

    @property
    def name(self) -> CheckName:
        """Name of the check."""
        return CheckName(f"{self.band.value} received power")

    @property
    def sigma_db(self) -> float:
        """Standard deviation of ΔP without interference, in dB."""
        return math.hypot(self.sigma_system_db, DB_PER_NEPER / math.sqrt(self.bandwidth_hz * self.averaging_s))

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results for a block; the check also fails if the front end is saturated, at any power."""
        quantity = Quantity.E1_POWER_DB if self.band is Band.E1 else Quantity.E6_POWER_DB
        reference = evidence.references[quantity]
        front_end = evidence.measured.snapshots.front_end.get(self.band)
        measured_db = evidence.observed[quantity]
        statistic = measured_db - reference.value
        if front_end is not None:
            statistic = np.where(front_end.saturated, np.inf, statistic)
        threshold = self.threshold_db * reference.growth

        def explain(epoch: int, _satellite: int) -> str:
            if np.isposinf(statistic[epoch]):
                return f"the {self.band.value} front end is saturated"
            if np.isneginf(measured_db[epoch]):
                return f"the {self.band.value} samples are all zero"
            if np.isnan(measured_db[epoch]):
                return f"no status of the {self.band.value} front end"
            if np.isnan(statistic[epoch]):
                return reference.why_unknown((epoch,))
            return (
                f"{self.band.value} power is {statistic[epoch]:+.1f} dB from its usual level, "
                f"more than {threshold[epoch]:.1f} dB"
            )

        return series_of(self, statistic, threshold, explain, exact=not self.sigma_system_db)
