"""OSNMA as checks: whether keys still come, and whether what was demodulated is what the satellites sent.

An attacker who cannot forge OSNMA can keep it from being received: noise just strong enough for bit errors leaves
ranging intact and denies keys and tags. Two checks look for that.

**Availability.** Of the last n subframes so many brought no validated key. Without an attack each is lost with a known
probability p, so the number is binomial, and the threshold is the smallest count that is exceeded with at most P_fa.

**Assisted comparison** [WFO, Sec. IV-C]. Keys and tags come from a second channel (the network) too. Fields that are
missing or damaged count as above, now field by field and so within seconds. A field whose page passed its checksum
and yet differs is no reception error (2⁻²⁴ a page): one is enough to say that somebody else sent it.

They see no attack that leaves the data alone, and a second channel in the attacker's hand proves nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int64
from scipy.special import bdtrc

from vestige.acas_processor.checks.check import check_budget, count_threshold
from vestige.acas_processor.evidence import Evidence
from vestige.records.checks import CheckName, CheckSeries


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaAvailabilityMonitor:
    """Whether enough subframes brought a validated key.

    Attributes
    ----------
    loss_probability
        Probability that a subframe brings none without an attack.
    p_fa
        Budget of one test; the test keeps below it.
    """

    loss_probability: float = 0.02
    p_fa: float = 1e-5

    def __post_init__(self) -> None:
        check_budget(self.p_fa)

    @property
    def name(self) -> CheckName:
        """What the check is called."""
        return CheckName.OSNMA_AVAILABILITY

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""
        return "subframes"

    def threshold(self, subframes: int) -> int:
        """Return the largest number of subframes without a key that passes."""
        return count_threshold(subframes, self.loss_probability, self.p_fa)

    def probability_of_false_alarm(self, subframes: int) -> float:
        """Return the probability of a false alarm, at most `p_fa`."""
        return float(bdtrc(self.threshold(subframes), subframes, self.loss_probability))

    def probability_of_detection(
        self, loss_probability: Float[np.ndarray, " k"], subframes: int
    ) -> Float[np.ndarray, " k"]:
        """Return the probability that an attack is seen under which a subframe is lost with this probability."""
        return bdtrc(float(self.threshold(subframes)), subframes, loss_probability)

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the check over a block; it is made at the end of each subframe."""
        found = evidence.subframes
        limits = np.array([self.threshold(window) for window in found.window.tolist()], np.int64)
        statistic, threshold = scattered(evidence, found.epoch, found.missing, limits, limits < found.window)

        def explain(epoch: int, satellite: int) -> str:  # noqa: ARG001  (of the receiver)
            if np.isnan(statistic[epoch]):
                return why_not_run(evidence, epoch, "subframes are too few to say that keys are missing")
            return (
                f"{statistic[epoch]:.0f} of the last subframes brought no validated key, more than "
                f"{threshold[epoch]:.0f}"
            )

        return CheckSeries(
            name=self.name,
            unit=self.unit,
            p_fa=self.p_fa,
            statistic=statistic,
            threshold=threshold,
            explain=explain,
            exact=False,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaAgreementMonitor:
    """Whether what was received is what the second channel has; one difference is one too many.

    Attributes
    ----------
    p_fa
        Of one field: CRC-24 passes a damaged page with 2⁻²⁴.
    """

    p_fa: float = 2.0**-24

    @property
    def name(self) -> CheckName:
        """What the check is called."""
        return CheckName.OSNMA_AGREEMENT

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""
        return "fields"

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the check over a block; it is made at the end of each subframe."""
        found = evidence.subframes
        none = np.zeros(found.epoch.size, np.int64)
        statistic, threshold = scattered(evidence, found.epoch, found.differs, none, found.received > 0)

        def explain(epoch: int, satellite: int) -> str:  # noqa: ARG001  (of the receiver)
            if np.isnan(statistic[epoch]):
                return why_not_run(evidence, epoch, "no field was received")
            return f"{statistic[epoch]:.0f} fields are not what the satellites sent"

        return CheckSeries(
            name=self.name,
            unit=self.unit,
            p_fa=self.p_fa,
            statistic=statistic,
            threshold=threshold,
            explain=explain,
            exact=False,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaReceptionMonitor:
    """Whether OSNMA was received as the second channel has it.

    Attributes
    ----------
    loss_probability
        Probability that a field is lost without an attack.
    p_fa
        Budget of one test of the lost fields; the test keeps below it.
    """

    loss_probability: float = 0.01
    p_fa: float = 1e-5

    def __post_init__(self) -> None:
        check_budget(self.p_fa)

    @property
    def name(self) -> CheckName:
        """What the check is called."""
        return CheckName.OSNMA_RECEPTION

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""
        return "fields"

    def threshold(self, fields: int) -> int:
        """Return the largest number of lost fields that passes."""
        return count_threshold(fields, self.loss_probability, self.p_fa)

    def probability_of_false_alarm(self, fields: int) -> float:
        """Return the probability of a false alarm, at most `p_fa`."""
        return float(bdtrc(self.threshold(fields), fields, self.loss_probability))

    def probability_of_detection(
        self, loss_probability: Float[np.ndarray, " k"], fields: int
    ) -> Float[np.ndarray, " k"]:
        """Return the probability that jamming is seen under which a field is lost with this probability."""
        return bdtrc(float(self.threshold(fields)), fields, loss_probability)

    def series(self, evidence: Evidence) -> CheckSeries:
        """Return the check over a block; it is made at the end of each subframe."""
        found = evidence.subframes
        limits = np.array([self.threshold(due) for due in found.due.tolist()], np.int64)
        statistic, threshold = scattered(evidence, found.epoch, found.lost, limits, limits < found.due)

        def explain(epoch: int, satellite: int) -> str:  # noqa: ARG001  (of the receiver)
            if np.isnan(statistic[epoch]):
                return why_not_run(evidence, epoch, "fields are too few to say that some are missing")
            return f"{statistic[epoch]:.0f} fields were lost, more than {threshold[epoch]:.0f}"

        return CheckSeries(
            name=self.name,
            unit=self.unit,
            p_fa=self.p_fa,
            statistic=statistic,
            threshold=threshold,
            explain=explain,
            exact=False,
        )


def scattered(
    evidence: Evidence,
    epoch: Int64[np.ndarray, " k"],
    count: Int64[np.ndarray, " k"],
    limit: Int64[np.ndarray, " k"],
    enough: Bool[np.ndarray, " k"],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return statistic and threshold of every epoch, NaN between the ends of subframes, or where they say nothing.

    Of several subframes that end up to one epoch the worst counts.
    """
    statistic, threshold = np.full(evidence.shape[0], np.nan), np.full(evidence.shape[0], np.nan)
    for row, value, most in zip(epoch[enough].tolist(), count[enough].tolist(), limit[enough].tolist(), strict=True):
        if np.isnan(statistic[row]) or value - most > statistic[row] - threshold[row]:
            statistic[row], threshold[row] = value, most
    return statistic, threshold


def why_not_run(evidence: Evidence, epoch: int, too_few: str) -> str:
    """Return why a check of OSNMA was not run at an epoch."""
    if evidence.measured.snapshots.osnma is None:
        return "no OSNMA data from a second channel"
    return too_few if epoch in evidence.subframes.epoch else "no subframe ended since the epoch before"
