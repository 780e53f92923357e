"""Compute the position of a snapshot from the ranges in use, with its standard deviations and its latency.

`range_in_use.py` chooses the ranges in use.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.navigation.earth import geodetic_from_ecef, local_axes_at
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class AuthenticPosition:
    """Position of the receiver at the time of a snapshot, from ranges in use, with its standard deviations."""

    index: int
    time: GalileoTime  # time of the snapshot
    available_at: GalileoTime  # time at which the last key that the position needs is complete
    # geodetic coordinates; the height is above the ellipsoid
    latitude_deg: float
    longitude_deg: float
    height_m: float
    # standard deviations of the position in m, from the covariance of the fix
    horizontal_sigma_m: float
    vertical_sigma_m: float
    svids: tuple[int, ...]  # satellites whose ranges are used
    earlier: tuple[int, ...]  # used satellites whose range belongs to the earliest of several signals
    # whether OSNMA or a statement of the user authenticates the ephemerides of all used satellites
    orbits_authenticated: bool

    @property
    def latency_s(self) -> float:
        """Time from the snapshot until its position is known, in s."""
        return self.available_at - self.time


def authentic_positions(block: VerdictBlock) -> Iterator[AuthenticPosition]:
    """Yield the position of each epoch of a block that has a position from ranges in use."""
    found, snapshots = block.position, block.measured.snapshots
    if found is None:
        return
    for epoch in np.flatnonzero(np.isfinite(found.position_m[:, 0])).tolist():
        one = found.position_m[epoch : epoch + 1]
        latitude, longitude, height = geodetic_from_ecef(one)
        axes = local_axes_at(one)[0]
        variance_m2 = np.diagonal(axes @ found.covariance_m2[epoch] @ axes.T)
        used = np.flatnonzero(found.used[epoch]).tolist()
        complete = block.measured.recs.complete
        yield AuthenticPosition(
            index=int(snapshots.index[epoch]),
            time=snapshots.time.at(epoch),
            available_at=max(complete.at(epoch, column) for column in used),
            latitude_deg=float(np.degrees(latitude[0])),
            longitude_deg=float(np.degrees(longitude[0])),
            height_m=float(height[0]),
            horizontal_sigma_m=float(np.sqrt(variance_m2[0] + variance_m2[1])),
            vertical_sigma_m=float(np.sqrt(variance_m2[2])),
            svids=tuple(snapshots.svids[column] for column in used),
            earlier=tuple(snapshots.svids[column] for column in used if block.earlier[epoch, column]),
            orbits_authenticated=bool(found.orbits_authenticated[epoch]),
        )
