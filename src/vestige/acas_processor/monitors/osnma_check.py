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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import bdtrc

from vestige.acas_processor.monitors.judgement import check_budget, count_threshold, judged, not_run
from vestige.records import CheckResult


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
    def name(self) -> str:
        """Name in `CheckResult`."""
        return "OSNMA availability"

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

    def check(self, received: Sequence[bool]) -> CheckResult:
        """Return the check of the last subframes.

        Parameters
        ----------
        received
            For each subframe of the window, whether it brought a validated key.
        """
        limit = self.threshold(len(received))
        if limit >= len(received):
            return not_run(self, f"{len(received)} subframes are too few to say that keys are missing")
        lost = len(received) - sum(received)
        failure = f"{lost} of {len(received)} subframes brought no validated key, more than {limit}"
        return judged(self, float(lost), float(limit), failure)


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaField:
    """One piece of OSNMA (40 bits of a page, a key, a tag) as demodulated and as a second channel has it.

    Attributes
    ----------
    demodulated
        None if it was not received or its page failed the checksum.
    assisted
        None if the second channel does not have it.
    """

    demodulated: bytes | None
    assisted: bytes | None


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaAgreement:
    """Demodulated fields against assisted ones, as a check; one difference is one too many."""

    name: str = "OSNMA agreement"
    unit: str = "fields"
    p_fa: float = 2.0**-24  # of a field: CRC-24 passes a damaged page


@dataclass(frozen=True, slots=True, kw_only=True)
class AssistedOsnmaMonitor:
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
    def name(self) -> str:
        """Name in `CheckResult`."""
        return "OSNMA reception"

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

    def check(
        self, fields: Sequence[OsnmaField], received: Sequence[OsnmaField] = ()
    ) -> tuple[CheckResult, CheckResult]:
        """Return the checks of lost and of differing fields.

        Parameters
        ----------
        fields
            What was due in the window; fields that the second channel lacks are not looked at.
        received
            Further fields that both have. They may differ, too, but say nothing of what was lost.
        """
        known = [field for field in fields if field.assisted is not None]
        agreement = OsnmaAgreement()
        if not known:
            reason = "no OSNMA data from a second channel"
            return not_run(self, reason), not_run(agreement, reason)
        lost = sum(field.demodulated is None for field in known)
        forged = sum(field.demodulated not in (None, field.assisted) for field in (*known, *received))
        limit = self.threshold(len(known))
        reception = (
            not_run(self, f"{len(known)} fields are too few to say that some are missing")
            if limit >= len(known)
            else judged(self, float(lost), float(limit), f"{lost} of {len(known)} fields were lost, more than {limit}")
        )
        if lost == len(known) and not received:
            return reception, not_run(agreement, "no field was received")
        return reception, judged(agreement, float(forged), 0.0, f"{forged} fields are not what the satellites sent")
