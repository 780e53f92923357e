"""Memory of single checks: values from the epochs before a block."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from vestige.time import GalileoTime

Vector = tuple[float, float, float]
# −log₁₀ of the probability of the E6 misses in a row, by satellite; satellites without misses are left out
MissMemory = Mapping[int, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockEpoch:
    """The receiver clock of one epoch from the position fix."""

    time_s: float  # after the first epoch that the receiver ever processed
    # times c
    bias_m: float
    drift_mps: float
    bias_variance_m2: float
    drift_variance_m2ps2: float


ClockMemory = tuple[ClockEpoch, ...]  # in order of time


@dataclass(frozen=True, slots=True, kw_only=True)
class FixMemory:
    """Last position from authentic ranges without an alarm."""

    time_s: float  # after the first epoch that the receiver ever processed
    position_m: Vector  # ECEF


@dataclass(frozen=True, slots=True, kw_only=True)
class Subframe:
    """OSNMA of one subframe, as far as received."""

    start: int  # in s since the GST epoch
    # bits of pages by satellite
    due: Mapping[int, int] = field(default_factory=dict)
    received: Mapping[int, int] = field(default_factory=dict)
    differs: Mapping[int, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaMemory:
    """OSNMA of earlier epochs: whether each of the last subframes brought a key, and the unfinished subframe."""

    keyed: tuple[bool, ...] = ()
    open: Subframe | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SatelliteRate:
    """The range rate of a satellite at the last epoch with RECS."""

    # measured rate of the pseudorange, its rate for a receiver and a clock at rest, and the error of the measured rate
    rate_mps: float
    static_mps: float
    sigma_mps: float
    towards: Vector  # unit vector to the satellite, ECEF


@dataclass(frozen=True, slots=True, kw_only=True)
class RateMemory:
    """Last epoch with RECS and a position, and the increments of velocity since then."""

    time: GalileoTime
    position_m: Vector
    satellites: Mapping[int, SatelliteRate]
    # end times and velocity increments (east, north, up, m/s) since that epoch
    increments: tuple[tuple[GalileoTime, Vector], ...] = ()
    covered: bool = True  # whether the increments have no gap


class CarrierEpoch(NamedTuple):
    """E6 carrier of a satellite in one RECS: phase against the E1 prediction, magnitude and C/N0."""

    time_s: float  # after the first epoch that the receiver ever processed
    phase_rad: float  # detecting correlator minus the phase that E1 predicts, up to a constant; NaN if unknown
    magnitude_sigma: float  # magnitude of the detecting correlator in standard deviations of the noise per dimension
    cn0_e1_dbhz: float
    extrapolated_s: float  # time over which the Doppler of E1 extrapolates its phase to the middle of the RECS


CarrierMemory = Mapping[
    int, tuple[CarrierEpoch, ...]
]  # by satellite, in order of time, since E1 tracks it without a gap
