"""Compare the E6 noise floor, measured with codes that are not in the signal, with its usual value [WFO, Sec. IV-A].

The detection threshold follows the measured noise floor, so a higher floor causes misses but no additional false
detections. A rise of the floor may explain a miss. The cause of a rise is noise on E6, or the self-noise of a strong
random code from a spoofer. The mean power over all codes of N_c chips that are not in the signal has the standard
deviation 4.343/√N_c dB:

    ΔN = floor − nominal,    |ΔN| ≤ K √(σ_system² + (4.343 dB)²/N_c),    K from P_fa, two-sided

The measured floor and the nominal floor are referred to the input of the gain control. Otherwise a gain that follows
the noise would hide a rise of the noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.checks.check import LevelMonitor, series_of, two_sided_factor
from vestige.acas_processor.checks.power.received_power import DB_PER_NEPER
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.measurement import Availability
from vestige.acas_processor.monitoring.baseline import Quantity
from vestige.records.checks import CheckName, CheckSeries
from vestige.signals.definitions import E6C


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseFloorMonitor(LevelMonitor):
    """Monitor that compares the noise floor of the correlators with its usual value."""

    name: ClassVar = CheckName.NOISE_FLOOR
    n_chips: int = round(16e-3 * E6C.chip_rate_hz)  # N_c, number of chips of the RECS
    sigma_system_db: float = 0.3  # standard deviation of the floor that drift of gain and temperature causes
    p_fa: float = 1e-6

    @property
    def sigma_db(self) -> float:
        """Standard deviation of ΔN without interference, in dB."""
        return math.hypot(self.sigma_system_db, DB_PER_NEPER / math.sqrt(self.n_chips))

    def probability_of_detection(self, jam_to_noise_db: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the probability that the monitor detects jamming noise of the given J/N in the band of the code."""
        rise_db = 10 * np.log10(1 + 10 ** (jam_to_noise_db / 10))
        return LevelMonitor.probability_of_detection(self, rise_db)

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block of epochs."""
        measured, reference = evidence.measured, evidence.references[Quantity.FLOOR_DB]
        correlated = measured.availability == Availability.CORRELATED
        n_chips = np.round(np.where(correlated, measured.banks.integration_s, 1.0) * E6C.chip_rate_hz)
        sigma_db = np.hypot(self.sigma_system_db, DB_PER_NEPER / np.sqrt(n_chips))
        statistic = evidence.observed[Quantity.FLOOR_DB] - reference.value
        threshold = two_sided_factor(self.p_fa) * sigma_db * reference.growth

        def explain(epoch: int, satellite: int) -> str:
            here = (epoch, satellite)
            if not correlated[here]:
                return "nothing was correlated on E6"
            if np.isnan(evidence.observed[Quantity.FLOOR_DB][here]):
                return "the gain of the E6 front end is not known"
            if np.isnan(statistic[here]):
                return reference.why_unknown(here)
            return (
                f"the E6 noise floor is {statistic[here]:+.1f} dB from its usual level, "
                f"more than {threshold[here]:.1f} dB"
            )

        return series_of(self, statistic, threshold, explain, exact=not self.sigma_system_db)
