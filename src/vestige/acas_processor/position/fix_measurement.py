"""Compute the position fix of every epoch of a block, and the quantities for the checks of step 5 [WFO, Sec. IV-B].

The fix uses the broadcast orbits, and the E1 pseudoranges of all satellites with a known orbit and a known standard
deviation. If the standard deviations of the pseudoranges depend on the elevation, a first fix with constant or
C/N0-dependent standard deviations gives the elevation.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.checks.raim import raim_statistic
from vestige.acas_processor.checks.solution_separation import largest_separations
from vestige.acas_processor.measurement import FixBlock
from vestige.acas_processor.position.possible_range import ApproximatePosition
from vestige.acas_processor.position.pseudorange_errors import PseudorangeErrors
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import local_axes_at
from vestige.navigation.ephemeris import FIT_INTERVAL_S, Ephemeris, why_no_orbits
from vestige.navigation.position_fix import (
    UNKNOWNS,
    Fix,
    Transmission,
    fixed_position_m,
    position_fix,
    static_range_rate,
    transmission,
    velocity_fix,
)
from vestige.navigation.raim import redundancy
from vestige.records.snapshot_block import E1Block
from vestige.records.times import GalileoTimes
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class FixSettings:
    """Orbits, and the receiver's assumptions about its observations."""

    ephemerides: tuple[Ephemeris, ...] = ()  # broadcast orbits and clocks of any satellites
    authenticated: frozenset[int] | None = None  # satellites with authenticated ephemerides; None for all satellites
    errors: PseudorangeErrors = field(default_factory=PseudorangeErrors)  # standard deviations of the observations
    fit_interval_s: float = FIT_INTERVAL_S  # longest time in s between the reference time of an ephemeris and its use
    near: ApproximatePosition | None = None  # approximate position of the receiver; None if unknown

    def why_no_fix(self, time: GalileoTime) -> str | None:
        """Return why ephemerides are too few for a fix at a time; None if they are enough, or if none are given."""
        return why_no_orbits(self.ephemerides, time, UNKNOWNS) if self.ephemerides else None

    def transmission(
        self, time: GalileoTimes, svids: tuple[int, ...], pseudorange_m: Float[np.ndarray, "n m"]
    ) -> Transmission:
        """Return positions and clocks of the satellites at transmission; NaN without a pseudorange or an orbit."""
        n, m = pseudorange_m.shape
        position, velocity = np.full((2, n, m, 3), np.nan)
        clock_m, clock_mps = np.full((2, n, m), np.nan)
        anchor = self.ephemerides[0].toe
        elapsed_s = time.since(anchor)
        for column, svid in enumerate(svids):
            own = tuple(one for one in self.ephemerides if one.svid == svid)
            for ephemeris, rows in _chosen(own, time, self.fit_interval_s):
                sent = transmission([ephemeris], anchor, elapsed_s[rows], pseudorange_m[rows, column][:, None])
                position[rows, column], velocity[rows, column] = sent.position_m[:, 0], sent.velocity_mps[:, 0]
                clock_m[rows, column], clock_mps[rows, column] = sent.clock_m[:, 0], sent.clock_mps[:, 0]
        return Transmission(position_m=position, velocity_mps=velocity, clock_m=clock_m, clock_mps=clock_mps)

    def measure(self, time: GalileoTimes, svids: tuple[int, ...], e1: E1Block) -> FixBlock | None:
        """Return the position fix of every epoch; None if no orbits are known."""
        if not self.ephemerides:
            return None
        sent = self.transmission(time, svids, e1.pseudorange_m)
        unknown = np.full(e1.pseudorange_m.shape, np.nan)
        elevation_rad = unknown
        if self.errors.needs_elevation:
            plain = PseudorangeErrors(floor_m=max(self.errors.floor_m, 1.0), loops=self.errors.loops)
            first_m = fixed_position_m(sent, e1.pseudorange_m, plain.range_m(e1.cn0_dbhz, unknown))
            elevation_rad = elevations_from(first_m, sent.position_m)
        sigma_m = self.errors.range_m(e1.cn0_dbhz, elevation_rad)
        common_m = self.errors.common_m(elevation_rad)
        fix = position_fix(sent, e1.pseudorange_m, sigma_m, common_m=common_m)
        return FixBlock(
            sigma_m=sigma_m,
            common_m=common_m,
            bounded=self.errors.is_bound,
            **fix_quantities(
                sent,
                fix,
                rate_mps=-SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ * e1.doppler_hz,
                sigma_rate_mps=self.errors.rate_sigma_mps(e1.cn0_dbhz),
            ),
        )


