"""The E6 noise floor, measured with codes that are not in the signal, against its calibration [WFO, Sec. IV-A].

The detection threshold follows this floor, so that raising it never makes a false detection but only misses. A floor
that rises says why there was a miss: noise on E6, or the self-noise of a strong random code, which does not come from
the sky. The mean over all wrong codes of N_c chips scatters by 4.343/√N_c dB:

    ΔN = floor − nominal,    |ΔN| ≤ K √(σ_system² + (4.343 dB)²/N_c),    K from P_fa, two-sided

Both are before the gain control: a gain that follows the noise would hide it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.monitors.judgement import (
    check_budget,
    judged,
    not_run,
    two_sided_detection,
    two_sided_factor,
)
from vestige.acas_processor.monitors.received_power import DB_PER_NEPER
from vestige.records import CheckResult


@dataclass(frozen=True, slots=True, kw_only=True)
class WrongCodeFloorMonitor:
    """Whether the noise floor of the correlators is what it was when the receiver was calibrated.

    Attributes
    ----------
    nominal_floor_db
        Floor without interference, 10 log₁₀ of the noise power before the gain control.
    n_chips
        N_c, chips of the RECS.
    sigma_system_db
        Drift of gain and temperature, 1σ.
    p_fa
        False-alarm probability of one test.
    """

    nominal_floor_db: float
    n_chips: int
    sigma_system_db: float = 0.3
    p_fa: float = 1e-6

    def __post_init__(self) -> None:
        check_budget(self.p_fa)

    @property
    def name(self) -> str:
        """Name in `CheckResult`."""
        return "wrong-code floor"

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""
        return "dB"

    @property
    def sigma_db(self) -> float:
        """Standard deviation of ΔN without interference, in dB."""
        return math.hypot(self.sigma_system_db, DB_PER_NEPER / math.sqrt(self.n_chips))

    @property
    def threshold_db(self) -> float:
        """Largest |ΔN| that passes, in dB."""
        return two_sided_factor(self.p_fa) * self.sigma_db

    def statistic(
        self, noise_power: Float[np.ndarray, "*n"], agc_gain_db: Float[np.ndarray, "*n"]
    ) -> Float[np.ndarray, "*n"]:
        """Return ΔN in dB; NaN where no noise power was measured."""
        measured = noise_power > 0
        floor = 10 * np.log10(np.where(measured, noise_power, 1.0)) - agc_gain_db - self.nominal_floor_db
        return np.where(measured, floor, np.nan)

    def probability_of_detection(self, jam_to_noise_db: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the probability that added noise of J/N, in the band of the code, is seen."""
        rise_db = 10 * np.log10(1 + 10 ** (jam_to_noise_db / 10))
        return two_sided_detection(rise_db / self.sigma_db, self.p_fa)

    def check(self, noise_power: float | None, agc_gain_db: float | None) -> CheckResult:
        """Return the check of one snapshot; None is not known."""
        if noise_power is None or not noise_power > 0:
            return not_run(self, "nothing was correlated on E6", self.threshold_db)
        if agc_gain_db is None or math.isnan(agc_gain_db):
            return not_run(self, "the gain of the E6 front end is not known", self.threshold_db)
        rise = float(self.statistic(np.array([noise_power]), np.array([agc_gain_db]))[0])
        failure = f"the E6 noise floor is {rise:+.1f} dB from its calibration, more than {self.threshold_db:.1f} dB"
        return judged(self, rise, self.threshold_db, failure)
