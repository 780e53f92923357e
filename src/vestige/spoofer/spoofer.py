"""Combine the effects of all attacks of a scenario on each band of a satellite, epoch by epoch.

| attack | E1 | E6 |
|---|---|---|
| `E1Asynchronous` | spoofing signal at any delay | – |
| `LiftOff` | spoofing signal | spoofing signal, repeated noise |
| `PositionPush`, `TimePush` | lift-off of some satellites, or of all satellites | as on E1, with repeated noise |
| `Meaconing` | spoofing signal, repeated noise | spoofing signal, repeated noise |
| `Scer` | spoofing signal, symbols may be estimated | spoofing signal later than on E1, repeated noise or chip errors |
| `BetweenRecs` | lift-off and return between two RECS | lift-off and return between two RECS |
| `Nulling` | opposite signal | opposite signal (outside Assumption 2) |
| `Forgery` | – | spoofing signal with invented chips |
| `ForgeryAfterDisclosure` | spoofing signal, as late as on E6 | spoofing signal, later than the key of its RECS |
| `Jam` | jamming waveform | jamming waveform |
| `OsnmaDenial` | white noise, keys are lost | – |
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import get_args

import numpy as np
from jaxtyping import Bool, Complex128, Float

from vestige.own_parts import require_numbers
from vestige.records import Band
from vestige.signals.definitions import E1C, E6C
from vestige.spoofer.after_disclosure import ForgeryAfterDisclosure
from vestige.spoofer.attack import Attack, Jamming, SpoofingSignal
from vestige.spoofer.between_recs import BetweenRecs
from vestige.spoofer.interference import Jam, OsnmaDenial
from vestige.spoofer.jammers import Wideband, rise
from vestige.spoofer.repeaters import (
    E1Asynchronous,
    Forgery,
    LiftOff,
    Meaconing,
    Nulling,
    PositionPush,
    TimePush,
)
from vestige.spoofer.scer import Scer

_OF_EPOCHS = ("delay_m", "delay_rate_mps", "power_db", "phase_rad", "doppler_hz")  # fields with a value per epoch

Attacks = (
    E1Asynchronous
    | LiftOff
    | PositionPush
    | TimePush
    | Meaconing
    | Scer
    | BetweenRecs
    | Nulling
    | Forgery
    | ForgeryAfterDisclosure
    | Jam
    | OsnmaDenial
)
ALL_ATTACKS: tuple[type[Attack], ...] = get_args(Attacks)
_PILOT = {Band.E1: E1C, Band.E6: E6C}


@dataclass(frozen=True, slots=True, kw_only=True)
class BandEffects:
    """Effects of all attacks on one band of a satellite; the axis n counts the epochs, and the axis k the attacks."""

    # Spoofing signals relative to the true signal, with the fields of `SpoofingSignal`. If an attack has no spoofing
    # signal, the power is −inf dB, and the other values are 0.
    delay_m: Float[np.ndarray, "n k"]
    delay_rate_mps: Float[np.ndarray, "n k"]
    power_db: Float[np.ndarray, "n k"]
    phase_rad: Float[np.ndarray, "n k"]
    doppler_hz: Float[np.ndarray, "n k"]
    forged_chips: Bool[np.ndarray, " k"]  # whether the attacker invented the chips of a spoofing signal
    forged_nav_data: Bool[np.ndarray, " k"]  # whether the attacker invented the navigation data of a spoofing signal
    white: Float[np.ndarray, " n"]  # density of all added white noise over N0, such as repeated noise or jamming
    jammers: tuple[Jamming, ...]  # jamming waveforms other than wideband noise

    def part(self, rows: slice) -> BandEffects:
        """Return the effects in the epochs of the slice `rows`."""
        names = (*_OF_EPOCHS, "white")
        return replace(
            self,
            **{name: getattr(self, name)[rows] for name in names},
            jammers=tuple(replace(one, j_over_n=one.j_over_n[rows]) for one in self.jammers),
        )

    @property
    def amplitude(self) -> Complex128[np.ndarray, "n k"]:
        """Complex amplitude √η e^{jφ} of every spoofing signal at each epoch, relative to the true signal."""
        return 10 ** (self.power_db / 20) * np.exp(1j * self.phase_rad)

    def rise(self, band: Band) -> Float[np.ndarray, " n"]:
        """Return the density over N0 of the noise that the attacks add after a correlator of the band's pilot."""
        total = self.white.copy()
        for one in self.jammers:
            total += one.j_over_n * rise(one.waveform, _PILOT[band], one.noise_bandwidth_hz)
        return total


