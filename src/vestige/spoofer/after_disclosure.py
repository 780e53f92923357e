"""The forger who has the key: E6-C chips of the past, made once the OSNMA key of their RECS is public.

A RECS is public before its signal is on air, its key after that. Whoever has both can decrypt the RECS and transmit the
true chips, without noise and with any delay from then on. So a receiver must know that its samples are older than the
disclosure of the key (`crypto/osnma/disclosure.py`). It knows that from its own clock only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records import Band
from vestige.spoofer.attack import CheckedAttack, SpoofingSignal, check_delay, delayed
from vestige.spoofer.phase import COHERENT
from vestige.spoofer.profiles import Profile

LONGEST_FORGERY_S = 120.0  # four subframes: more than any key delay


@dataclass(frozen=True, slots=True, kw_only=True)
class ForgeryAfterDisclosure(CheckedAttack):
    """Transmits the sky of the past on both bands, made from RECS and disclosed keys, without the noise of a reception.

    Example
    -------
    >>> late = ForgeryAfterDisclosure(delay_s=45.0, power_db=3.0)
    >>> float(late.spoofing_signal(Band.E6, np.zeros(1)).delay_m[0]) == 45.0 * SPEED_OF_LIGHT_MPS
    True

    Attributes
    ----------
    delay_s
        Delay of the whole sky in s: from the true transmission to that of the attacker, more than 0, at most 120. The
        attacker has the key only after its last bit, which a scenario checks.
    power_db
        Relative to the true signal.
    range_offset_m
        Delay in m beyond `delay_s`, for the satellites in `svids`: the attacker chooses the range, an earlier one too.
    acquired
        Whether the receiver acquires after the attack's start (switched on, or jammed before).

    Raises
    ------
    ValueError
        If the delay or the range is beyond what an attack can have.
    """

    delay_s: float
    power_db: Profile
    range_offset_m: Profile = 0.0
    acquired: bool = True
    kind: Literal["forgery-after-disclosure"] = "forgery-after-disclosure"

    def __post_init__(self) -> None:
        if not 0 < self.delay_s <= LONGEST_FORGERY_S:
            raise ValueError(f"a forger is late by more than 0 and at most {LONGEST_FORGERY_S:g} s, not {self.delay_s}")
        check_delay(self.range_offset_m)
        CheckedAttack.__post_init__(self)

    @property
    def reacquired(self) -> bool:
        """Whether the receiver acquires E1 anew when the attack begins, and takes the strongest signal."""
        return self.acquired

    def spoofing_signal(self, band: Band, times_s: Float[np.ndarray, " n"]) -> SpoofingSignal:
        """Return the effect on a band of a satellite under attack."""
        made = delayed(self, band, times_s, delay_m=self.range_offset_m, power_db=self.power_db, phase=COHERENT)
        return replace(made, delay_m=made.delay_m + self.delay_s * SPEED_OF_LIGHT_MPS)
