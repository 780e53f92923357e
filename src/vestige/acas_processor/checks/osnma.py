"""Check whether OSNMA keys still arrive, and whether demodulated fields agree with the fields that were sent.

An attacker who cannot forge OSNMA can prevent its reception. Noise that is just strong enough for bit errors does not
disturb ranging, but prevents the reception of keys and tags. Two methods detect an attack on the reception.

**Availability.** The statistic counts the subframes without a validated key among the last n subframes. Without an
attack, each subframe lacks a key with the assumed probability p, independently of other subframes, so the count is
binomial. The threshold is the smallest count that is exceeded with a probability of at most P_fa.

**Assisted comparison** [WFO, Sec. IV-C]. Keys and tags also come from a second channel (the network). Missing and
different fields are counted one by one, so a single subframe is enough for a test. A reception error passes the
checksum of a page with a probability of only 2⁻²⁴. A single field that differs although its page passed the checksum is
therefore strong evidence of another transmitter.

The checks do not detect an attack that leaves the data unchanged. The comparison proves nothing if the attacker
controls the second channel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int64
from scipy.special import bdtrc

from vestige.acas_processor.checks.check import Check, Monitor, count_threshold, series_of
from vestige.acas_processor.evidence import Evidence
from vestige.records.checks import CheckName, CheckSeries


@dataclass(frozen=True, slots=True, kw_only=True)
class _LossMonitor(Monitor):
    """Monitor that fails if too many losses occur; without an attack the probability of a failure is at most P_fa."""

    loss_probability: float = 0.02  # probability of a loss in one trial without an attack
    p_fa: float = 1e-5

    def threshold(self, trials: int) -> int:
        """Return the largest number of losses in `trials` trials with which the monitor passes."""
        return count_threshold(trials, self.loss_probability, self.p_fa)

    def probability_of_false_alarm(self, trials: int) -> float:
        """Return the probability of a false alarm with `trials` trials, at most `p_fa`."""
        return float(bdtrc(self.threshold(trials), trials, self.loss_probability))

    def probability_of_detection(
        self, loss_probability: Float[np.ndarray, " k"], trials: int
    ) -> Float[np.ndarray, " k"]:
        """Return the probability that the monitor detects jamming that causes a given probability of loss."""
        return bdtrc(float(self.threshold(trials)), trials, loss_probability)

    def _limits(self, trials: Int64[np.ndarray, " k"]) -> Int64[np.ndarray, " k"]:
        return np.array([self.threshold(one) for one in trials.tolist()], np.int64)


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaAvailabilityMonitor(_LossMonitor):
    """Check whether enough subframes brought a validated key."""

    name: ClassVar = CheckName.OSNMA_AVAILABILITY
    unit: ClassVar = "subframes"

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block; tests are made at the ends of subframes."""
        found = evidence.subframes
        limits = self._limits(found.window)
        return _series(
            self, evidence, found.missing, limits, limits < found.window,
            "subframes are too few to say that keys are missing",
            lambda count, limit: f"{count:.0f} of the last subframes brought no validated key, more than {limit:.0f}",
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaAgreementMonitor:
    """Monitor that compares received fields with the fields of the second channel; it fails at any difference."""

    name: ClassVar = CheckName.OSNMA_AGREEMENT
    unit: ClassVar = "fields"

    p_fa: float = 2.0**-24  # probability that a page with reception errors passes its checksum CRC-24

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block; tests are made at the ends of subframes."""
        found = evidence.subframes
        return _series(
            self, evidence, found.differs, np.zeros_like(found.differs), found.received > 0,
            "no field was received",
            lambda count, _: f"{count:.0f} fields are not what the satellites sent",
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaReceptionMonitor(_LossMonitor):
    """Monitor of OSNMA fields that were lost although the second channel has them."""

    name: ClassVar = CheckName.OSNMA_RECEPTION
    unit: ClassVar = "fields"

    loss_probability: float = 0.01

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the results of the check for a block; tests are made at the ends of subframes."""
        found = evidence.subframes
        limits = self._limits(found.due)
        return _series(
            self, evidence, found.lost, limits, limits < found.due,
            "fields are too few to say that some are missing",
            lambda count, limit: f"{count:.0f} fields were lost, more than {limit:.0f}",
        )  # fmt: skip


def _series(
    check: Check,
    evidence: Evidence,
    count: Int64[np.ndarray, " k"],
    limit: Int64[np.ndarray, " k"],
    enough: Bool[np.ndarray, " k"],
    too_few: str,
    failed: Callable[[float, float], str],
) -> CheckSeries:
    """Return the results of a check at the ends of subframes; NaN at other epochs, and where `enough` is false.

    If several subframes end between two epochs, the subframe with the largest excess over its limit counts.
    """
    ends = evidence.subframes.epoch
    statistic, threshold = np.full((2, evidence.shape[0]), np.nan)
    for row, value, most in zip(ends[enough].tolist(), count[enough].tolist(), limit[enough].tolist(), strict=True):
        if np.isnan(statistic[row]) or value - most > statistic[row] - threshold[row]:
            statistic[row], threshold[row] = value, most

    def explain(epoch: int, _satellite: int) -> str:
        if not np.isnan(statistic[epoch]):
            return failed(statistic[epoch], threshold[epoch])
        if evidence.measured.snapshots.osnma is None:
            return "no OSNMA data from a second channel"
        return too_few if epoch in ends else "no subframe ended since the epoch before"

    return series_of(check, statistic, threshold, explain)