@dataclass(frozen=True, slots=True, kw_only=True)
class Spoofer:
    """Attacker with all attacks of a scenario."""

    attacks: tuple[Attack, ...] = ()  # simultaneous attacks

    def effects(self, band: Band, svid: int, times_s: Float[np.ndarray, " n"]) -> BandEffects:
        """Return the effects of all attacks on a band of a satellite."""
        found = []
        for attack in self.attacks:
            made = attack.spoofing_signal(band, times_s) if not attack.svids or svid in attack.svids else None
            found.append(made or _nothing(times_s.size))
            for name in _OF_EPOCHS if made else ():
                require_numbers(attack, f"spoofing_signal.{name}", getattr(made, name), times_s.shape)
        white, jammers = np.zeros(times_s.size), []
        for attack in self.attacks:
            noise = attack.noise_over_n0(band, times_s)
            require_numbers(attack, "noise_over_n0", noise, times_s.shape)
            white += noise
            jamming = attack.jamming(band, times_s)
            if jamming is not None:
                require_numbers(attack, "jamming.j_over_n", jamming.j_over_n, times_s.shape)
            if jamming is not None and isinstance(jamming.waveform, Wideband):
                white += jamming.j_over_n
            elif jamming is not None:
                jammers.append(jamming)
        shape = (times_s.size, len(found))
        columns = {name: np.array([getattr(one, name) for one in found]).reshape(shape[::-1]).T for name in _OF_EPOCHS}
        own = {
            name: np.array([getattr(one, name) for one in found], dtype=bool)
            for name in ("forged_chips", "forged_nav_data")
        }
        return BandEffects(**columns, **own, white=white, jammers=tuple(jammers))

    def acquired_anew(
        self, svid: int, after_s: Float[np.ndarray, " n"], until_s: Float[np.ndarray, " n"]
    ) -> Bool[np.ndarray, " n"]:
        """Return whether an attack that begins in (after_s, until_s] makes the receiver acquire a satellite again.

        An attack whose spoofing signal on E1 has no power at `until_s` does not make the receiver acquire again.
        """
        anew = np.zeros(until_s.shape, bool)
        for attack in self.attacks:
            if attack.reacquired and (not attack.svids or svid in attack.svids):
                spoofing_signal = attack.spoofing_signal(Band.E1, until_s)
                is_on = spoofing_signal is not None and spoofing_signal.power_db > -inf
                anew |= (after_s < attack.start_s) & (attack.start_s <= until_s) & is_on
        return anew

    def withholds_osnma(self, first_s: float, last_s: float) -> bool:
        """Return whether an attack prevents the reception of an OSNMA key sent from `first_s` to `last_s`."""
        return any(attack.withholds_osnma(first_s, last_s) for attack in self.attacks)

    def warnings(self) -> tuple[str, ...]:
        """Return a line of text for each attack that violates Assumption 2 of [WFO]."""
        return tuple(
            f"attack.{number} ({attack.kind}) is outside Assumption 2: {attack.outside_assumption_2}"
            for number, attack in enumerate(self.attacks)
            if attack.outside_assumption_2
        )


NO_SPOOFER = Spoofer()


def _nothing(n: int) -> SpoofingSignal:
    zero = np.zeros(n)
    return SpoofingSignal(delay_m=zero, delay_rate_mps=zero, power_db=np.full(n, -inf), phase_rad=zero, doppler_hz=zero)
