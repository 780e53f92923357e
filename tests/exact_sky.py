"""Exact E1 observations of a Walker sky as a block, for tests of the fix and of inertial bridging."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.receiver.sky.trajectory import Trajectory
from vestige.records.snapshot_block import E1Block, SnapshotBlock, VelocityIncrements
from vestige.records.times import GalileoTimes
from vestige.time import GalileoTime
from whole_sky import sky

START = GalileoTime(1372, 604_790)  # the week ends within the first interval
ORBITS = tuple(walker_ephemerides(GalileoTime(1372, 604_190)))
CLOCK_M = 1000.0


def exact_block(
    trajectory: Trajectory,
    elapsed_s: np.ndarray,
    *,
    late_m: Sequence[Mapping[int, float]] | None = None,
    pull_mps: Sequence[Mapping[int, float]] | None = None,
    drift_mps: float = 0.0,
    increments: VelocityIncrements | None = None,
) -> SnapshotBlock:
    """Return exact observations of every satellite above 10°, some late or with a rate that is pulled.

    Parameters
    ----------
    trajectory
        Of the receiver.
    elapsed_s
        Epochs after `START`.
    late_m, pull_mps
        By epoch, what is added to pseudoranges and their rates by SVID.
    drift_mps
        Of the receiver clock, which is `CLOCK_M` ahead at first.
    increments
        Of inertial sensors.
    """
    clock_m = CLOCK_M + drift_mps * elapsed_s
    at_s = elapsed_s - clock_m / SPEED_OF_LIGHT_MPS
    view = sky(ORBITS, START, at_s, trajectory.motion(at_s), mask_deg=10.0)

    def added(by_epoch: Sequence[Mapping[int, float]] | None) -> np.ndarray:
        rows = by_epoch or [{}] * elapsed_s.size
        return np.array([[row.get(svid, 0.0) for svid in view.svids] for row in rows])

    range_m = view.range_m + clock_m[:, None] - view.satellite_clock_m + added(late_m)
    rate_mps = view.rate_mps + drift_mps - view.satellite_clock_mps + added(pull_mps)
    seen = view.in_view
    unknown = np.full(range_m.shape, np.nan)
    times = GalileoTimes.after(START, elapsed_s)
    received = GalileoTimes(*(np.repeat(one[:, None], seen.shape[1], axis=1) for one in (times.second, times.fraction)))
    return SnapshotBlock(
        index=np.arange(elapsed_s.size),
        time=times,
        received_at=received,
        time_uncertainty_s=np.ones(elapsed_s.size),
        svids=tuple(view.svids),
        asked=np.ones(seen.shape, bool),
        recs=np.ones(elapsed_s.size, bool),
        e1=E1Block(
            pseudorange_m=np.where(seen, range_m, np.nan),
            carrier_phase_cycles=unknown,
            doppler_hz=np.where(seen, -rate_mps * E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS, np.nan),
            doppler_rate_hz_per_s=unknown,
            cn0_dbhz=np.where(seen, 45.0, np.nan),
        ),
        increments=increments,
    )


def geometry_of_sky(
    azimuth_rad: Float[np.ndarray, "n m"], elevation_rad: Float[np.ndarray, "n m"]
) -> Float[np.ndarray, "n m 4"]:
    """Return H in local axes (east, north, up, clock) from directions to the satellites; NaN makes a row of zeros."""
    flat = np.cos(elevation_rad)
    rows = np.stack(
        (
            -flat * np.sin(azimuth_rad),
            -flat * np.cos(azimuth_rad),
            -np.sin(elevation_rad),
            np.ones_like(flat),
        ),
        axis=-1,
    )
    return np.where(np.isfinite(flat)[..., None], rows, 0.0)
