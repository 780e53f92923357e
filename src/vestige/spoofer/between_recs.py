"""Simulate an attack that is on only between two RECS, so that no sample of a RECS contains the spoofing signal.

Between two RECS the spoofing signal switches on at the delay of the true signal. The spoofing signal moves the tracking
loop away from the true signal, moves the loop back, and then switches off. Let x be the time since the last RECS, from
`guard_s` to `period_s − guard_s`. The delay of the spoofing signal relative to the true signal is

    τ = top_m sin²(π (x − guard)/(period − 2 guard))        power on
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from vestige.errors import SettingError
from vestige.records import Band
from vestige.signals.definitions import CARRIER_HZ
from vestige.spoofer.attack import Attack, CheckedAttack, SpoofingSignal, check_delay
from vestige.spoofer.phase import COHERENT, DelayedCarrier, Phase
from vestige.spoofer.profiles import Profile, Ramp, as_profile
from vestige.spoofer.repeaters import BOTH


@dataclass(frozen=True, slots=True, kw_only=True)
class BetweenRecs(CheckedAttack):
    """Attack with a lift-off and a return in each interval between two RECS.

    Attributes
    ----------
    top_m
        Delay of the spoofing signal relative to the true signal in m, halfway between two RECS.
    power_db
        Power of the spoofing signal in dB relative to the true signal while the attack is on.
    period_s, first_recs_s
        Time between two RECS in s, and time of the first RECS in s after the scenario's start.
    guard_s
        Time in s before and after a RECS during which the attack is off.
    phase, bands
        Phase law of the spoofing signal, and bands that have a spoofing signal. Repeated noise on E6 is left out,
        because the attack is off while the receiver records E6.
    """

    top_m: float
    power_db: Profile
    period_s: float
    first_recs_s: float = 0.0
    guard_s: float = 1.0
    phase: Phase = COHERENT
    bands: tuple[Band, ...] = BOTH
    kind: Literal["between-recs"] = "between-recs"

    def __post_init__(self) -> None:
        CheckedAttack.__post_init__(self)
        if not 0 < self.guard_s < self.period_s / 2:
            raise SettingError(
                "guard_s", f"{self.guard_s:g} s", f"more than 0 s and less than half of period_s = {self.period_s:g} s"
            )
        rise_s = self.period_s / 2 - self.guard_s
        rise = Ramp(first=0.0, last=self.top_m, start_s=0.0, stop_s=rise_s, smooth=True) if self.top_m else 0.0
        check_delay("top_m", rise)

    def on(self, times_s: Float[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
        """Return whether the attack is on at each time."""
        since_s = (times_s - self.first_recs_s) % self.period_s
        return Attack.on(self, times_s) & (since_s > self.guard_s) & (since_s < self.period_s - self.guard_s)

    def spoofing_signal(self, band: Band, times_s: Float[np.ndarray, " n"]) -> SpoofingSignal | None:
        """Return the spoofing signal of a satellite in a band; None for a band that the attack does not spoof."""
        if band not in self.bands:
            return None
        rate = 1 / (self.period_s - 2 * self.guard_s)
        share = np.clip(((times_s - self.first_recs_s) % self.period_s - self.guard_s) * rate, 0.0, 1.0)
        carrier = DelayedCarrier(
            since_start_s=times_s - self.start_s,
            delay_m=self.top_m * np.sin(pi * share) ** 2,
            delay_rate_mps=self.top_m * pi * rate * np.sin(2 * pi * share),
            carrier_hz=CARRIER_HZ[band],
        )
        return SpoofingSignal(
            delay_m=carrier.delay_m,
            delay_rate_mps=carrier.delay_rate_mps,
            power_db=np.where(self.on(times_s), as_profile(self.power_db).value(times_s), -inf),
            phase_rad=self.phase.phase(carrier),
            doppler_hz=self.phase.doppler_hz(carrier),
        )
