"""Check for runs of missed E6 signals, with a chosen number of false alarms a day [WFO, Sec. IV-A, step 1].

`e6_power.py` raises an alarm with every miss where E1 predicts a detection. Weak satellites are missed by chance
several times a day. A check with fewer false alarms therefore needs several misses of a weak satellite in a row. The
required number of misses follows from C/N0.

Theory of operation
-------------------
The C/N0 on E1 predicts the probability q_k that RECS k of a satellite is missed without an attack. The probability q_k
is averaged over fading by multipath with the configured power (`theory/fading.py`). If misses of different RECS are
independent, a run of misses has the probability ∏ q_k. The check fails where

    ∏ q_k < p_fa,        over the misses since the last detection

Let R be the shortest run of RECS that ends with RECS k and has ∏ q_k < p_fa. The test of RECS k can fail only if all
RECS of R were missed. The probability that all RECS of R are missed is below p_fa. So the false-alarm probability of a
test is below p_fa at any C/N0. With a constant q the check fails after M misses in a row:

    M = ⌈ln p_fa / ln q⌉

For p_fa = 2·10⁻⁵, RECS of 16 ms, multipath of −15.8 dB and `detection_p_fa` = 10⁻⁷, M is 1 at 38 dBHz, 2 at 35 dBHz, 4
at 33 dBHz, and 5 at 32 dBHz. A rule "M misses in N RECS" with N > M needs a larger M for an equal p_fa. A rule of this
kind detects a missing signal later.

Misses are not independent if multipath does not change from one RECS to the next. If satellites are weaker on E6 than
E1 predicts, q_k is too small. The configured `e6_over_e1_db` must therefore be right.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float

from vestige.acas_processor.checks.check import Monitor, series_of
from vestige.acas_processor.checks.power.e6_power import MIN_PD, TOO_WEAK
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.measurement import Availability, MeasurementBlock
from vestige.acas_processor.monitoring.memory import CheckMemory
from vestige.records.checks import CheckName, CheckSeries
from vestige.theory.fading import faded_miss_probability

_CN0_DECIMALS = 2  # decimals to which C/N0 in dBHz is rounded, as for the predicted probability of detection
_LEAST = 1e-300  # smallest stored probability of a run of misses; JSON has no number for −log₁₀ 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MissPrediction:
    """Prediction of the probability that a RECS is missed without an attack, from the C/N0 on E1."""

    min_pd: float = MIN_PD  # a miss counts where E1 predicts at least this probability of detection
    detection_p_fa: float = 1e-7  # false-alarm probability of the detection in one correlator
    ray_power_db: float = -15.8  # mean power of all reflections over the direct signal in dB
    e6_over_e1_db: float = 0.0  # expected C/N0 of E6 minus the C/N0 of E1, in dB

    def counting(self, measured: MeasurementBlock) -> Bool[np.ndarray, "n m"]:
        """Return whether a miss counts: E1 must predict a detection probability of at least `min_pd`."""
        correlated = measured.availability == Availability.CORRELATED
        return correlated & (measured.predicted_pd >= self.min_pd)

    def probability(self, measured: MeasurementBlock, where: Bool[np.ndarray, "n m"]) -> Float[np.ndarray, "n m"]:
        """Return the probability of a miss where `where` is true, averaged over fading; NaN elsewhere."""
        found = np.full(where.shape, np.nan)
        expected_dbhz = np.asarray(measured.snapshots.e1.cn0_dbhz, np.float64) + self.e6_over_e1_db
        for length_s in np.unique(measured.banks.integration_s[where]).tolist():
            here = where & (measured.banks.integration_s == length_s)
            levels, place = np.unique(np.round(expected_dbhz[here], _CN0_DECIMALS), return_inverse=True)
            found[here] = faded_miss_probability(levels, length_s, self.detection_p_fa, self.ray_power_db)[place]
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class E6MissesCheck(Monitor):
    """Check whether RECS are missed so often in a row that the misses are less probable than `p_fa` without an attack.

    The statistic is −log₁₀ of the probability of the misses in a row, and 0 at a detected RECS. At a missed RECS, the
    check is not run if the misses in a row are more probable than `p_fa`, or if this miss does not count.
    """

    name: ClassVar = CheckName.E6_POWER
    unit: ClassVar = "decades"
    p_fa: float = 1e-5  # false-alarm probability of one test, an upper limit
    prediction: MissPrediction = MissPrediction()

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block of epochs."""
        measured = evidence.measured
        correlated = measured.availability == Availability.CORRELATED
        detected = correlated & (measured.detected.tap >= 0)
        decades, _ = self._runs(evidence)
        limit = -math.log10(self.p_fa)
        statistic = np.where(detected, 0.0, np.where(decades > limit, decades, np.nan))

        def explain(epoch: int, satellite: int) -> str:
            here = (epoch, satellite)
            if not correlated[here]:
                return measured.why_unavailable(epoch, satellite)
            missed = "no encrypted signal where E1 predicts it"
            if statistic[here] > limit:
                chance = 10 ** -decades[here]
                return f"{missed}; so many misses in a row have a probability of {chance:.1g} without an attack"
            if np.isfinite(decades[here]):
                return (
                    f"{missed}, which has a probability of {10 ** -decades[here]:.1g} without an attack: "
                    f"an alarm follows below {self.p_fa:.1g}"
                )
            predicted = measured.predicted_pd[here]
            if np.isnan(predicted):
                return "C/N0 on E1 is not known, so nothing follows from a missing signal"
            return f"{TOO_WEAK} of {predicted:.2g} only, below {self.prediction.min_pd:g}"

        return series_of(self, statistic, np.full(evidence.shape, limit), explain)

    def remember(self, evidence: Evidence) -> CheckMemory:
        """Return −log₁₀ of the probability of the current run of misses, for each satellite with a run of misses."""
        return {svid: (run,) for svid, run in self._runs(evidence)[1].items()}

    def _runs(self, evidence: Evidence) -> tuple[Float[np.ndarray, "n m"], dict[int, float]]:
        """Return −log₁₀ of the probability of each run of misses (NaN without a run), and the runs after the block.

        The logarithms are added in the order of the RECS, so the division into blocks changes no bit of the sum.
        """
        measured = evidence.measured
        detected = (measured.detected.tap >= 0) & (measured.availability == Availability.CORRELATED)
        missed = self.prediction.counting(measured) & ~detected
        decades = -np.log10(np.maximum(self.prediction.probability(measured, missed), _LEAST))
        after = {svid: run for svid, (run,) in evidence.memory.items()}
        for column, svid in enumerate(measured.snapshots.svids):
            run = after.pop(svid, 0.0)
            for row in np.flatnonzero(missed[:, column] | detected[:, column]).tolist():
                run = 0.0 if detected[row, column] else min(run + float(decades[row, column]), -math.log10(_LEAST))
                if missed[row, column]:
                    decades[row, column] = run
            if run:
                after[svid] = run
        return decades, after


def expected_miss_rate(prediction: MissPrediction, measured: MeasurementBlock) -> float:
    """Return the probability that a test of `E6PowerCheck` fails without an attack: the mean over the tests of a block.

    A test in which a miss does not count never fails. The result is 0 if there are no tests.
    """
    counting = prediction.counting(measured)
    detected = (measured.detected.tap >= 0) & (measured.availability == Availability.CORRELATED)
    tests = np.count_nonzero(counting | detected)
    return float(np.sum(prediction.probability(measured, counting)[counting])) / tests if tests else 0.0
