"""Define the input of the checks: a measured block, and the receiver's memory of earlier epochs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.checks.osnma_subframes import Subframes
from vestige.acas_processor.measurement import MeasurementBlock
from vestige.acas_processor.monitoring.baseline import Quantity, Reference
from vestige.acas_processor.monitoring.memory import CheckMemory


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evidence:
    """Input of the checks for one block.

    Attributes
    ----------
    measured
        Block of snapshots with their measurements.
    time_s
        float64[n], times of the block's epochs in s after the first epoch that the receiver ever processed.
    elevation_rad
        float64[n, m], elevation of each satellite in rad from the last known position; NaN without a position or an
        orbit.
    observed, references
        Measured values of each quantity, and the reference levels of these quantities.
    subframes
        Counts of OSNMA pages and keys in the subframes that ended in the block.
    memory
        Mapping from SVID to the numbers that the check remembered after the previous block (`CheckWithMemory`). The
        numbers of the receiver have the key 0. The mapping is empty before the first block, and for a check without
        memory.
    """

    measured: MeasurementBlock
    time_s: Float[np.ndarray, " n"]
    elevation_rad: Float[np.ndarray, "n m"]
    observed: Mapping[Quantity, Float[np.ndarray, "*n"]]
    references: Mapping[Quantity, Reference]
    subframes: Subframes
    memory: CheckMemory = field(default_factory=dict)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of epochs, and number of satellites."""
        epochs, satellites = self.measured.snapshots.asked.shape
        return epochs, satellites
