"""Simulate security code estimation and replay (SCER): the attacker estimates symbols of E1-B and chips of E6-C.

`vestige.theory.scer.code_estimation` gives the quality of the estimates. In a recording with hard or soft decisions on
E1-B, the attacker renews the estimate of a symbol with each chip that is received. A hard decision is a sign, and a
soft decision is a sign with an amplitude.

**Noise on E6.** The simulated E6 spoofing signals have the true chips. The errors of the estimates are added as white
noise. The attacker estimates the chips of each satellite separately. So the errors of two satellites are independent,
and the powers of the errors add:

    N/N0 = Σ_i η (Ec/N0 of satellite i) (1/ρ_i² − 1)        i: all satellites of the attack

η is the power of the part of the spoofing signal that correlates with the true chips, relative to the true signal. Ec
is the energy of a chip at the victim. ρ_i² is the share of the power of the estimates that correlates with the true
chips of satellite i. All satellites are received with one front end, so the noise of this sum affects every satellite.
The sum of independent Gaussian noises is Gaussian noise with the sum of the powers. So a single sequence of noise
simulates the errors of all satellites. Each term is the noise density after a correlator whose chips begin
together with the estimated chips. In a correlator whose chips begin at another time, the density is 0.5 to 1 times the
term, and 2/3 on average. So the sum is an upper limit of the noise in a real receiver.

A repeater (`chips = "repeated"`) receives all satellites together, so its noise counts once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, get_args

import numpy as np
from jaxtyping import Float, Float32, Int8, Int64

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.errors import SettingError
from vestige.records import Band
from vestige.signal_generator.noise_kernel import normal_pairs
from vestige.signal_generator.waveform import Chips, Component, Sequence
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1B, E6C
from vestige.spoofer.attack import CheckedAttack, SpoofingSignal, delayed
from vestige.spoofer.phase import COHERENT, Phase
from vestige.spoofer.profiles import Profile, as_profile, extremes
from vestige.spoofer.repeaters import RECEPTION_GAIN_DB, repeated_noise
from vestige.streams import stream_key
from vestige.theory.scer.code_estimation import Decision, Estimation, estimation_noise

_MAX_LATENCY_S = E1B.period_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Scer(CheckedAttack):
    """Security code estimation and replay of E1-B symbols, with chips of E6-C that are repeated or estimated.

    The attacker estimates each E1-B symbol from its first part and transmits code and symbol on time. E6-C chips are
    below the noise (Ec/N0 = −22 dB at 45 dBHz), and the attacker knows no chip before its end. So the spoofing signal
    on E6 comes `e6_lag_m` later than the spoofing signal on E1.

    Attributes
    ----------
    delay_m, power_db, phase
        Delay in m, power in dB and phase law of the spoofing signal on E1. On E6 `power_db` is the power of the part
        that correlates with the true chips.
    e6_lag_m
        Delay in m of the E6 spoofing signal after the E1 spoofing signal. The delay should be at least the length of an
        E6-C chip, because the attacker knows no chip before its end.
    reception_gain_db
        Gain G in dB: C/N0 of the attacker's reception over the victim's C/N0.
    chips
        Chips of E6-C that the attacker transmits: `repeated` with the attacker's noise, or `hard` or `soft` decisions
        on each chip.
    symbols
        Symbols of E1-B that the attacker transmits: `known` from the beginning of a symbol on, or `hard` or `soft`
        decisions while the symbol is received. This key is meant for recordings, because no receiver of a campaign
        decodes the symbols.
    victim_cn0_dbhz
        C/N0 of E6-C and of E1-B in dBHz with the victim's antenna. This C/N0 and G determine the quality of the
        attacker's estimates. A number applies to all satellites. `received` means the victim's C/N0 of E6-C of each
        satellite.
    latency_s
        Time in s from reception at the attacker's antenna to transmission. If the attacker transmits a symbol with a
        delay τ, the estimate at the beginning of the symbol uses the first τ − `latency_s` of the received symbol.
    """

    delay_m: Profile
    power_db: Profile
    phase: Phase = COHERENT
    e6_lag_m: float = SPEED_OF_LIGHT_MPS / E6C.chip_rate_hz
    reception_gain_db: float = RECEPTION_GAIN_DB
    chips: Estimation = "repeated"
    symbols: Literal["known"] | Decision = "known"
    victim_cn0_dbhz: float | Literal["received"] = 45.0
    latency_s: float = 0.0
    kind: Literal["scer"] = "scer"

    def __post_init__(self) -> None:
        CheckedAttack.__post_init__(self)
        if self.chips not in get_args(Estimation):
            raise ValueError(f"chips are one of {', '.join(get_args(Estimation))}, found {self.chips!r}")
        if self.symbols not in ("known", *get_args(Decision)):
            raise ValueError(f"symbols are one of known, {', '.join(get_args(Decision))}, found {self.symbols!r}")
        found = self.victim_cn0_dbhz
        if isinstance(found, str):
            if found != "received":
                raise ValueError(f"the victim's C/N0 is a number of dBHz or received, found {found!r}")
        elif not 0 <= found <= 70:
            raise SettingError("victim_cn0_dbhz", f"{found:g} dBHz", "0 to 70 dBHz")
        if not 0 <= self.latency_s <= _MAX_LATENCY_S:
            raise SettingError("latency_s", f"{self.latency_s:g} s", f"0 to {_MAX_LATENCY_S:g} s")

    @property
    def attacker_cn0_dbhz(self) -> float:
        """C/N0 of the attacker's reception in dBHz.

        The property raises `ValueError` if `victim_cn0_dbhz` is `received`; `against` replaces `received` by a number.
        """
        return self._victim_dbhz + self.reception_gain_db

    @property
    def _victim_dbhz(self) -> float:
        if isinstance(self.victim_cn0_dbhz, str):
            raise ValueError("the victim's C/N0 depends on the satellite")
        return self.victim_cn0_dbhz

    @property
    def outside_assumption_2(self) -> str:
        """Reason why the attack violates Assumption 2 of [WFO]; empty if the assumption holds."""
        early = extremes(self.delay_m)[0] + self.e6_lag_m < 0
        return "the encrypted spoofing signal arrives before the true signal" if early else ""

    def spoofing_signal(self, band: Band, times_s: Float[np.ndarray, " n"]) -> SpoofingSignal | None:
        """Return the spoofing signal of a satellite in a band, which is `e6_lag_m` later on E6 than on E1."""
        lag_m = self.e6_lag_m if band is Band.E6 else 0.0
        on_time = delayed(self, band, times_s, delay_m=self.delay_m, power_db=self.power_db, phase=self.phase)
        if not lag_m:
            return on_time
        return SpoofingSignal(
            delay_m=on_time.delay_m + lag_m,
            delay_rate_mps=on_time.delay_rate_mps,
            power_db=on_time.power_db,
            phase_rad=on_time.phase_rad,
            doppler_hz=on_time.doppler_hz,
        )

    def noise_over_n0(self, band: Band, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the noise density over N0: 0 on E1; on E6 from the attacker's reception or decisions on chips."""
        if band is Band.E1:
            return np.zeros(times_s.shape)
        if self.chips == "repeated":
            return repeated_noise(self, self.power_db, self.reception_gain_db, times_s)
        power = 10 ** (as_profile(self.power_db).value(times_s) / 10)
        return np.where(self.on(times_s), power * self.noise_at_0_db, 0.0)

    @property
    def noise_at_0_db(self) -> float:
        """Noise density over N0 of the decisions on the chips of one satellite, for a spoofing signal of 0 dB."""
        return estimation_noise(self._victim_dbhz, self.reception_gain_db, self.chips)

    def head_start_s(self, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the received part of a symbol in s when its transmission begins; negative before reception begins."""
        return as_profile(self.delay_m).value(times_s) / SPEED_OF_LIGHT_MPS - self.latency_s

    def replayed(self, component: Component, svid: int, seed: int) -> Component:
        """Return E1-B with symbols estimated chip by chip; known symbols and other components do not change."""
        if self.symbols == "known" or component.signal is not E1B or component.symbol is None:
            return component
        key = np.uint64(int.from_bytes(stream_key(seed, "symbols that an attacker estimates", svid)[:8], "little"))
        return Component(signal=E1B, chip=self._estimated_chips(component.symbol, primary_code(E1B, svid), key))

    def _estimated_chips(self, symbol: Sequence, code: Int8[np.ndarray, " 4092"], key: np.uint64) -> Chips:
        """Return the chips of E1-B times the attacker's estimate of the symbol at each chip.

        In each chip time, the attacker's sum Σ increases by s √(2γ) plus a standard normal number. The symbol is s =
        ±1, and γ is the Ec/N0 of a chip at the attacker. A hard decision is sign Σ, or a random guess if no chip has
        been received. A soft decision is tanh(√(2γ) Σ).
        """
        root = np.sqrt(2 * 10 ** (self.attacker_cn0_dbhz / 10) / E1B.chip_rate_hz)

        def estimates(period: int) -> Int8[np.ndarray, " 4092"] | Float32[np.ndarray, " 4092"]:
            start_s = np.array([max(period * E1B.period_s, 0.0)])
            head_chips = float(self.head_start_s(start_s)[0]) * E1B.chip_rate_hz
            received = np.maximum(np.arange(code.size) + head_chips, 0.0)  # number of chips received before each chip
            step = np.diff(received, prepend=0.0)
            normal = normal_pairs(key, period * (code.size // 2), code.size // 2).reshape(-1)
            total = np.cumsum(int(symbol(np.array([period]))[0]) * root * step + np.sqrt(step) * normal)
            if self.symbols == "soft":
                return np.tanh(root * total).astype(np.float32)
            return np.where(np.where(received > 0, total, normal) > 0, 1, -1).astype(np.int8)

        def chip(index: Int64[np.ndarray, " n"]) -> Int8[np.ndarray, " n"] | Float32[np.ndarray, " n"]:
            period, place = np.divmod(index, code.size)
            periods, row = np.unique(period, return_inverse=True)
            return np.stack([code * estimates(one) for one in periods.tolist()])[row, place]

        return chip


@dataclass(frozen=True, slots=True, kw_only=True)
class ScerOnSatellite(Scer):
    """SCER attack on one satellite of a receiver, with the noise of the estimates for all satellites of the attack."""

    noise_of_all: float  # noise density over N0 of the decisions for all satellites, for a power of 0 dB

    @property
    def noise_at_0_db(self) -> float:
        """Noise density over N0 of the decisions on the chips of all satellites of the attack, for a power of 0 dB."""
        return self.noise_of_all


def against(attacks: tuple[Any, ...], svid: int, cn0_dbhz: Mapping[int, float]) -> tuple[Any, ...]:
    """Return the attacks of a scenario as they affect one satellite.

    In an SCER attack with `victim_cn0_dbhz = "received"`, the C/N0 of the satellite replaces `received`. An SCER attack
    that decides on chips gets the noise of all its satellites. All other attacks are unchanged.

    Parameters
    ----------
    attacks
        Attacks of a scenario.
    svid
        SVID of the satellite.
    cn0_dbhz
        C/N0 in dBHz of E6-C at the victim, by the SVID of each satellite on air.
    """
    return tuple(_on_satellite(one, svid, cn0_dbhz) if isinstance(one, Scer) else one for one in attacks)


def _on_satellite(attack: Scer, svid: int, cn0_dbhz: Mapping[int, float]) -> Scer:
    each = {
        one: replace(attack, victim_cn0_dbhz=dbhz) if attack.victim_cn0_dbhz == "received" else attack
        for one, dbhz in cn0_dbhz.items()
    }
    if attack.chips == "repeated":
        return each[svid]
    estimated = [own.noise_at_0_db for one, own in each.items() if not attack.svids or one in attack.svids]
    given = {field.name: getattr(each[svid], field.name) for field in fields(Scer)}
    return ScerOnSatellite(**given, noise_of_all=float(sum(estimated)))
