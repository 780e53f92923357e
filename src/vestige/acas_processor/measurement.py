"""Define the measurements of n epochs and m satellites, from which the checks compute their statistics."""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass, replace
from enum import IntEnum
from typing import Protocol, cast, runtime_checkable

import numpy as np
from jaxtyping import Float, Int, Int8, Int64

from vestige.navigation.position_fix import Fix, Transmission
from vestige.records.recs_block import RecsBlock
from vestige.records.snapshot_block import BankBlock, SnapshotBlock


class Availability(IntEnum):
    """Result of the correlation of E6: `CORRELATED`, or the reason why there are no correlators."""

    CORRELATED = 0
    NOT_SEEN = 1
    NO_RECS = 2
    NO_KEY = 3
    NOT_PROVEN = 4
    NO_SAMPLES = 5
    OUTSIDE = 6
    ZERO = 7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetectedBlock:
    """Result of the detector for each bank. If nothing was detected, `tap` is −1, and the other values are NaN."""

    tap: Int[np.ndarray, "*n"]  # index of the punctual correlator
    # magnitude of the punctual correlator in standard deviations of the noise per dimension
    magnitude_sigma: Float[np.ndarray, "*n"]
    phase_rad: Float[np.ndarray, "*n"]  # phase of the punctual correlator
    range_offset_m: Float[np.ndarray, "*n"]  # measured minus predicted E6 range
    threshold_sigma: float  # threshold of the magnitude


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FixBlock:
    """Position fix of each epoch from the E1 pseudoranges, and quantities for the checks; a missing fix is NaN."""

    fix: Fix  # position and clock
    sent: Transmission  # positions and clocks of the satellites at transmission; NaN for satellites without an orbit
    sigma_m: Float[np.ndarray, "n m"]  # standard deviation of each pseudorange that the receiver assumes
    # part of `sigma_m` from the ionosphere that is common to all satellites; None if this part is not modelled
    common_m: Float[np.ndarray, "n m"] | None
    bounded: bool  # whether `sigma_m` is only an upper limit of the standard deviation of the errors
    range_rate_mps: Float[np.ndarray, "n m"]  # measured rate of the pseudorange
    static_range_rate_mps: Float[np.ndarray, "n m"]  # rate for a receiver at rest without clock drift
    sigma_rate_mps: Float[np.ndarray, "n m"]  # standard deviation of the measured rate
    drift_mps: Float[np.ndarray, " n"]  # rate of the receiver's clock error, multiplied by c
    # standard deviations of `drift_mps`, and of the clock error multiplied by c; both without errors that are common to
    # all satellites
    sigma_drift_mps: Float[np.ndarray, " n"]
    own_sigma_clock_m: Float[np.ndarray, " n"]
    raim_statistic: Float[np.ndarray, " n"]  # weighted sum of squared residuals; NaN without redundancy
    separation_sigmas: Float[np.ndarray, "n 3"]  # largest separation to the east, north and up, in σ
    separation_modes: Int64[np.ndarray, " n"]  # number of satellites that are left out in turn

    @property
    def satellites(self) -> Int64[np.ndarray, " n"]:
        """Number of satellites used in the fix of each epoch; 0 without a fix."""
        return np.where(self.fix.valid, self.fix.n_used, 0).astype(np.int64)

    def at(self, epoch: int) -> Fix:
        """Return the fix of one epoch."""
        return cast("Fix", _rows(self.fix, slice(epoch, epoch + 1)))

    def rows(self, epochs: Int64[np.ndarray, " k"]) -> FixBlock:
        """Return a block with a copy of the given epochs."""
        return cast("FixBlock", _rows(self, epochs))

    def put(self, places: Int64[np.ndarray, " k"], other: FixBlock) -> None:
        """Overwrite the epochs at `places` with the epochs of another block."""
        _put(self, places, other)


def _rows(record: object, rows: Int64[np.ndarray, " k"] | slice) -> object:
    """Return a record with the given rows of all arrays, including the arrays of records inside the record."""
    if isinstance(record, np.ndarray):
        return record[rows]
    if not is_dataclass(record) or isinstance(record, type):
        return record
    return replace(record, **{one.name: _rows(getattr(record, one.name), rows) for one in fields(record)})


def _put(record: object, places: Int64[np.ndarray, " k"], values: object) -> None:
    """Overwrite rows of all arrays of a record, and of records inside the record, with the arrays of `values`."""
    if isinstance(record, np.ndarray):
        record[places] = values
    elif is_dataclass(record):
        for one in fields(record):
            _put(getattr(record, one.name), places, getattr(values, one.name))


