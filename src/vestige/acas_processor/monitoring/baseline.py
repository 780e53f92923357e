"""Find the reference levels of power, C/N0 and noise floor, configured or learned [WFO, Sec. IV-B].

The checks of step 3 compare measured values with a reference level. A reference level has one of two sources:

1. The receiver's settings may state the reference level (calibrated front end, antenna with known C/N0).
2. Otherwise the receiver learns the reference level as the median of the last `BASELINE_WINDOW` values of epochs with
   RECS and without an alarm. Before `LEARNED` values are collected, checks that need this reference level are not run.

If an attack is present from the beginning and raises no alarm, the receiver learns the reference level from values of
the attack. The median of k normal values has about π/(2k) times the variance of a single value, so thresholds are
multiplied by √(1 + π/(2k)).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from statistics import median
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int64

from vestige.acas_processor.measurement import MeasurementBlock
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records import Band
from vestige.signals.definitions import E6C

BASELINE_WINDOW = 20
LEARNED = 5
_LEAST_SNR = 1e-3  # lower limit of an estimated SNR, which would otherwise be negative for correlators below the noise


class Quantity(Enum):
    """Quantity that has a reference level."""

    E1_POWER_DB = "power of E1"
    E6_POWER_DB = "power of E6"
    E1_CN0_DBHZ = "C/N0 of E1"
    E6_CN0_DBHZ = "C/N0 of E6"
    FLOOR_DB = "noise floor behind the E6 correlators"

    @property
    def of_receiver(self) -> bool:
        """Whether the quantity is one number for all satellites."""
        return self in (Quantity.E1_POWER_DB, Quantity.E6_POWER_DB)


@dataclass(frozen=True, slots=True, kw_only=True)
class Antenna:
    """Antenna model: the expected C/N0 of a satellite against its elevation."""

    e1_dbhz: float  # C/N0 of E1-C at the zenith
    e6_dbhz: float  # C/N0 of E6-C at the zenith
    # decrease of C/N0 from zenith to horizon: C/N0(e) = zenith − fall (1 − sin e); if 0, no elevation is needed
    fall_db: float = 0.0

    def expected_dbhz(self, zenith_dbhz: float, elevation_rad: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the expected C/N0 in dBHz; NaN where C/N0 depends on an elevation that is unknown."""
        if not self.fall_db:
            return np.full(elevation_rad.shape, zenith_dbhz)
        return zenith_dbhz - self.fall_db * (1 - np.sin(elevation_rad))


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceLevels:
    """Reference levels that the receiver's settings state; None for a reference level that the receiver learns."""

    # power of each band without interference, in dB relative to the reference power of the front end
    e1_power_db: float | None = None
    e6_power_db: float | None = None
    antenna: Antenna | None = None

    def configured(self, quantity: Quantity, elevation_rad: Float[np.ndarray, "n m"]) -> Float[np.ndarray, "*n"] | None:
        """Return the stated reference level by epoch, and for C/N0 also by satellite; None if the level is learned."""
        power_db = {Quantity.E1_POWER_DB: self.e1_power_db, Quantity.E6_POWER_DB: self.e6_power_db}.get(quantity)
        if power_db is not None:
            return np.full(elevation_rad.shape[0], power_db)
        if self.antenna is not None and quantity is Quantity.E1_CN0_DBHZ:
            return self.antenna.expected_dbhz(self.antenna.e1_dbhz, elevation_rad)
        if self.antenna is not None and quantity is Quantity.E6_CN0_DBHZ:
            return self.antenna.expected_dbhz(self.antenna.e6_dbhz, elevation_rad)
        return None


class Reference(NamedTuple):
    """Reference level of a quantity at each epoch, and for C/N0 and noise floor also for each satellite.

    `value` is NaN where the reference level is unknown. `learned` is the number of values from which the reference
    level was learned; infinite where the settings state the reference level.
    """

    value: Float[np.ndarray, "*n"]
    learned: Float[np.ndarray, "*n"]

    @property
    def growth(self) -> Float[np.ndarray, "*n"]:
        """Factor that enlarges thresholds, because the reference level is a median of few values."""
        return np.sqrt(1 + np.pi / 2 / np.maximum(self.learned, 1))

    def why_unknown(self, place: tuple[int, ...]) -> str:
        """Return why the reference level is unknown."""
        if np.isinf(self.learned[place]):
            return "no level is expected: the elevation is not known"
        return f"its usual level is being learned: {self.learned[place]:.0f} of {LEARNED} snapshots without an alarm"


Values = tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Baseline:
    """Last values of each quantity at epochs with RECS and no alarm, by SVID; values of the receiver have the key 0."""

    values: Mapping[Quantity, Mapping[int, Values]] = field(default_factory=dict)

    def of(self, quantity: Quantity, svid: int) -> Values:
        """Return the values of a quantity and a satellite in order of time."""
        return self.values.get(quantity, {}).get(svid, ())


