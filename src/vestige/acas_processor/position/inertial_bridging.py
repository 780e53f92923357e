"""Inertial bridging from one RECS to the next: changes of range rates, and increments of the receiver's velocity.

Each epoch with RECS and a position stores three quantities of its satellites: the measured range rates, the range rates
for a receiver and a clock at rest, and the directions to the satellites. The next epoch compares
(`checks/inertial.py`). An epoch without a position stores nothing, so the next epoch cannot compare.

Velocity increments are in local axes, which rotate with the position: by 1.2 mrad over 7.5 km, 30 s of an aircraft.
Each increment is rotated into ECEF at its position on the path between the two fixes. The path follows from the
positions at both ends and the increments. It is computed twice: as a straight line, then with the increments. The path
also gives the velocities at both ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.measurement import Fixes
from vestige.acas_processor.monitoring.memory import RateMemory, SatelliteRate
from vestige.navigation.earth import local_axes_at
from vestige.records.snapshot_block import SnapshotBlock


def gained_towards_mps(
    before: Float[np.ndarray, "*n m 3"],
    now: Float[np.ndarray, "*n m 3"],
    delta_velocity_mps: Float[np.ndarray, "*n 3"],
    mean_mps: Float[np.ndarray, "*n 3"],
) -> Float[np.ndarray, "*n m"]:
    """Return the velocity increment towards satellites, Δ(e·v) = ē·Δv + Δe·v̄, with the rotation of the line of sight.

    `before` and `now` are unit vectors e to the satellites, and `delta_velocity_mps` is Δv = ∫ a dt. `mean_mps` is the
    mean of the receiver's velocities at both ends. All vectors have the same axes.
    """
    own = np.einsum("...mi,...i->...m", (before + now) / 2, delta_velocity_mps)
    return own + np.einsum("...mi,...i->...m", now - before, mean_mps)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RateStep:
    """Change of the range rates from one RECS to the next; NaN for satellites that are not at both RECS."""

    interval_s: float
    # arguments of `InertialMonitor.statistic`
    rate_change_mps: Float[np.ndarray, " m"]
    static_change_mps: Float[np.ndarray, " m"]
    delta_velocity_mps: Float[np.ndarray, " m"]
    sigma_change_mps: Float[np.ndarray, " m"]  # standard deviation of the measured change


Steps = tuple[tuple[int, RateStep | str], ...]


def rate_steps(evidence: Evidence) -> Steps:
    """Return each row with a RECS and its rate step, or the reason why rates cannot be compared.

    Nothing is returned without inertial sensors. The steps of a run that begins with the block are kept, because the
    other levels judge the same block.
    """
    snapshots, fixes = evidence.measured.snapshots, evidence.measured.fixes
    if fixes is None or evidence.rates is not None:
        return tuple(_steps(evidence))
    of, steps = _KEPT.get(fixes, (None, ()))
    if of is not snapshots:
        steps = tuple(_steps(evidence))
        _KEPT[fixes] = snapshots, steps
    return steps


_KEPT: WeakKeyDictionary[Fixes, tuple[SnapshotBlock, Steps]] = WeakKeyDictionary()


def _steps(evidence: Evidence) -> Iterator[tuple[int, RateStep | str]]:
    for epoch, before, now in _pairs(evidence):
        if now is None:
            yield epoch, "no position fix"
        elif before is None:
            yield epoch, "no snapshot with a position fix before"
        elif not now.time - before.time > 0:
            yield epoch, "the snapshot before is of the same time"
        elif not before.covered:
            yield epoch, f"the accelerations do not cover the time since {before.time}"
        else:
            yield epoch, _step(before, now, evidence.measured.snapshots.svids)


def remembered_rates(evidence: Evidence) -> RateMemory | None:
    """Return the memory for the next block."""
    snapshots = evidence.measured.snapshots
    after = int(np.max(np.flatnonzero(snapshots.recs), initial=-1)) + 1
    last = _left_behind(evidence, after - 1) if after and snapshots.increments is not None else evidence.rates
    return _with_increments(evidence, last, after, evidence.shape[0])


def _pairs(evidence: Evidence) -> Iterator[tuple[int, RateMemory | None, RateMemory | None]]:
    """Yield each epoch with RECS, the memory before it with all increments since, and the memory after it."""
    if evidence.measured.snapshots.increments is None:
        return
    before, after = evidence.rates, 0
    for epoch in np.flatnonzero(evidence.measured.snapshots.recs).tolist():
        now = _left_behind(evidence, epoch)
        yield epoch, _with_increments(evidence, before, after, epoch + 1), now
        before, after = now, epoch + 1


def _with_increments(evidence: Evidence, left: RateMemory | None, first: int, last: int) -> RateMemory | None:
    """Return the memory of an epoch with the increments of the rows from `first` to before `last` added."""
    increments = evidence.measured.snapshots.increments
    if left is None or increments is None:
        return None
    here = np.flatnonzero((increments.epoch >= first) & (increments.epoch < last)).tolist()
    more = tuple((increments.time.at(k), tuple(increments.delta_velocity_mps[k].tolist())) for k in here)
    covered = left.covered and bool(np.all(increments.covered[first:last]))
    return replace(left, increments=(*left.increments, *more), covered=covered)


def _left_behind(evidence: Evidence, epoch: int) -> RateMemory | None:
    """Return the memory of an epoch; None without a position."""
    found, snapshots = evidence.measured.fix, evidence.measured.snapshots
    if found is None or not found.fix.valid[epoch]:
        return None
    x, y, z = found.fix.position_m[epoch].tolist()
    satellites = {}
    for column, svid in enumerate(snapshots.svids):
        here = (epoch, column)
        rate, static = float(found.range_rate_mps[here]), float(found.static_range_rate_mps[here])
        if np.isfinite(rate) and np.isfinite(static):
            e_x, e_y, e_z = (-found.fix.geometry[epoch, column, :3]).tolist()
            sigma = float(found.sigma_rate_mps[here])
            satellites[svid] = SatelliteRate(rate_mps=rate, static_mps=static, sigma_mps=sigma, towards=(e_x, e_y, e_z))
    return RateMemory(time=snapshots.time.at(epoch), position_m=(x, y, z), satellites=satellites)


def _step(before: RateMemory, now: RateMemory, svids: tuple[int, ...]) -> RateStep:
    interval_s = now.time - before.time
    places = np.array([before.position_m, now.position_m])
    ends_s = np.array([time - before.time for time, _ in before.increments])
    sensed = np.array([increment for _, increment in before.increments]).reshape(-1, 3)
    path = _bent(places, ends_s, interval_s, np.zeros((ends_s.size, 3)))
    for _ in range(2):  # first along a straight line, then along the path from the increments
        gained = np.einsum("nij,ni->nj", local_axes_at(path.middles_m), sensed)
        path = _bent(places, ends_s, interval_s, gained)
    m = len(svids)
    rate, static, sigma = np.full((3, m), np.nan)
    towards = np.full((2, m, 3), np.nan)
    for column, svid in enumerate(svids):
        if svid in before.satellites and svid in now.satellites:
            old, new = before.satellites[svid], now.satellites[svid]
            rate[column], static[column] = new.rate_mps - old.rate_mps, new.static_mps - old.static_mps
            sigma[column] = np.hypot(old.sigma_mps, new.sigma_mps)
            towards[0, column], towards[1, column] = old.towards, new.towards
    return RateStep(
        interval_s=interval_s,
        rate_change_mps=rate,
        static_change_mps=static,
        delta_velocity_mps=gained_towards_mps(towards[0], towards[1], np.sum(gained, axis=0), path.mean_of_ends_mps),
        sigma_change_mps=sigma,
    )


class _Path(NamedTuple):
    """Positions in the middle of each of k increments, and the mean of the velocities at both ends."""

    middles_m: Float[np.ndarray, "k 3"]
    mean_of_ends_mps: Float[np.ndarray, " 3"]


def _bent(
    places: Float[np.ndarray, "2 3"],
    ends_s: Float[np.ndarray, " k"],
    interval_s: float,
    gained: Float[np.ndarray, "k 3"],
) -> _Path:
    """Return the path between two positions for given velocity increments, each uniform in its step.

    Positions and velocities are ECEF. `ends_s` are the ends of the steps, in s after the first position; the receiver
    reaches the second position at `interval_s`.
    """
    steps_s = np.diff(ends_s, prepend=0.0)[:, None]
    before = np.cumsum(gained, axis=0) - gained
    moved = steps_s * (before + gained / 2)  # without the part of the velocity at the beginning
    rest_s = interval_s - (float(ends_s[-1]) if ends_s.size else 0.0)
    total = np.sum(gained, axis=0)
    first = (places[1] - places[0] - np.sum(moved, axis=0) - rest_s * total) / interval_s
    so_far = np.cumsum(moved, axis=0) - moved + steps_s / 2 * (before + gained / 4)
    middles_s = (ends_s - steps_s[:, 0] / 2)[:, None]
    return _Path(places[0] + middles_s * first + so_far, first + total / 2)
