"""Define the findings about the signals of a recording: the evidence, and the change to make."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from enum import StrEnum

from vestige.records import Band


class FindingKind(StrEnum):
    """Kind of a finding, with the name that appears in the JSON of `vestige inspect`."""

    NO_SIGNAL = "no signal"
    SWAPPED_BANDS = "swapped bands"
    SAMPLING_RATE = "sampling rate"
    REVERSED_SPECTRUM = "reversed spectrum"
    LAYOUT = "real or complex"
    FORMAT = "sample format"
    CENTRE_FREQUENCY = "centre frequency"
    LOST_SAMPLES = "lost samples"
    BAND_OFFSET = "offset of the bands"
    EMPTY = "no samples that differ"
    CLIPPED = "clipped"
    NOT_FINITE = "not finite"
    TOO_SHORT = "too short"
    SEVERAL_SIGNALS = "several signals"
    E6C_OPEN = "E6-C open"
    E6C_ENCRYPTED = "E6-C encrypted"
    DURATION = "duration"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A single finding about the samples."""

    kind: FindingKind
    band: Band | None
    is_fault: bool  # False for a remark on a recording that agrees with its description
    evidence: str  # evidence of the finding, with the measured numbers
    advice: str  # change to make, or action to take

    @property
    def line(self) -> str:
        """Evidence and advice in one line."""
        return f"{self.evidence}; {self.advice}"


def fault(kind: FindingKind, band: Band | None, evidence: str, advice: str) -> Finding:
    """Return a finding of a fault."""
    return Finding(kind=kind, band=band, is_fault=True, evidence=evidence, advice=advice)


def remark(kind: FindingKind, band: Band | None, evidence: str, advice: str) -> Finding:
    """Return a finding that is not a fault."""
    return Finding(kind=kind, band=band, is_fault=False, evidence=evidence, advice=advice)


@dataclass(slots=True)
class TimeLimit:
    """Limit of the processor time of a step of the examination, counted from the creation of the object.

    Processor time, in contrast to the time of day, depends little on the load of the machine. So the load of the
    machine changes the findings little.
    """

    seconds: float
    _start_s: float = field(default_factory=time.process_time)

    @property
    def is_over(self) -> bool:
        """Whether the processor time is used up."""
        return time.process_time() - self._start_s > self.seconds
