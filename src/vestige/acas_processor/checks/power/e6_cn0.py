"""Compare the C/N0 of E6 in one RECS with the expected C/N0 of the satellite [WFO, Sec. IV-B].

A second encrypted signal, stronger or of opposite phase, changes the magnitude of the correlators. The expected
amplitude is s = √(2 C/N0 T) for the integration time T. The largest magnitude |c| in the bank, in standard deviations
of the noise per dimension, has approximately a Rician distribution. For a detectable signal the distribution is nearly
normal about √(s² + 1):

    |c| − √(s² + 1),    | · | ≤ K √(1 + (s (10^(σ_model/20) − 1))²),    K from p_fa, two-sided

σ_model covers fading by reflections, the loss between two taps (at most 1.2 dB for taps 15 m apart), and differences of
antennas and satellites. With the default of 1.5 dB, σ_model adds more to the standard deviation than noise adds if s is
above 5.3. The errors that σ_model covers are not always present, so `p_fa` is an upper limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.checks.check import Monitor, series_of, two_sided_factor
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.measurement import Availability
from vestige.acas_processor.monitoring.baseline import Quantity
from vestige.records.checks import CheckName, CheckSeries
from vestige.theory.thresholds import correlator_amplitude


@dataclass(frozen=True, slots=True, kw_only=True)
class E6StrengthMonitor(Monitor):
    """Monitor that compares the strength of the encrypted signal with its expected value."""

    name: ClassVar = CheckName.E6_CN0
    unit: ClassVar = "sigma"
    sigma_model_db: float = 1.5  # standard deviation of the true C/N0 about its expected value
    p_fa: float = 1e-6  # false-alarm probability of one test of one satellite, an upper limit

    def statistic(
        self,
        magnitude_sigma: Float[np.ndarray, "*n"],
        expected_cn0_dbhz: Float[np.ndarray, "*n"],
        integration_s: float | Float[np.ndarray, "*n"],
    ) -> Float[np.ndarray, "*n"]:
        """Return |c| − √(s² + 1), the measured minus the expected magnitude.

        `magnitude_sigma` is the largest |c| of the bank, in standard deviations of the noise per dimension.
        """
        return magnitude_sigma - np.sqrt(correlator_amplitude(expected_cn0_dbhz, integration_s) ** 2 + 1)

    def threshold(
        self, expected_cn0_dbhz: Float[np.ndarray, "*n"], integration_s: float | Float[np.ndarray, "*n"]
    ) -> Float[np.ndarray, "*n"]:
        """Return the largest |statistic| with which the monitor passes."""
        spread = correlator_amplitude(expected_cn0_dbhz, integration_s) * (10 ** (self.sigma_model_db / 20) - 1)
        return two_sided_factor(self.p_fa) * np.hypot(1.0, spread)

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block of epochs."""
        reference, banks = evidence.references[Quantity.E6_CN0_DBHZ], evidence.measured.banks
        correlated = evidence.measured.availability == Availability.CORRELATED
        noise = np.where(correlated, banks.noise_power, 1.0)
        magnitude = np.max(np.abs(np.where(correlated[..., None], banks.taps, 0.0)), axis=2) / np.sqrt(noise / 2)
        statistic = np.where(correlated, self.statistic(magnitude, reference.value, banks.integration_s), np.nan)
        threshold = self.threshold(reference.value, banks.integration_s) * reference.growth

        def explain(epoch: int, satellite: int) -> str:
            here = (epoch, satellite)
            if not correlated[here]:
                return "nothing was correlated on E6"
            if np.isnan(statistic[here]):
                return reference.why_unknown(here)
            return f"E6 is {statistic[here]:+.1f} sigma from its expected strength"

        return series_of(self, statistic, threshold, explain)
