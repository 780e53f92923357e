"""Define the parser of E1 observation files, epoch by epoch, and the limits of valid values."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol, runtime_checkable

from vestige.constants import MAX_SVID
from vestige.errors import InputFileError
from vestige.recording.text_lines import numbered_lines
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?", re.ASCII)

# Limits beyond which a number is invalid. Pseudoranges include the receiver's clock error, of up to minutes.
LIMITS = {
    "pseudorange_m": (-1e11, 1e11),
    "carrier_phase_cycles": (-1e12, 1e12),
    "doppler_hz": (-1e6, 1e6),
    "doppler_rate_hz_per_s": (-1e6, 1e6),
    "cn0_dbhz": (-50.0, 100.0),
}


@runtime_checkable
class EpochParser(Protocol):
    """Parser that takes the lines of an observation file one by one, and gives each epoch when the epoch is complete.

    After an error the parser leaves out the wrong line or the epoch of the line, and can continue.
    """

    @property
    def begun(self) -> bool:
        """Whether the header was read.

        An error in the header means that the file has another format.
        """
        ...

    def take(self, number: int, line: str) -> ObservationEpoch | None:
        """Return the epoch that a line completes, or None."""
        ...

    def finish(self) -> ObservationEpoch | None:
        """Return the epoch that the end of the file completes, or None.

        The function raises `InputFileError` if the file was cut off or is empty.
        """
        ...


def read_epochs(path: Path, parser: EpochParser) -> Iterator[ObservationEpoch]:
    """Yield the epochs of a whole file.

    The function raises the errors of the parser and of `numbered_lines`.
    """
    for number, line in numbered_lines(path):
        epoch = parser.take(number, line)
        if epoch is not None:
            yield epoch
    epoch = parser.finish()
    if epoch is not None:
        yield epoch


def checked(path: Path, line: int, name: str, value: float) -> float:
    """Return the value of an observation field if a receiver can measure such a value.

    The function raises `InputFileError` if the value lies outside `LIMITS`.
    """
    low, high = LIMITS[name]
    if not low <= value <= high:
        raise InputFileError(path, f"line {line}: {name}", value, f"a number from {low:g} to {high:g}")
    return value


def checked_svid(path: Path, line: int, text: str) -> int:
    """Return a Galileo space vehicle identifier.

    The function raises `InputFileError` if `text` is not an integer from 1 to 36.
    """
    text = text.strip()
    if not (text.isascii() and text.isdigit() and len(text) <= 3 and 1 <= int(text) <= MAX_SVID):
        raise InputFileError(path, f"line {line}: svid", text, f"a Galileo satellite, 1 to {MAX_SVID}")
    return int(text)


def check_order(path: Path, line: int, before: GalileoTime | None, time: GalileoTime) -> None:
    """Check that an epoch is later than the previous epoch.

    The function raises `InputFileError` if the epoch is not later.
    """
    if before is not None and time <= before:
        raise InputFileError(path, f"line {line}: time", str(time), f"a time after {before}")
