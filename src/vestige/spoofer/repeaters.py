"""Simulate attacks with spoofing signals: lift-off attacks, meaconing, forgery and nulling.

E1 codes are public, so an attacker can generate the spoofing signal on E1. E6-C is encrypted, so lift-off attacks and
meaconing repeat the true signal on E6, with the noise of the attacker's own reception. Let the spoofing signal at the
victim have η times the power of the true signal. Let the attacker's C/N0 be G times the victim's C/N0. The density of
the repeated noise at the victim is

    N_repeated / N0 = η / G

So without a better antenna (G = 1) a spoofing signal of equal power doubles the noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Literal

import numpy as np
from jaxtyping import Float

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.errors import SettingError
from vestige.records import Band
from vestige.spoofer.attack import MAX_DELAY_S, Attack, CheckedAttack, SpoofingSignal, delayed
from vestige.spoofer.phase import COHERENT, Locked, Phase
from vestige.spoofer.profiles import Constant, Profile, as_profile, extremes

BOTH = (Band.E1, Band.E6)
RECEPTION_GAIN_DB = 20.0  # gain in dB of a dish antenna for each satellite, or of a good antenna with an open sky


@dataclass(frozen=True, slots=True, kw_only=True)
class _LiftOffAttack(CheckedAttack):
    """Spoofing signal whose profiles of delay and power are valid for every band of the attack.

    Attributes
    ----------
    delay_m, power_db, phase
        Delay in m and power in dB of the spoofing signal relative to the true signal, and phase law.
    bands
        Bands that have a spoofing signal.
    reception_gain_db
        Gain G in dB: C/N0 of the attacker's reception on E6 over the victim's C/N0 on E6.
    forged_nav_data
        Whether the attacker invents the data on E1-B; if false, the attacker sends the data of the satellite again.
    """

    delay_m: Profile
    power_db: Profile
    phase: Phase = COHERENT
    bands: tuple[Band, ...] = BOTH
    reception_gain_db: float = RECEPTION_GAIN_DB
    forged_nav_data: bool = False

    @property
    def outside_assumption_2(self) -> str:
        """Reason why the attack violates Assumption 2 of [WFO]; empty if the assumption holds."""
        if Band.E6 in self.bands and extremes(self.delay_m)[0] < 0:
            return "the encrypted spoofing signal arrives before the true signal"
        return ""

    def spoofing_signal(self, band: Band, times_s: Float[np.ndarray, " n"]) -> SpoofingSignal | None:
        """Return the spoofing signal of a satellite in a band; None for a band that the attack does not spoof."""
        if band not in self.bands:
            return None
        return delayed(
            self,
            band,
            times_s,
            delay_m=self.delay_m,
            power_db=self.power_db,
            phase=self.phase,
            forged_nav_data=self.forged_nav_data and band is Band.E1,
        )

    def noise_over_n0(self, band: Band, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the density of the repeated noise in a band, divided by N0; 0 on E1."""
        if band is Band.E1 or band not in self.bands:
            return np.zeros(times_s.shape)
        return repeated_noise(self, self.power_db, self.reception_gain_db, times_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class LiftOff(_LiftOffAttack):
    """Spoofing signal that approaches the true signal, rises and leaves with the tracking loop [WFO, Sec. VI-B].

    With `bands = ["E1"]` the attack has no effect on E6. With `bands = ["E1", "E6"]` the attack is the zero-delay
    meaconing of [WFO].
    """

    kind: Literal["lift-off"] = "lift-off"


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionPush(_LiftOffAttack):
    """Lift-off of the satellites in `svids`; the common delay of the spoofing signals moves the victim's position."""

    kind: Literal["position-push"] = "position-push"

    def __post_init__(self) -> None:
        _LiftOffAttack.__post_init__(self)
        if not self.svids:
            raise ValueError("a position push with svids; a lift-off of all satellites is a time push")


@dataclass(frozen=True, slots=True, kw_only=True)
class TimePush(_LiftOffAttack):
    """Lift-off of all satellites (no `svids`); the common delay of the spoofing signals moves the victim's clock."""

    kind: Literal["time-push"] = "time-push"

    def __post_init__(self) -> None:
        _LiftOffAttack.__post_init__(self)
        if self.svids:
            raise ValueError("a time push without svids; a lift-off of some satellites is a position push")


@dataclass(frozen=True, slots=True, kw_only=True)
class E1Asynchronous(CheckedAttack):
    """E1 spoofing signal of an attacker who does not know the delay of the true signal; E6 is not attacked.

    A spoofing signal more than a chip away from the true signal does not capture a tracking loop on the true signal. A
    receiver that acquires while the attack is on takes the strongest signal.

    Attributes
    ----------
    delay_m, power_db
        Delay of the spoofing signal in m, which may be negative, and power in dB, both relative to the true signal.
    acquired
        Whether the receiver is restarted when the attack begins, and acquires during the attack. If the attack starts
        at 0 s, the receiver has acquired by the first epoch. If `acquired` is false, the receiver stays locked to the
        true signal until it loses lock.
    forged_nav_data
        Whether the attacker invents the data on E1-B; if false, the attacker sends the data of the satellite again.
    """

    delay_m: Profile
    power_db: Profile = 10.0
    acquired: bool = True
    forged_nav_data: bool = False
    kind: Literal["e1-asynchronous"] = "e1-asynchronous"

    @property
    def reacquired(self) -> bool:
        """Whether the receiver is restarted when the attack begins, and acquires the strongest signal on E1."""
        return self.acquired

    def spoofing_signal(self, band: Band, times_s: Float[np.ndarray, " n"]) -> SpoofingSignal | None:
        """Return the spoofing signal of a satellite in a band; None for a band that the attack does not spoof."""
        if band is not Band.E1:
            return None
        return delayed(
            self,
            band,
            times_s,
            delay_m=self.delay_m,
            power_db=self.power_db,
            phase=COHERENT,
            forged_nav_data=self.forged_nav_data,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Position on the Earth: latitude and longitude in degrees, and height above the ellipsoid in m."""

    latitude_deg: float
    longitude_deg: float
    height_m: float = 0.0

    def __post_init__(self) -> None:
        if not (abs(self.latitude_deg) <= 90 and abs(self.longitude_deg) <= 360 and abs(self.height_m) <= 1e7):
            raise ValueError(f"no position on the Earth: {self.latitude_deg}, {self.longitude_deg}, {self.height_m}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Meaconing(CheckedAttack):
    """Attack that receives whole bands and sends these bands again, with the same delay, power and noise on every band.

    Attributes
    ----------
    delay_s
        Delay from reception to transmission in s, 0 to 60: a fraction of a microsecond for a repeater, or seconds for
        a recorder.
    antenna
        Position of the repeater's receiving antenna. The path over this antenna adds to the delay of each satellite, so
        a victim computes the position of the antenna [WFO, Sec. II]. This option needs a constellation and a
        trajectory. Without this option the delay is the same for all satellites, as if the attacker's antenna were
        beside the victim's antenna.
    power_db
        Power of the spoofing signal in dB relative to the true signal.
    bands
        Bands that the attacker repeats.
    reception_gain_db
        Gain G in dB: C/N0 of the attacker's reception over the victim's C/N0.
    acquired
        Whether the receiver is restarted when the attack begins, and acquires during the attack. If the attack starts
        at 0 s, the receiver has acquired by the first epoch. If `acquired` is false, the receiver stays locked to the
        true signal until it loses lock.
    """

    delay_s: float
    power_db: Profile
    bands: tuple[Band, ...] = BOTH
    reception_gain_db: float = 0.0
    acquired: bool = True
    antenna: Place | None = None
    kind: Literal["meaconing"] = "meaconing"

    def __post_init__(self) -> None:
        if not 0 <= self.delay_s <= MAX_DELAY_S:
            raise SettingError("delay_s", f"{self.delay_s:g} s", f"a delay of the meaconer from 0 to {MAX_DELAY_S:g} s")
        CheckedAttack.__post_init__(self)

    @property
    def reacquired(self) -> bool:
        """Whether the receiver is restarted when the attack begins, and acquires the strongest signal on E1."""
        return self.acquired and Band.E1 in self.bands

    def spoofing_signal(self, band: Band, times_s: Float[np.ndarray, " n"]) -> SpoofingSignal | None:
        """Return the spoofing signal of a satellite in a band; None for a band that the attack does not spoof."""
        if band not in self.bands:
            return None
        return delayed(self, band, times_s, delay_m=self.delay_m, power_db=self.power_db, phase=COHERENT)

    @property
    def delay_m(self) -> Profile:
        """Delay relative to the true signal in m, without the path over `antenna`.

        `PlacedMeaconing`, which is this attack on one satellite, adds the path over `antenna`.
        """
        return self.delay_s * SPEED_OF_LIGHT_MPS

    def noise_over_n0(self, band: Band, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the density of the repeated noise in a band, divided by N0."""
        if band not in self.bands:
            return np.zeros(times_s.shape)
        return repeated_noise(self, self.power_db, self.reception_gain_db, times_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Forgery(CheckedAttack):
    """Spoofing signal with invented chips on E6, with which an attacker without the chips raises the power on E6.

    Attributes
    ----------
    power_db
        Power of the spoofing signal in dB relative to the true signal.
    delay_m
        Delay of the invented chips relative to the true signal in m. The delay has hardly any effect, because invented
        chips do not correlate with the true chips.
    """

    power_db: Profile
    delay_m: Profile = 0.0
    kind: Literal["forgery"] = "forgery"

    def spoofing_signal(self, band: Band, times_s: Float[np.ndarray, " n"]) -> SpoofingSignal | None:
        """Return the spoofing signal of a satellite in a band; None for a band that the attack does not spoof."""
        if band is not Band.E6:
            return None
        return delayed(
            self, band, times_s, delay_m=self.delay_m, power_db=self.power_db, phase=COHERENT, forged_chips=True
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Nulling(CheckedAttack):
    """Negative of the true signal, which cancels the true signal except for the share |1 − g e^{je}|² of its power.

    Attributes
    ----------
    gain_db
        Power gain g² in dB; 0 dB without phase error cancels the true signal perfectly.
    phase_error_rad
        Phase error e in rad.
    bands
        Bands that are nulled. Nulling of E6 is outside Assumption 2.
    """

    gain_db: Profile = -1.0
    phase_error_rad: float = 0.0
    bands: tuple[Band, ...] = (Band.E1,)
    kind: Literal["nulling"] = "nulling"

    @property
    def outside_assumption_2(self) -> str:
        """Reason why the attack violates Assumption 2 of [WFO]; empty if the assumption holds."""
        return "it nulls the encrypted signal" if Band.E6 in self.bands else ""

    def spoofing_signal(self, band: Band, times_s: Float[np.ndarray, " n"]) -> SpoofingSignal | None:
        """Return the spoofing signal of a satellite in a band; None for a band that the attack does not spoof."""
        if band not in self.bands:
            return None
        opposite = Locked(phase_rad=pi + self.phase_error_rad)
        return delayed(self, band, times_s, delay_m=Constant(level=0.0), power_db=self.gain_db, phase=opposite)


def repeated_noise(
    attack: Attack, power_db: Profile, reception_gain_db: float, times_s: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return the density η/G of the repeated noise over N0 at each epoch, which is 0 while the attack is off."""
    over_db = as_profile(power_db).value(times_s) - reception_gain_db
    return np.where(attack.on(times_s), 10 ** (over_db / 10), 0.0)
