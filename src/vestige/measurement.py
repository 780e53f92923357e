"""What the processor measured of one snapshot, before any decision."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from vestige.records import Band, CorrelatorBank, E1Observation, FrontEndStatus, Handover
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection:
    """A detected signal: which tap, how strong, where.

    Attributes
    ----------
    tap
        Index of the punctual correlator.
    magnitude
        Its magnitude in standard deviations of the noise per dimension.
    phase_rad
        Its phase in rad.
    threshold
        Detection threshold in the same unit as `magnitude`.
    range_offset_m
        Measured minus predicted E6 range in m.
    """

    tap: int
    magnitude: float
    phase_rad: float
    threshold: float
    range_offset_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SatelliteMeasurement:
    """What was measured of one satellite in one snapshot; a None says that the step was not reached.

    Attributes
    ----------
    unavailable
        Why no correlation was possible ("" if it was).
    available_at
        When the key was complete, so that this could be known.
    """

    svid: int
    handover: Handover | None = None
    bank: CorrelatorBank | None = None
    detection: Detection | None = None
    predicted_pd: float = float("nan")
    available_at: GalileoTime | None = None
    unavailable: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """All measurements of one snapshot, made without memory; `decide` folds over them."""

    index: int
    time: GalileoTime
    satellites: tuple[SatelliteMeasurement, ...]
    observations: Mapping[int, E1Observation]
    front_end: Mapping[Band, FrontEndStatus]