def fix_quantities(
    sent: Transmission, fix: Fix, *, rate_mps: Float[np.ndarray, "n m"], sigma_rate_mps: Float[np.ndarray, "n m"]
) -> dict[str, Any]:
    """Return the fields of a `FixBlock` that follow from a fix, by name of the field."""
    parts = redundancy(fix.geometry, fix.weight)
    _, drift_mps = velocity_fix(sent, fix, rate_mps)
    separation_sigmas, separation_modes = largest_separations(fix)
    return {
        "fix": fix,
        "sent": sent,
        "range_rate_mps": rate_mps,
        "static_range_rate_mps": static_range_rate(sent, fix),
        "sigma_rate_mps": sigma_rate_mps,
        "drift_mps": drift_mps,
        "sigma_drift_mps": np.sqrt(_drift_variance(fix, parts.gain[:, 3], sigma_rate_mps)),
        "own_sigma_clock_m": np.sqrt(parts.inverse[:, 3, 3]),
        "raim_statistic": raim_statistic(fix),
        "separation_sigmas": separation_sigmas,
        "separation_modes": separation_modes,
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class LazyFix:
    """Position fixes of a block, computed at their first use."""

    # arguments of `FixSettings.measure`
    settings: FixSettings
    time: GalileoTimes
    svids: tuple[int, ...]
    e1: E1Block

    @cached_property
    def block(self) -> FixBlock | None:
        """Position fix of each epoch; None if no orbits are known."""
        return self.settings.measure(self.time, self.svids, self.e1)


def elevations_from(
    position_m: Float[np.ndarray, "n 3"], satellite_m: Float[np.ndarray, "n m 3"]
) -> Float[np.ndarray, "n m"]:
    """Return the elevation of satellites in rad, seen from ECEF positions; NaN where a position is unknown.

    The rotation of the Earth during the travel time, below 10 µrad, is neglected.
    """
    known = np.isfinite(position_m[:, :1])
    axes = local_axes_at(np.where(known, position_m, [[6_378_137.0, 0.0, 0.0]]))
    towards = satellite_m - position_m[:, None]
    up = np.einsum("nj,nmj->nm", axes[:, 2], towards)
    return np.arcsin(up / np.sqrt(np.einsum("nmj,nmj->nm", towards, towards)))


def _chosen(
    own: tuple[Ephemeris, ...], time: GalileoTimes, fit_interval_s: float
) -> list[tuple[Ephemeris, np.ndarray]]:
    """Return each used ephemeris with its rows: an epoch uses the nearest ephemeris, if within `fit_interval_s`."""
    if not own:
        return []
    age_s = np.abs(np.stack([time.since(one.toe) for one in own]))
    # If two ephemerides are equally near, the ephemeris that comes later in `own` is used.
    best = age_s.shape[0] - 1 - np.argmin(age_s[::-1], axis=0)
    usable = np.min(age_s, axis=0) <= fit_interval_s
    rows = [np.flatnonzero(usable & (best == place)) for place in range(len(own))]
    return [(ephemeris, some) for ephemeris, some in zip(own, rows, strict=True) if some.size]


def _drift_variance(
    fix: Fix, share: Float[np.ndarray, "n m"], sigma_mps: Float[np.ndarray, "n m"]
) -> Float[np.ndarray, " n"]:
    """Return the variance of the clock drift that follows from the variance of the range rates; NaN without a fix."""
    return np.sum(np.where(fix.weight > 0, share * sigma_mps, 0.0) ** 2, axis=1) + 0 * fix.clock_m
