"""Compute the sum of a satellite's components in one band, sub-chip by sub-chip, as a table that `path_kernel` samples.

A component with a primary code is a repeated pattern with a sign for each period. The sign is the secondary chip times
the symbol. A period has a single sign because a symbol lasts one code period on E1-B and on E6-B [OS-ICD, 2.3].
Encrypted components are given chip by chip.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float32, Int8

from vestige.signal_generator.path_kernel import fill_chips, fill_periodic
from vestige.signal_generator.waveform import Component


@dataclass(frozen=True, kw_only=True)
class BandModulation:
    """Modulation of a satellite in one band, the sum of components of equal power on one carrier."""

    components: tuple[Component, ...]

    @cached_property
    def per_chip(self) -> int:
        """Number of sub-chips in a chip, large enough for the pulses of all components."""
        return max(len(one.signal.pulse.levels) for one in self.components)

    @property
    def chip_rate_hz(self) -> float:
        """Chip rate in chips/s, the same for all components of a band."""
        return self.components[0].signal.chip_rate_hz

    @property
    def rate_hz(self) -> float:
        """Sub-chip rate in 1/s."""
        return self.chip_rate_hz * self.per_chip

    @cached_property
    def _pulses(self) -> tuple[Float32[np.ndarray, " per_chip"], ...]:
        return tuple(
            one.signal.polarity
            * np.repeat(one.signal.pulse.levels, self.per_chip // len(one.signal.pulse.levels)).astype(np.float32)
            for one in self.components
        )

    @cached_property
    def _patterns(self) -> tuple[Float32[np.ndarray, " n"], ...]:
        """Levels of one code period of each component; an array is empty if its component has no primary code."""
        nothing = np.zeros(0, np.float32)
        return tuple(
            nothing if one.primary is None else np.multiply.outer(one.primary.astype(np.float32), pulse).reshape(-1)
            for one, pulse in zip(self.components, self._pulses, strict=True)
        )

    def _chips(self, one: Component, first: int, n: int) -> Int8[np.ndarray, " n"] | Float32[np.ndarray, " n"]:
        """Return the chips of a component, multiplied by its symbols."""
        if one.stretch is not None and one.symbol is None:
            return one.stretch(first, n)
        number = first + np.arange(n)
        symbol = round(self.chip_rate_hz / one.signal.symbol_rate_hz) if one.symbol is not None else 1
        return one.chip(number) * (np.int8(1) if one.symbol is None else one.symbol(number // symbol))

    def levels(self, first_chip: int, n_chips: int) -> Float32[np.ndarray, " n"]:
        """Return the sum of the components, each of unit power, at each sub-chip of `n_chips` chips.

        `first_chip` is counted from the reference second.
        """
        levels = np.zeros(n_chips * self.per_chip, np.float32)
        for one, pattern, pulse in zip(self.components, self._patterns, self._pulses, strict=True):
            if one.primary is None or one.secondary is None:
                fill_chips(levels, self._chips(one, first_chip, n_chips), pulse)
                continue
            length = one.signal.code_length
            first, last = first_chip // length, (first_chip + n_chips - 1) // length
            period = first + np.arange(last - first + 1)
            signs = one.secondary[period % one.secondary.size].astype(np.float32)
            if one.symbol is not None:
                signs *= one.symbol(period)
            fill_periodic(levels, np.int64(first_chip) * self.per_chip, pattern, signs, np.int64(first))
        return levels
