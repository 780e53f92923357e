"""Compute the carrier phase of a spoofing signal relative to the true signal, with one of three phase laws.

    locked      φ = φ0                              for any delay: the carrier phase aligned attack
    slipping    φ = φ0 + 2π f (t − t_start)         a frequency error of the attacker's oscillator
    coherent    φ = φ0 − 2π f_c τ(t)/c              as with a delay line: a cycle per wavelength of delay

Let η be the power of the spoofing signal relative to the true signal, τ the delay of the spoofing signal, and R the
autocorrelation of the code. If the true signal alone gives the amplitude 1, a correlator at the delay of the true
signal has the amplitude |1 + √η e^{jφ} R(τ)|. So the phase decides whether the signals cancel or reinforce each other.
The phase of a locked or slipping spoofing signal does not follow its delay, so its code and carrier can diverge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.errors import SettingError

_MAX_SLIP_HZ = 1e4  # largest frequency error in Hz, twice the Doppler range of an acquisition


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayedCarrier:
    """Arguments of a phase law: time since the attack's start, delay, rate of the delay, and carrier frequency."""

    since_start_s: Float[np.ndarray, " n"]
    delay_m: Float[np.ndarray, " n"]
    delay_rate_mps: Float[np.ndarray, " n"]
    carrier_hz: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Locked:
    """Phase law `locked`, with a constant phase φ0 in rad."""

    phase_rad: float = 0.0
    kind: Literal["locked"] = "locked"

    def phase(self, signal: DelayedCarrier) -> Float[np.ndarray, " n"]:
        """Return the phase φ in rad."""
        return np.full(signal.delay_m.shape, self.phase_rad)

    def doppler_hz(self, signal: DelayedCarrier) -> Float[np.ndarray, " n"]:
        """Return the frequency dφ/dt / 2π in Hz, which is 0."""
        return np.zeros(signal.delay_m.shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class Slipping:
    """Phase law `slipping`, with a constant frequency error f in Hz and the phase φ0 in rad at the attack's start."""

    slip_hz: float
    phase_rad: float = 0.0
    kind: Literal["slipping"] = "slipping"

    def __post_init__(self) -> None:
        if not abs(self.slip_hz) <= _MAX_SLIP_HZ:
            raise SettingError("slip_hz", f"{self.slip_hz:g} Hz", f"at most {_MAX_SLIP_HZ:g} Hz up or down")

    def phase(self, signal: DelayedCarrier) -> Float[np.ndarray, " n"]:
        """Return the phase φ in rad."""
        return self.phase_rad + 2 * np.pi * ((self.slip_hz * signal.since_start_s) % 1.0)

    def doppler_hz(self, signal: DelayedCarrier) -> Float[np.ndarray, " n"]:
        """Return the frequency dφ/dt / 2π in Hz."""
        return np.full(signal.delay_m.shape, self.slip_hz)


@dataclass(frozen=True, slots=True, kw_only=True)
class Coherent:
    """Phase law `coherent`, with the phase that the delay of the signal causes, plus a constant φ0 in rad."""

    phase_rad: float = 0.0
    kind: Literal["coherent"] = "coherent"

    def phase(self, signal: DelayedCarrier) -> Float[np.ndarray, " n"]:
        """Return the phase φ in rad."""
        return self.phase_rad - 2 * np.pi * ((signal.carrier_hz / SPEED_OF_LIGHT_MPS * signal.delay_m) % 1.0)

    def doppler_hz(self, signal: DelayedCarrier) -> Float[np.ndarray, " n"]:
        """Return the frequency dφ/dt / 2π in Hz."""
        return -signal.carrier_hz / SPEED_OF_LIGHT_MPS * signal.delay_rate_mps


COHERENT = Coherent()
ALL_PHASES = (Locked, Slipping, Coherent)
Phase = Annotated[Locked | Slipping | Coherent, Field(discriminator="kind")]
