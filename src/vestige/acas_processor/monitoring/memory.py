"""What single checks remember of the epochs before a block."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from vestige.time import GalileoTime

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockEpoch:
    """The receiver clock of one epoch, as the position fix gave it.

    Attributes
    ----------
    time_s
        After the first epoch that the receiver ever processed.
    bias_m, drift_mps
        Times c.
    bias_variance_m2, drift_variance_m2ps2
        Of the fix.
    """

    time_s: float
    bias_m: float
    drift_mps: float
    bias_variance_m2: float
    drift_variance_m2ps2: float


ClockMemory = tuple[ClockEpoch, ...]  # the latest last


@dataclass(frozen=True, slots=True, kw_only=True)
class Subframe:
    """OSNMA of one subframe, as far as it is known.

    Attributes
    ----------
    start
        In s since the GST epoch.
    due, received, differs
        Bits of pages by satellite.
    """

    start: int
    due: Mapping[int, int] = field(default_factory=dict)
    received: Mapping[int, int] = field(default_factory=dict)
    differs: Mapping[int, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaMemory:
    """OSNMA of the epochs before: which of the last subframes brought a key, and the one that has not ended."""

    keyed: tuple[bool, ...] = ()
    open: Subframe | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SatelliteRate:
    """The range rate of a satellite at the last epoch with RECS.

    Attributes
    ----------
    rate_mps, static_mps, sigma_mps
        Measured rate of the pseudorange, that of a receiver and a clock that stand still, and the error of the first.
    towards
        Unit vector to the satellite, ECEF.
    """

    rate_mps: float
    static_mps: float
    sigma_mps: float
    towards: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class RateMemory:
    """The last epoch with RECS and a position, and what the receiver gained in velocity since.

    Attributes
    ----------
    time
        Of the epoch.
    position_m
        ECEF.
    satellites
        By SVID.
    increments
        End times and velocity increments (east, north, up, m/s) since.
    covered
        Whether the increments leave no gap.
    """

    time: GalileoTime
    position_m: Vector
    satellites: Mapping[int, SatelliteRate]
    increments: tuple[tuple[GalileoTime, Vector], ...] = ()
    covered: bool = True
