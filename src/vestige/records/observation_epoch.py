"""Define the record of the E1 observations at one time, from a file or a receiver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Complex64

from vestige.records import E1Observation
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class ObservationEpoch:
    """E1 observations at one time.

    Attributes
    ----------
    time
        Receiver-clock time of the observations.
    observations
        Observations by SVID. Unmeasured quantities are NaN; the pseudorange is always measured.
    slipped
        Satellites whose carrier phase is not continuous with the previous epoch.
    taps
        E1-C correlators over the last 100 ms by SVID, complex64[k]. The unit is the standard deviation per dimension
        that a correlator would have if the samples were noise alone. `taps` is empty if the source has no correlators.
    tap_chips
        Offsets of the correlators from the prompt in chips; positive is later.
    power_db
        Mean power of the E1 samples in dB relative to one squared unit of the sample values; NaN if unknown.
    """

    time: GalileoTime
    observations: Mapping[int, E1Observation]
    slipped: frozenset[int] = frozenset()
    taps: Mapping[int, Complex64[np.ndarray, " k"]] = field(default_factory=dict)
    tap_chips: tuple[float, ...] = ()
    power_db: float = float("nan")
