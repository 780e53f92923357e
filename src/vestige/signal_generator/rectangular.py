"""Components as sums of rectangular chips, which is what the synthesis kernel adds.

A BPSK component is one sequence of ±1. CBOC is the sum of two: √(10/11) BOC(1,1) with 2 sub-chips a chip and
±√(1/11) BOC(6,1) with 12, each sub-chip a rectangle of its own [OS-ICD, 2.3.3].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int8

from vestige.signal_generator.waveform import Component
from vestige.signals.pulse import RECTANGULAR_PARTS


@dataclass(frozen=True, slots=True, kw_only=True)
class RectangularPart:
    """One sequence of rectangular sub-chips."""

    weight: float  # its amplitude in the component of unit power
    per_chip: int  # sub-chips a chip
    chips: Int8[np.ndarray, " n"]  # ±1


def rectangular_parts(component: Component, first_chip: int, n_chips: int) -> tuple[RectangularPart, ...]:
    """Return `n_chips` chips of a component from number `first_chip` on, times its symbols, part by part."""
    signal = component.signal
    index = first_chip + np.arange(n_chips)
    chips = component.chip(index)
    if component.symbol is not None:
        chips = chips * component.symbol(index // round(signal.chip_rate_hz / signal.symbol_rate_hz))
    return tuple(
        RectangularPart(
            weight=weight,
            per_chip=len(pulse.levels),
            chips=np.multiply.outer(chips, np.array(pulse.levels, np.int8)).reshape(-1),
        )
        for weight, pulse in RECTANGULAR_PARTS[signal.pulse]
    )
