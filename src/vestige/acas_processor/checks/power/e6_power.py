"""Check whether the encrypted signal is found where E1 predicts this signal [WFO, Sec. IV-A, step 1].

The check looks for significant E6 correlation power around the delay that E1 predicts. The detection threshold follows
the post-correlation noise of a code that is not in the signal. So a signal without this satellite's encrypted code does
not exceed the threshold by its higher power alone.

A missing E6 signal is an alarm, unless the C/N0 on E1 predicts frequent misses. If no signal is detected, and the
predicted probability of detection is unknown or below `min_pd`, the check is not run.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vestige.acas_processor.checks.check import series_of
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.measurement import Availability
from vestige.records.checks import CheckName, CheckSeries

MIN_PD = 0.9
TOO_WEAK = "E1 predicts a detection probability"  # beginning of the reason why a check of a weak satellite is not run


@dataclass(frozen=True, slots=True, kw_only=True)
class E6PowerCheck:
    """Check whether the encrypted signal was received.

    The statistic is the number of signals that E1 predicts and that are missing, 0 or 1. The check fails if the
    statistic is 1.
    """

    name: ClassVar = CheckName.E6_POWER
    unit: ClassVar = "signals missing"
    min_pd: float = MIN_PD  # a miss is an alarm where E1 predicts at least this probability of detection

    @property
    def p_fa(self) -> float:
        """Upper limit of the false-alarm probability of one test: the probability of a miss at `min_pd`."""
        return 1 - self.min_pd

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block of epochs."""
        measured = evidence.measured
        detected = measured.detected.tap >= 0
        correlated = measured.availability == Availability.CORRELATED
        run = correlated & (detected | (measured.predicted_pd >= self.min_pd))
        statistic = np.where(run, (~detected).astype(np.float64), np.nan)

        def explain(epoch: int, satellite: int) -> str:
            here = (epoch, satellite)
            if not correlated[here]:
                return measured.why_unavailable(epoch, satellite)
            if run[here]:
                return "no encrypted signal where E1 predicts it"
            predicted = measured.predicted_pd[here]
            if np.isnan(predicted):
                return "C/N0 on E1 is not known, so nothing follows from a missing signal"
            return f"{TOO_WEAK} of {predicted:.2g} only, below {self.min_pd:g}"

        return series_of(self, statistic, np.zeros(evidence.shape), explain)
