"""Received power of a band, or the gain that its AGC sets against it [AKOS12].

The power before the gain control, averaged over W T independent samples, scatters by 4.343/√(W T) dB: 0.03 dB in 2 MHz
and 10 ms. Temperature and gain drift scatter more, and set the threshold:

    ΔP = P − P_nominal,    |ΔP| ≤ K √(σ_system² + (4.343 dB)²/(W T)),    K from P_fa, two-sided

A gain control holds the power behind it, so a receiver that tells only the gain tells the power: ΔP = −Δgain.

A spoofer adds η times the satellites' power, which lies below the noise: the rise is large only in a narrow band.
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
from vestige.records import Band, CheckResult, FrontEndStatus, Outcome

DB_PER_NEPER = 10 / math.log(10)  # 4.343: dB of a small relative change of a power


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivedPowerMonitor:
    """Whether the power of a band is what it was when the receiver was calibrated.

    Attributes
    ----------
    band
        Whose front end.
    nominal_power_db
        Power without interference, in the reference of `FrontEndStatus`.
    sigma_system_db
        Drift of gain and temperature, 1σ.
    bandwidth_hz, averaging_s
        W and T of the power measurement.
    p_fa
        False-alarm probability of one test.
    """

    band: Band
    nominal_power_db: float = 0.0
    sigma_system_db: float = 0.3
    bandwidth_hz: float = 2e6
    averaging_s: float = 0.01
    p_fa: float = 1e-6

    def __post_init__(self) -> None:
        check_budget(self.p_fa)

    @property
    def name(self) -> str:
        """Name in `CheckResult`."""
        return f"{self.band.value} received power"

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""
        return "dB"

    @property
    def sigma_db(self) -> float:
        """Standard deviation of ΔP without interference, in dB."""
        return math.hypot(self.sigma_system_db, DB_PER_NEPER / math.sqrt(self.bandwidth_hz * self.averaging_s))

    @property
    def threshold_db(self) -> float:
        """Largest |ΔP| that passes, in dB."""
        return two_sided_factor(self.p_fa) * self.sigma_db

    def statistic(self, total_power_db: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return ΔP in dB; where only an AGC gain is known, give its negative."""
        return total_power_db - self.nominal_power_db

    def probability_of_detection(self, rise_db: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the probability that a rise (or fall) of the power is seen."""
        return two_sided_detection(rise_db / self.sigma_db, self.p_fa)

    def check(self, status: FrontEndStatus | None) -> CheckResult:
        """Return the check of one snapshot; a saturated front end fails it, whatever power it reads."""
        if status is None:
            return not_run(self, f"no status of the {self.band.value} front end", self.threshold_db)
        power = status.total_power_db if math.isfinite(status.total_power_db) else -status.agc_gain_db
        rise = power - self.nominal_power_db
        if status.saturated:
            return CheckResult(
                name=self.name,
                outcome=Outcome.FAIL,
                statistic=rise,
                threshold=self.threshold_db,
                unit=self.unit,
                reason=f"the {self.band.value} front end is saturated",
            )
        failure = (
            f"{self.band.value} power is {rise:+.1f} dB from its calibration, more than {self.threshold_db:.1f} dB"
        )
        return judged(self, rise, self.threshold_db, failure)
