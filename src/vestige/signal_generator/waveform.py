"""Compute Galileo components as continuous complex functions of time, at any sampling rate [WFO, Sec. V].

At the satellite time t_s, the satellite sends the real function d(t_s) · c(t_s). The symbol is d, and c is the product
of secondary chip, primary chip and pulse level. In a pilot, c also has a minus sign, because the signal of a band is
(e_B − e_C)/√2, with the data component e_B and the pilot e_C [OS-ICD, 2.3.3]. All codes and symbols start with the
Galileo second, so t_s is counted from a whole second.

The signal that arrives at the receiver time t was sent at t_s = t − P(t)/c, on the carrier e^{j2π f_c t_s}. In P(t)/c,
c is the speed of light. After the mixer with the frequency f_0 the signal of amplitude a is

    x(t) = a · d(t_s) · c(t_s) · exp j2π[ (f_c − f_0) t − f_c P(t)/c ]

The pseudorange P(t) thus gives the Doppler of code, symbols and carrier.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex128, Float, Float32, Int8, Int64

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.signals.codes import primary_code, secondary_code, tiered_code
from vestige.signals.definitions import SignalDefinition
from vestige.streams import stream_key

Sequence = Callable[[Int64[np.ndarray, " n"]], Int8[np.ndarray, " n"]]
Chips = Callable[[Int64[np.ndarray, " n"]], Int8[np.ndarray, " n"] | Float32[np.ndarray, " n"]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """Signal component of a satellite, such as E6-C."""

    signal: SignalDefinition
    chip: Chips  # function that returns chips by number since the reference second: int8 if ±1, else float32
    symbol: Sequence | None = None  # function that returns symbols ±1 by number since the reference second, or None
    # Function that returns chips number `first` to `first + n - 1`; None if no such function is faster than `chip`.
    stretch: Callable[[int, int], Int8[np.ndarray, " n"]] | None = None
    # Primary and secondary code if `chip` is the product of these codes; None for other chips.
    primary: Int8[np.ndarray, " n"] | None = None
    secondary: Int8[np.ndarray, " k"] | None = None

    def modulation(self, satellite_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return d · c, the transmitted signal, at satellite times in s after the reference second."""
        phase = satellite_s * self.signal.chip_rate_hz
        chip = np.floor(phase)
        levels = np.asarray(self.signal.pulse.levels)
        values = levels[((phase - chip) * levels.size).astype(np.int64)] * self.chip(chip.astype(np.int64))
        values = self.signal.polarity * values
        if self.symbol is not None:
            values = values * self.symbol(np.floor(satellite_s * self.signal.symbol_rate_hz).astype(np.int64))
        return values

    def received(
        self, t_s: Float[np.ndarray, " n"], pseudorange_m: Float[np.ndarray, " n"], center_frequency_hz: float
    ) -> Complex128[np.ndarray, " n"]:
        """Return the received signal x(t) with unit amplitude.

        `pseudorange_m` is P(t) of this band in m. The front end moves the radio frequency `center_frequency_hz` to 0
        Hz.
        """
        delay_s = pseudorange_m / SPEED_OF_LIGHT_MPS
        cycles = (self.signal.carrier_hz - center_frequency_hz) * t_s - self.signal.carrier_hz * delay_s
        return self.modulation(t_s - delay_s) * np.exp(2j * np.pi * (cycles - np.floor(cycles)))


def open_component(signal: SignalDefinition, svid: int, *, seed: int = 0) -> Component:
    """Return a component with its published codes, and with random symbols on a data channel.

    Each satellite and each signal has its own random symbols.
    """
    symbols = random_signs(stream_key(seed, "symbols", signal.name, svid)) if signal.symbol_rate_hz else None
    return coded_component(signal, svid, symbols)


def coded_component(signal: SignalDefinition, svid: int, symbol: Sequence | None) -> Component:
    """Return a component with its published codes and the given symbols; `symbol` is None for a pilot."""
    code = tiered_code(signal, svid)
    return Component(
        signal=signal,
        chip=lambda index: code[index % code.size],
        symbol=symbol,
        primary=primary_code(signal, svid),
        secondary=secondary_code(signal, svid),
    )


def random_signs(key: bytes) -> Sequence:
    """Return a sequence of ±1 that is a pure function of key and index (splitmix64 finaliser)."""
    start = np.uint64(int.from_bytes(key[:8], "little"))

    def sign(index: Int64[np.ndarray, " n"]) -> Int8[np.ndarray, " n"]:
        z = start + index.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return (1 - 2 * ((z ^ (z >> np.uint64(31))) >> np.uint64(63)).astype(np.int8)).astype(np.int8)

    return sign
