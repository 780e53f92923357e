"""The position that a snapshot authenticates: the fix of the ranges that may be used, and when it is known.

A range may be used if its RECS was AUTHENTIC and so is the state that is shown of the satellite: that of E1. Where a
search found several signals of a satellite, the earliest is the true one [WFO, Sec. III-D] and is used in the place of
E1's, whatever the verdict. With fewer than four there is no position.

The fix takes pseudoranges and broadcast orbits as they are: delays of ionosphere and troposphere stay in, mostly in
height and clock, and the standard deviations are what `FixChecks` believes of a pseudorange.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vestige.acas_processor.fix_checks import FixChecks
from vestige.navigation.earth import geodetic_from_ecef, local_axes_at
from vestige.navigation.ephemeris import nearest_ephemerides
from vestige.navigation.position_fix import UNKNOWNS, position_fix, transmission
from vestige.records import E1Observation, Status, Verdict
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class AuthenticPosition:
    """Where the receiver was at the time of a snapshot.

    Attributes
    ----------
    time, available_at
        Of the snapshot, and when the last key that it needs was complete.
    latitude_deg, longitude_deg, height_m
        Geodetic, height over the ellipsoid.
    horizontal_sigma_m, vertical_sigma_m
        What is believed of it, 1σ.
    svids, earlier
        Satellites whose ranges are used, and those of them with the earliest of several signals.
    """

    time: GalileoTime
    available_at: GalileoTime
    latitude_deg: float
    longitude_deg: float
    height_m: float
    horizontal_sigma_m: float
    vertical_sigma_m: float
    svids: tuple[int, ...]
    earlier: tuple[int, ...]

    @property
    def latency_s(self) -> float:
        """From the snapshot until its position is known, in s."""
        return self.available_at - self.time


def authentic_position(
    fix: FixChecks,
    time: GalileoTime,
    observations: Mapping[int, E1Observation],
    verdicts: Sequence[Verdict],
    shown: Mapping[int, Status],
) -> AuthenticPosition | None:
    """Return the position of a snapshot, None if there is none.

    Parameters
    ----------
    fix
        Orbits, and what is believed of a pseudorange.
    time, observations
        Of the snapshot.
    verdicts, shown
        Of the snapshot, and the state of each satellite after it.
    """
    orbits = nearest_ephemerides(fix.ephemerides, time)
    range_m: dict[int, float] = {}
    earlier, known_at = [], []
    for verdict in verdicts:
        svid, authentic = verdict.svid, Status.AUTHENTIC
        if svid not in orbits or verdict.available_at is None:
            continue
        if np.isfinite(verdict.true_offset_m):
            range_m[svid] = observations[svid].pseudorange_m + verdict.true_offset_m
            earlier.append(svid)
        elif verdict.status is authentic and shown.get(svid) is authentic:
            range_m[svid] = observations[svid].pseudorange_m
        else:
            continue
        known_at.append(verdict.available_at)
    if len(range_m) < UNKNOWNS:
        return None
    measured_m = np.array([list(range_m.values())])
    sent = transmission([orbits[svid] for svid in range_m], time, np.zeros(1), measured_m)
    found = position_fix(sent, measured_m, np.full(measured_m.shape, fix.sigma_m))
    if not found.valid[0]:
        return None
    latitude, longitude, height = geodetic_from_ecef(found.position_m)
    axes = local_axes_at(found.position_m)[0]
    variance_m2 = np.diagonal(axes @ found.covariance_m2[0, :3, :3] @ axes.T)
    return AuthenticPosition(
        time=time,
        available_at=max(known_at),
        latitude_deg=float(np.degrees(latitude[0])),
        longitude_deg=float(np.degrees(longitude[0])),
        height_m=float(height[0]),
        horizontal_sigma_m=float(np.sqrt(variance_m2[0] + variance_m2[1])),
        vertical_sigma_m=float(np.sqrt(variance_m2[2])),
        svids=tuple(range_m),
        earlier=tuple(earlier),
    )