@runtime_checkable
class Fixes(Protocol):
    """Position fixes of a block, computed at their first use."""

    @property
    def block(self) -> FixBlock | None:
        """Position fix of each epoch; None if no orbits are known."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasurementBlock:
    """Measurements of n epochs and m satellites. Each epoch is measured independently of the other epochs."""

    snapshots: SnapshotBlock  # the block that was measured
    recs: RecsBlock  # RECS and keys of the block
    availability: Int8[np.ndarray, "n m"]  # values of `Availability`
    banks: BankBlock  # correlators of E6
    detected: DetectedBlock  # result of the detector
    # probability of detection that E1's C/N0 predicts; NaN if C/N0 is unknown or nothing was correlated
    predicted_pd: Float[np.ndarray, "n m"]
    # time of the RECS that E1 predicts, in s after the time of the snapshot; NaN where no hand-over was made
    expected_s: Float[np.ndarray, "n m"]
    # Doppler on E6 that E1 predicts; NaN where no hand-over was made
    doppler_e6_hz: Float[np.ndarray, "n m"]
    # phase of the correlators that the carrier phase of E1 predicts, up to a constant of the satellite; NaN if E1 has
    # no carrier phase or nothing was correlated
    predicted_phase_rad: Float[np.ndarray, "n m"]
    # time over which the Doppler of E1 extrapolates the carrier phase, in s; NaN where `predicted_phase_rad` is NaN
    extrapolated_s: Float[np.ndarray, "n m"]
    fixes: Fixes | None = None  # object that computes the position fixes; None without position fixes

    @property
    def fix(self) -> FixBlock | None:
        """Position fix of each epoch; None if no orbits are known."""
        return None if self.fixes is None else self.fixes.block

    def single_precision(self) -> MeasurementBlock:
        """Return the block with the E6 measurements in single precision, as results store them.

        The checks use the single-precision values, so stored results give the same verdicts bit by bit.
        """
        banks, detected = self.banks, self.detected
        return replace(
            self,
            banks=replace(
                banks,
                taps=banks.taps.astype(np.complex64).astype(np.complex128),
                noise_power=_single(banks.noise_power),
            ),
            detected=replace(
                detected,
                magnitude_sigma=_single(detected.magnitude_sigma),
                phase_rad=_single(detected.phase_rad),
                range_offset_m=_single(detected.range_offset_m),
            ),
            predicted_pd=_single(self.predicted_pd),
            predicted_phase_rad=_single(self.predicted_phase_rad),
            extrapolated_s=_single(self.extrapolated_s),
        )

    def why_unavailable(self, epoch: int, satellite: int) -> str:
        """Return why a satellite has no correlators at an epoch; an empty text if the satellite has correlators."""
        here = (epoch, satellite)
        availability = Availability(int(self.availability[here]))
        if availability is Availability.NO_KEY:
            return f"no validated OSNMA key of {self.recs.key_time.at(*here)}"
        if availability is Availability.NOT_PROVEN:
            return self._why_not_proven(here)
        return _WHY[availability]

    def _why_not_proven(self, here: tuple[int, int]) -> str:
        uncertainty_s = self.snapshots.time_uncertainty_s[here[0]]
        if np.isinf(uncertainty_s):
            return (
                "not provably received before the key's disclosure: the upper limit of the receiver clock's error is "
                "not known (time_uncertainty_s)"
            )
        return (
            f"not provably received before the key's disclosure: samples until {self.snapshots.received_at.at(*here)} "
            f"± {uncertainty_s:g} s by the receiver's clock, key on air from {self.recs.disclosed.at(*here)}"
        )


def spread_over_block(
    values: np.ndarray, where: np.ndarray, shape: tuple[int, ...], nothing: float = np.nan
) -> np.ndarray:
    """Return an array of a given shape with `values` at `where` (rows or a mask), and `nothing` elsewhere."""
    found = np.full((*shape, *values.shape[1:]), nothing, values.dtype)
    found[where] = values
    return found


def _single(values: Float[np.ndarray, "n m"]) -> Float[np.ndarray, "n m"]:
    return values.astype(np.float32).astype(np.float64)


_WHY = {
    Availability.CORRELATED: "",
    Availability.NOT_SEEN: "not seen on E1",
    Availability.NO_RECS: "no RECS of this satellite for this time",
    Availability.NO_SAMPLES: "no E6 samples",
    Availability.OUTSIDE: "the E6 samples do not hold the RECS where it is expected",
    Availability.ZERO: "the E6 samples are all zero",
}
