"""E1 observations of one moment, as a file holds them or a receiver makes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Complex64

from vestige.records import E1Observation
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class ObservationEpoch:
    """E1 observations of one moment.

    Attributes
    ----------
    time
        Receiver-clock time of the observations.
    observations
        Observations by SVID. NaN stands for what was not measured; the pseudorange always is.
    slipped
        Satellites whose carrier phase is not continuous with the epoch before.
    taps
        Correlators by SVID, complex64[k]: those of E1-C over the 100 ms before, in standard deviations of the noise per
        dimension if the samples were noise alone. Empty if the source has none.
    tap_chips
        Their offsets from the prompt in chips; positive is later.
    power_db
        Mean power of the E1 samples in dB relative to one unit of their numbers squared; NaN if not known.
    """

    time: GalileoTime
    observations: Mapping[int, E1Observation]
    slipped: frozenset[int] = frozenset()
    taps: Mapping[int, Complex64[np.ndarray, " k"]] = field(default_factory=dict)
    tap_chips: tuple[float, ...] = ()
    power_db: float = float("nan")
