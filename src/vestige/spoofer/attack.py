"""Define the interface of every attack: its times, its satellites, and its effect on each band.

An attack can add noise and a jamming waveform to a band, and at most one spoofing signal for each satellite. A spoofing
signal is described relative to the true signal of its satellite in the same band. The delay, power and phase of a
spoofing signal depend only on time, because an attack has no memory. Times are in s after the scenario's start.

**Assumption 2** [WFO, Sec. II] says that the true encrypted signal is always present and always comes first. An attack
that violates Assumption 2 can be simulated, but states the violation in `outside_assumption_2`.
"""

# ruff: noqa: ARG002  methods of the base class ignore their arguments, because they have no effect

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from vestige.constants import MAX_SVID, SPEED_OF_LIGHT_MPS
from vestige.errors import SettingError
from vestige.own_parts import kind_of
from vestige.records import Band
from vestige.signal_generator.waveform import Component
from vestige.signals.definitions import CARRIER_HZ
from vestige.spoofer.jammers import AnyJammer
from vestige.spoofer.phase import Coherent, DelayedCarrier, Locked, Slipping
from vestige.spoofer.profiles import AnyProfile, as_profile, extremes, fastest

MAX_DELAY_S = 60.0
_MAX_EARLY_M = 3e5  # largest advance of a spoofing signal in m, about 1 ms
_MAX_RATE_MPS = 1e4
MAX_LEVEL_DB = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SpoofingSignal:
    """Spoofing signal of a satellite in a band at each epoch, relative to the true signal.

    Attributes
    ----------
    delay_m, delay_rate_mps
        Delay relative to the true signal in m, positive if later, and rate of this delay in m/s.
    power_db
        Power relative to the true signal in dB; −inf if there is no spoofing signal.
    phase_rad
        Carrier phase relative to the true signal in rad.
    doppler_hz
        Doppler of the carrier relative to the true signal in Hz, which is the rate of `phase_rad` in cycles/s.
    forged_chips
        Whether the attacker invented the chips on E6. If false, the spoofing signal has the true chips.
    forged_nav_data
        Whether the attacker invented the navigation data on E1. If false, the spoofing signal has the data of the
        satellite.
    """

    delay_m: Float[np.ndarray, " n"]
    delay_rate_mps: Float[np.ndarray, " n"]
    power_db: Float[np.ndarray, " n"]
    phase_rad: Float[np.ndarray, " n"]
    doppler_hz: Float[np.ndarray, " n"]
    forged_chips: bool = False
    forged_nav_data: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Jamming:
    """Jamming waveform in a band, with J/N at each epoch and the bandwidth in Hz of the noise power N."""

    waveform: AnyJammer
    j_over_n: Float[np.ndarray, " n"]
    noise_bandwidth_hz: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Attack:
    """Base class of attacks, without any effect; each subclass adds its own effects.

    Attributes
    ----------
    start_s, stop_s
        Start and end of the attack in s after the scenario's start. The attack is already off at `stop_s`.
    svids
        SVIDs of the satellites whose signals are spoofed; an empty list means all satellites. Noise and jamming affect
        all satellites.
    """

    start_s: float = 0.0
    stop_s: float = inf
    svids: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if not 0 <= self.start_s < self.stop_s:
            found = f"{self.start_s:g} s with stop_s = {self.stop_s:g} s"
            raise SettingError("start_s", found, "0 s or later, and before stop_s")
        if not all(1 <= svid <= MAX_SVID for svid in self.svids):
            raise SettingError("svids", list(self.svids), f"numbers of satellites from 1 to {MAX_SVID}")
        if len(set(self.svids)) < len(self.svids):
            raise SettingError("svids", list(self.svids), "each satellite once")

    @property
    def kind(self) -> str:
        """Value of the key `kind` in a scenario; `module:Name` for a class that the user wrote."""
        return kind_of(type(self))

    @property
    def outside_assumption_2(self) -> str:
        """Reason why the attack violates Assumption 2 of [WFO]; empty if the assumption holds."""
        return ""

    @property
    def reacquired(self) -> bool:
        """Whether the receiver is restarted when the attack begins, and acquires the strongest signal on E1."""
        return False

    def on(self, times_s: Float[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
        """Return whether the attack is on at each time."""
        return (times_s >= self.start_s) & (times_s < self.stop_s)

    def spoofing_signal(self, band: Band, times_s: Float[np.ndarray, " n"]) -> SpoofingSignal | None:
        """Return the spoofing signal of a satellite in a band; None for a band that the attack does not spoof."""
        return None

    def noise_over_n0(self, band: Band, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the density of white noise that the attack adds to a band, divided by N0."""
        return np.zeros(times_s.shape)

    def jamming(self, band: Band, times_s: Float[np.ndarray, " n"]) -> Jamming | None:
        """Return the jamming waveform that the attack adds to a band; None if the attack adds no waveform."""
        return None

    def replayed(self, component: Component, svid: int, seed: int) -> Component:
        """Return the component that the spoofing signal in a recording has in place of `component`."""
        return component

    def withholds_osnma(self, first_s: float, last_s: float) -> bool:
        """Return whether the attack prevents the reception of an OSNMA key sent from `first_s` to `last_s`."""
        return False


def delayed(
    attack: Attack,
    band: Band,
    times_s: Float[np.ndarray, " n"],
    *,
    delay_m: AnyProfile | float,
    power_db: AnyProfile | float,
    phase: Locked | Slipping | Coherent,
    forged_chips: bool = False,
    forged_nav_data: bool = False,
) -> SpoofingSignal:
    """Return a spoofing signal with the given profiles of delay and power; the signal is off while the attack is off.

    A number in place of a profile means a constant profile.
    """
    delay = as_profile(delay_m)
    carrier = DelayedCarrier(
        since_start_s=times_s - attack.start_s,
        delay_m=delay.value(times_s),
        delay_rate_mps=delay.rate(times_s),
        carrier_hz=CARRIER_HZ[band],
    )
    return SpoofingSignal(
        delay_m=carrier.delay_m,
        delay_rate_mps=carrier.delay_rate_mps,
        power_db=np.where(attack.on(times_s), as_profile(power_db).value(times_s), -inf),
        phase_rad=phase.phase(carrier),
        doppler_hz=phase.doppler_hz(carrier),
        forged_chips=forged_chips,
        forged_nav_data=forged_nav_data,
    )


def check_delay(key: str, delay_m: AnyProfile | float) -> None:
    """Raise `SettingError` if a delay is outside −300 km (about −1 ms) to 60 s, or changes by more than 10 km/s."""
    low_m, high_m = extremes(delay_m)
    if not (low_m >= -_MAX_EARLY_M and high_m <= MAX_DELAY_S * SPEED_OF_LIGHT_MPS):
        latest_m = MAX_DELAY_S * SPEED_OF_LIGHT_MPS
        raise SettingError(
            key, f"{low_m:g} to {high_m:g} m", f"{-_MAX_EARLY_M:g} to {latest_m:.3g} m ({MAX_DELAY_S:g} s)"
        )
    if not fastest(delay_m) <= _MAX_RATE_MPS:
        raise SettingError(
            key, f"a change of {fastest(delay_m):g} m/s", f"a delay that changes by at most {_MAX_RATE_MPS:g} m/s"
        )


def check_bands(key: str, bands: tuple[Band, ...]) -> None:
    """Raise `SettingError` if an attack names no band, or names a band twice."""
    if not bands or len(set(bands)) != len(bands):
        raise SettingError(key, [band.value for band in bands], "one band or more, each once")


def check_level(key: str, level_db: AnyProfile | float) -> None:
    """Raise `SettingError` if a power is more than 100 dB above its reference; −inf dB means no power."""
    high_db = extremes(level_db)[1]
    if not high_db <= MAX_LEVEL_DB:
        raise SettingError(key, f"{high_db:g} dB", f"at most {MAX_LEVEL_DB:g} dB")


def check_gain(key: str, reception_gain_db: float) -> None:
    """Raise `SettingError` if the attacker's reception gain is outside −50 to 100 dB."""
    if not -50 <= reception_gain_db <= 100:
        raise SettingError(key, f"{reception_gain_db:g} dB", "-50 to 100 dB")


_CHECKS: Mapping[str, Callable[[str, Any], None]] = {
    "bands": check_bands,
    "delay_m": check_delay,
    "e6_lag_m": check_delay,
    "power_db": check_level,
    "gain_db": check_level,
    "j_over_n_db": check_level,
    "reception_gain_db": check_gain,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedAttack(Attack):
    """Base class of vestige's own attacks, which checks their bands, delays, powers and gains."""

    def __post_init__(self) -> None:
        Attack.__post_init__(self)
        for name, check in _CHECKS.items():
            if hasattr(self, name):
                check(name, getattr(self, name))