@dataclass(frozen=True, kw_only=True)
class Observed:
    """Values of a measured block from which the receiver learns reference levels."""

    measured: MeasurementBlock

    @cached_property
    def values(self) -> Mapping[Quantity, Float[np.ndarray, "*n"]]:
        """Values of every quantity; NaN where the quantity was not measured."""
        snapshots, banks = self.measured.snapshots, self.measured.banks
        nothing = np.full(len(snapshots.time), np.nan)
        power = {
            band: np.where(front_end.saturated, np.nan, front_end.power_db)
            for band, front_end in snapshots.front_end.items()
        }
        e6 = snapshots.front_end.get(Band.E6)
        correlated = np.isfinite(banks.noise_power) & (banks.noise_power > 0)
        noise = np.where(correlated, banks.noise_power, 1.0)
        largest = np.zeros(noise.shape)
        largest[correlated] = np.max(np.abs(banks.taps[correlated]), axis=1)
        snr = np.maximum(largest**2 / noise - 1, _LEAST_SNR)
        cn0_dbhz = 10 * np.log10(snr / banks.integration_s)
        gain_db = nothing if e6 is None else e6.agc_gain_db
        floor_db = 10 * np.log10(noise / (1 + self._own_share(snr))) - gain_db[:, None]
        return {
            Quantity.E1_POWER_DB: power.get(Band.E1, nothing),
            Quantity.E6_POWER_DB: power.get(Band.E6, nothing),
            Quantity.E1_CN0_DBHZ: snapshots.e1.cn0_dbhz,
            Quantity.E6_CN0_DBHZ: np.where(correlated, cn0_dbhz, np.nan),
            Quantity.FLOOR_DB: np.where(correlated, floor_db, np.nan),
        }

    def _own_share(self, snr: Float[np.ndarray, "n m"]) -> Float[np.ndarray, "n m"]:
        """Return the power that the signal adds to the measured noise floor, divided by the noise power.

        The result is at most Ec/N0, the energy of a chip over the noise density.
        """
        banks, chips_per_m = self.measured.banks, E6C.chip_rate_hz / SPEED_OF_LIGHT_MPS
        between = np.nan_to_num(self.measured.detected.range_offset_m) * chips_per_m % 1.0
        return snr / (banks.integration_s * E6C.chip_rate_hz) * ((1 - between) ** 2 + between**2)

    def references(
        self,
        levels: ReferenceLevels,
        baseline: Baseline,
        teaches: Bool[np.ndarray, " n"],
        elevation_rad: Float[np.ndarray, "n m"],
    ) -> Mapping[Quantity, Reference]:
        """Return the reference level of each quantity at each epoch, stated or learned from values before this epoch.

        `teaches` is True at epochs with RECS and without an alarm. The values of these epochs give the reference levels
        of later epochs.
        """
        found = {}
        for quantity, values in self.values.items():
            configured = levels.configured(quantity, elevation_rad)
            if configured is not None:
                found[quantity] = Reference(configured, np.full(configured.shape, np.inf))
                continue
            svids = (0,) if quantity.of_receiver else self.measured.snapshots.svids
            columns = [
                _running(baseline.of(quantity, svid), column, teaches)
                for svid, column in zip(svids, values.reshape(values.shape[0], -1).T, strict=True)
            ]
            value, learned = (np.stack(parts, axis=1).reshape(values.shape) for parts in zip(*columns, strict=True))
            found[quantity] = Reference(value, learned)
        return found

    def after(self, baseline: Baseline, teaches: Bool[np.ndarray, " n"]) -> Baseline:
        """Return the baseline after a block, to which the block's values at epochs with true `teaches` are added."""
        known: dict[Quantity, dict[int, Values]] = {}
        for quantity, values in self.values.items():
            known[quantity] = dict(baseline.values.get(quantity, {}))
            svids = (0,) if quantity.of_receiver else self.measured.snapshots.svids
            for svid, column in zip(svids, values.reshape(values.shape[0], -1).T, strict=True):
                taught = column[teaches & np.isfinite(column)][-BASELINE_WINDOW:]
                if taught.size:
                    known[quantity][svid] = (*baseline.of(quantity, svid), *taught.tolist())[-BASELINE_WINDOW:]
        return Baseline(values=known)


def _running(
    before: Values, column: Float[np.ndarray, " n"], teaches: Bool[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return the median of the last values with true `teaches` before each epoch, and the number of these values.

    The median is NaN with fewer than `LEARNED` values.
    """
    taught = teaches & np.isfinite(column)
    values = np.concatenate([np.array(before, np.float64), column[taught]])
    known: Int64[np.ndarray, " n"] = len(before) + np.cumsum(taught) - taught
    medians = np.full(values.size + 1, np.nan)  # medians of the values collected so far, by the number of these values
    growing = values[: BASELINE_WINDOW - 1].tolist()
    for count in range(max(LEARNED, len(before)), len(growing) + 1):
        medians[count] = median(growing[:count])
    if values.size >= BASELINE_WINDOW:
        medians[BASELINE_WINDOW:] = np.median(np.lib.stride_tricks.sliding_window_view(values, BASELINE_WINDOW), axis=1)
    return medians[known], np.minimum(known, BASELINE_WINDOW).astype(np.float64)
