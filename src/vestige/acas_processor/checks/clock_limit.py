"""Check whether the clock error that the E1 ranges show is within its stated limit.

Theory of operation
-------------------
The receiver has a clock that GNSS does not set. U is the stated upper limit of the error of this clock against Galileo
System Time (`time_uncertainty_s`). The E1 ranges also measure the clock error: a position fix gives b, the clock error
multiplied by c. A replay with the delay τ increases b by c τ, even if the attacker suppresses other signals. The check
passes if

    with a fix       |b|/c ≤ U + (`MARGIN_M` + K σ_b)/c
    without a fix    |median(P)/c − 85 ms| ≤ U + 20 ms

P is the set of E1 pseudoranges of the epoch. The travel times of Galileo signals to the Earth lie between 65 and 105 ms
(`position/possible_range.py`). `MARGIN_M` covers ionosphere, troposphere and orbit errors, which the fix does not
correct. σ_b is the standard deviation of b without errors that are common to all satellites, and K follows from `p_fa`.

The check depends on U. A replay passes if it is no later than U allows, or if the error of the clock cancels the delay
of the replay. After AUTHENTIC verdicts, the processor assumes a smaller limit for its searches. The check does not use
the smaller limit, because an attack may have begun before these verdicts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vestige.acas_processor.checks.check import Monitor, series_of, two_sided_factor
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.position.clock_error import TRAVEL_SPREAD_S, clock_error
from vestige.acas_processor.position.possible_range import MARGIN_M
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records.checks import CheckName, CheckSeries

CLOCK_LIMIT_P_FA = 1e-9  # false-alarm probability of one test; K is about 6, and K σ_b is about 10 m


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockLimitMonitor(Monitor):
    """Monitor that compares the clock error from the E1 ranges with the stated limit of this error.

    Attributes
    ----------
    p_fa
        False-alarm probability of one test, an upper limit if the stated limit of the clock's error is right.
    """

    name: ClassVar = CheckName.CLOCK_LIMIT
    unit: ClassVar = "s"
    p_fa: float = CLOCK_LIMIT_P_FA

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block of epochs."""
        stated_s = evidence.measured.snapshots.time_uncertainty_s
        limit_s = np.where(np.isfinite(stated_s), stated_s, np.nan)
        shown = clock_error(evidence.measured)
        late_s, fixed = shown.error_s, shown.of_fix
        with_fix_s = (MARGIN_M + two_sided_factor(self.p_fa) * shown.sigma_m) / SPEED_OF_LIGHT_MPS
        threshold_s = limit_s + np.where(fixed, with_fix_s, TRAVEL_SPREAD_S)

        def explain(epoch: int, satellite: int) -> str:  # noqa: ARG001  (of the receiver)
            if np.isnan(limit_s[epoch]):
                return "no upper limit of the error of the receiver's clock is known"
            if np.isnan(late_s[epoch]):
                return "E1 has no pseudorange"
            how = "late" if late_s[epoch] > 0 else "early"
            means = "the position fix shows" if fixed[epoch] else "the travel times on E1 show"
            return (
                f"{means} that the signals are {abs(late_s[epoch]):.9g} s {how} by the receiver's clock, more than the "
                f"{threshold_s[epoch]:.9g} s that the limit of its error allows"
            )

        return series_of(self, late_s, threshold_s, explain)
