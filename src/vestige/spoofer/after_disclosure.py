"""Simulate a forgery with a disclosed key: E6-C chips are sent again after the OSNMA key of their RECS is public.

The RECS is public before its signal is on air, and the key is public after this signal. After the disclosure, an
attacker with RECS and key can decrypt the RECS. The attacker can then transmit the true chips without noise, at any
later time. So a receiver must prove that its samples are older than the disclosure of the key
(`crypto/osnma/disclosure.py`). Only the receiver's own clock can prove the age of the samples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.errors import SettingError
from vestige.records import Band
from vestige.spoofer.attack import CheckedAttack, SpoofingSignal, check_delay, delayed
from vestige.spoofer.phase import COHERENT
from vestige.spoofer.profiles import Profile

LONGEST_FORGERY_S = 120.0  # longest delay in s: four subframes, more than any key delay


@dataclass(frozen=True, slots=True, kw_only=True)
class ForgeryAfterDisclosure(CheckedAttack):
    """Attack that transmits past signals without reception noise; its E6 chips come from RECS and disclosed keys.

    Example
    -------
    >>> late = ForgeryAfterDisclosure(delay_s=45.0, power_db=3.0)
    >>> float(late.spoofing_signal(Band.E6, np.zeros(1)).delay_m[0]) == 45.0 * SPEED_OF_LIGHT_MPS
    True

    Attributes
    ----------
    delay_s
        Time in s from the true transmission to the attacker's transmission, more than 0, at most 120. The attacker has
        the key only after the last bit of the key is sent. A scenario in which the attacker transmits before the key is
        complete gives an error.
    power_db
        Power of the spoofing signal relative to the true signal in dB.
    range_offset_m
        Delay in m in addition to `delay_s`; negative for a shorter range.
    acquired
        Whether the receiver acquires E1 again when the attack begins, because the receiver was off or jammed before.

    Raises
    ------
    ValueError
        If `delay_s`, `range_offset_m`, `power_db`, a time or an SVID is outside its limits, or an SVID is named twice.
    """

    delay_s: float
    power_db: Profile
    range_offset_m: Profile = 0.0
    acquired: bool = True
    kind: Literal["forgery-after-disclosure"] = "forgery-after-disclosure"

    def __post_init__(self) -> None:
        if not 0 < self.delay_s <= LONGEST_FORGERY_S:
            raise SettingError(
                "delay_s", f"{self.delay_s:g} s", f"a delay of more than 0 s and at most {LONGEST_FORGERY_S:g} s"
            )
        check_delay("range_offset_m", self.range_offset_m)
        CheckedAttack.__post_init__(self)

    @property
    def reacquired(self) -> bool:
        """Whether the receiver acquires E1 again when the attack begins, and takes the strongest signal."""
        return self.acquired

    def spoofing_signal(self, band: Band, times_s: Float[np.ndarray, " n"]) -> SpoofingSignal:
        """Return the spoofing signal of a satellite in a band, which has the delay `delay_s` plus `range_offset_m`."""
        made = delayed(self, band, times_s, delay_m=self.range_offset_m, power_db=self.power_db, phase=COHERENT)
        return replace(made, delay_m=made.delay_m + self.delay_s * SPEED_OF_LIGHT_MPS)
