"""Compute changes of range rates and of the receiver's velocity between two RECS, for inertial bridging.

At each epoch with RECS and a position, four quantities of each satellite are stored: the measured range rate and its
standard deviation, the range rate for a receiver at rest without clock drift, and the direction to the satellite. At
the next epoch with RECS, new quantities are compared with the stored quantities (`checks/inertial.py`). Without a
position nothing is stored, and no comparison is made at the next epoch with RECS.

Velocity increments are in local axes, which rotate with the position. If an aircraft flies 7.5 km in 30 s, its vertical
axis rotates by 1.2 mrad. Each increment is rotated into ECEF at its position on the path between the two fixes. The
path follows from the positions at both ends of the step and from the increments. The increments are rotated twice:
first along a straight line, then along the path that follows from the increments. The path also gives the mean of the
velocities at both ends of the step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int64

from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.monitoring.memory import RECEIVER, CheckMemory
from vestige.navigation.earth import local_axes_at
from vestige.records.times import GalileoTimes


def delta_velocity_towards_mps(
    before: Float[np.ndarray, "*n m 3"],
    now: Float[np.ndarray, "*n m 3"],
    delta_velocity_mps: Float[np.ndarray, "*n 3"],
    mean_mps: Float[np.ndarray, "*n 3"],
) -> Float[np.ndarray, "*n m"]:
    """Return the velocity increment towards satellites, Δ(e·v) = ē·Δv + Δe·v̄, with the rotation of the line of sight.

    `before` and `now` are unit vectors e to the satellites, with the mean ē and the difference Δe. `delta_velocity_mps`
    is Δv, the integral of the acceleration over the step. `mean_mps` is v̄, the mean of the receiver's velocities at
    the beginning and at the end of the step. All vectors have the same axes.
    """
    own = np.einsum("...mi,...i->...m", (before + now) / 2, delta_velocity_mps)
    return own + np.einsum("...mi,...i->...m", now - before, mean_mps)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RateSteps:
    """Changes of the range rates of m satellites over k steps, each from one RECS to the next."""

    epoch: Int64[np.ndarray, " k"]  # row in which each step ends
    interval_s: Float[np.ndarray, " k"]  # duration of each step in s
    # arguments of `InertialMonitor.statistic`; NaN for satellites without a range rate at one of the ends
    rate_change_mps: Float[np.ndarray, "k m"]
    static_change_mps: Float[np.ndarray, "k m"]
    delta_velocity_mps: Float[np.ndarray, "k m"]
    sigma_change_mps: Float[np.ndarray, "k m"]  # standard deviation of the measured change
    reasons: Mapping[int, str]  # reason why no step ends at a row with RECS, by the number of the row


def rate_steps(evidence: Evidence) -> RateSteps:
    """Return the changes of range rates over the steps that end in the block; no step without inertial sensors."""
    snapshots = evidence.measured.snapshots
    recs = np.flatnonzero(snapshots.recs) if snapshots.increments is not None else np.zeros(0, np.int64)
    ends, sensed = _ends(evidence, recs), _sensed(evidence, recs)
    interval_s = ends.time[1:] - ends.time[:-1]
    reasons = {
        int(recs[step]): reason
        for step in range(recs.size)
        if (reason := _why_no_step(ends, interval_s, sensed.covered, step))
    }
    steps = np.flatnonzero(~np.isin(recs, list(reasons)))
    both = (np.isfinite(ends.rate_mps[:-1]) & np.isfinite(ends.rate_mps[1:]))[steps]
    delta_velocity_mps = np.full((steps.size, len(snapshots.svids)), np.nan)
    for number in np.unique(sensed.number[steps]).tolist():
        alike = np.flatnonzero(sensed.number[steps] == number)  # steps with the same number of increments
        delta_velocity_mps[alike] = _gained(ends, sensed, interval_s, steps[alike])
    changes = {
        "rate_change_mps": ends.rate_mps[1:][steps] - ends.rate_mps[:-1][steps],
        "static_change_mps": ends.static_mps[1:][steps] - ends.static_mps[:-1][steps],
        "delta_velocity_mps": delta_velocity_mps,
        "sigma_change_mps": np.hypot(ends.sigma_mps[:-1][steps], ends.sigma_mps[1:][steps]),
    }
    return RateSteps(
        epoch=recs[steps],
        interval_s=interval_s[steps],
        reasons=reasons,
        **{name: np.where(both, change, np.nan) for name, change in changes.items()},
    )


def remembered_rates(evidence: Evidence) -> CheckMemory:
    """Return the memory for the next block; empty without inertial sensors, or without a position at the last RECS.

    The first numbers of the receiver are time (GST second and fraction), position (ECEF), and whether the increments
    since the last RECS have no gap. The numbers of each increment follow: the time of its end, and the velocity
    increment (east, north, up). The numbers of a satellite are the range rate, the range rate for a receiver at rest
    without clock drift, the σ of the range rate, and the unit vector to the satellite (ECEF).
    """
    snapshots = evidence.measured.snapshots
    after = int(np.max(np.flatnonzero(snapshots.recs), initial=-1)) + 1
    last = _left_behind(evidence, after - 1) if after and snapshots.increments is not None else evidence.memory
    return _with_increments(evidence, last, after, evidence.shape[0])


_OF_END, _OF_INCREMENT = 6, 5  # number of receiver values in the memory for a RECS, and for an increment


def _with_increments(evidence: Evidence, left: CheckMemory, first: int, last: int) -> CheckMemory:
    """Return the memory `left` with the increments of the rows from `first` to `last` − 1 added."""
    increments = evidence.measured.snapshots.increments
    if not left or increments is None:
        return {}
    here = (increments.epoch >= first) & (increments.epoch < last)
    time = increments.time[np.flatnonzero(here)]
    more = np.column_stack([time.second, time.fraction, increments.delta_velocity_mps[here]])
    *end, covered = left[RECEIVER][:_OF_END]
    covered = float(bool(covered) and bool(np.all(increments.covered[first:last])))
    return {**left, RECEIVER: (*end, covered, *left[RECEIVER][_OF_END:], *more.ravel().tolist())}


def _left_behind(evidence: Evidence, epoch: int) -> CheckMemory:
    """Return the numbers that an epoch stores in the memory; empty without a position."""
    found, snapshots = evidence.measured.fix, evidence.measured.snapshots
    if found is None or not found.fix.valid[epoch]:
        return {}
    time = snapshots.time.at(epoch)
    memory = {RECEIVER: (float(time.gst_seconds), time.fraction, *found.fix.position_m[epoch].tolist(), 1.0)}
    for column, svid in enumerate(snapshots.svids):
        here = (epoch, column)
        rate, static = float(found.range_rate_mps[here]), float(found.static_range_rate_mps[here])
        if np.isfinite(rate) and np.isfinite(static):
            towards = (-found.fix.geometry[epoch, column, :3]).tolist()
            memory[svid] = (rate, static, float(found.sigma_rate_mps[here]), *towards)
    return memory


class _Ends(NamedTuple):
    """Ends of all steps of a block: the last RECS before the block, from the memory, and all RECS of the block."""

    time: GalileoTimes
    valid: Bool[np.ndarray, " q"]  # whether there is a position at the end
    position_m: Float[np.ndarray, "q 3"]
    rate_mps: Float[np.ndarray, "q m"]  # measured range rates; NaN for satellites without a range rate
    static_mps: Float[np.ndarray, "q m"]
    sigma_mps: Float[np.ndarray, "q m"]
    towards: Float[np.ndarray, "q m 3"]


def _ends(evidence: Evidence, recs: Int64[np.ndarray, " k"]) -> _Ends:
    """Return the k + 1 ends of the k steps; without a RECS before the block, the first end has no position."""
    found, snapshots, left = evidence.measured.fix, evidence.measured.snapshots, evidence.memory
    q, m = recs.size + 1, len(snapshots.svids)
    valid = np.zeros(q, np.bool_)
    position_m = np.full((q, 3), np.nan)
    rate_mps, static_mps, sigma_mps = np.full((3, q, m), np.nan)
    towards = np.full((q, m, 3), np.nan)
    time = snapshots.time[np.append(0, recs)]
    if found is not None:
        valid[1:], position_m[1:] = found.fix.valid[recs], found.fix.position_m[recs]
        known = np.isfinite(found.range_rate_mps[recs]) & np.isfinite(found.static_range_rate_mps[recs])
        rate_mps[1:] = np.where(known, found.range_rate_mps[recs], np.nan)
        static_mps[1:], sigma_mps[1:] = found.static_range_rate_mps[recs], found.sigma_rate_mps[recs]
        towards[1:] = -found.fix.geometry[recs, :, :3]
    if left:
        second, fraction, *place = left[RECEIVER][: _OF_END - 1]
        time.second[0], time.fraction[0] = int(second), fraction
        valid[0], position_m[0] = True, place
        for column, svid in enumerate(snapshots.svids):
            if svid in left:
                rate_mps[0, column], static_mps[0, column], sigma_mps[0, column], *towards[0, column] = left[svid]
    return _Ends(time, valid, position_m, rate_mps, static_mps, sigma_mps, towards)


class _Sensed(NamedTuple):
    """Velocity increments since the last RECS before a block, and the step to which each increment belongs."""

    time: GalileoTimes
    delta_velocity_mps: Float[np.ndarray, "j 3"]
    step: Int64[np.ndarray, " j"]
    # fields with a value for each step
    number: Int64[np.ndarray, " k"]  # number of increments
    covered: Bool[np.ndarray, " k"]  # whether the increments leave no gap


def _sensed(evidence: Evidence, recs: Int64[np.ndarray, " k"]) -> _Sensed:
    increments, left = evidence.measured.snapshots.increments, evidence.memory
    if increments is None:
        return _Sensed(GalileoTimes.of(()), np.zeros((0, 3)), recs, recs, recs > 0)
    of_receiver = left.get(RECEIVER, ())
    before = np.array(of_receiver[_OF_END:]).reshape(-1, _OF_INCREMENT)
    step = np.append(np.zeros(len(before), np.int64), np.searchsorted(recs, increments.epoch))
    gaps = np.append(0, np.cumsum(~increments.covered))[np.append(0, recs + 1)]
    covered = np.diff(gaps) == 0
    covered[:1] &= not left or bool(of_receiver[_OF_END - 1])
    return _Sensed(
        time=GalileoTimes(
            np.append(before[:, 0].astype(np.int64), increments.time.second),
            np.append(before[:, 1], increments.time.fraction),
        ),
        delta_velocity_mps=np.concatenate([before[:, 2:], increments.delta_velocity_mps]),
        step=step,
        number=np.bincount(step, minlength=recs.size + 1)[: recs.size],
        covered=covered,
    )


def _why_no_step(
    ends: _Ends, interval_s: Float[np.ndarray, " k"], covered: Bool[np.ndarray, " k"], step: int
) -> str | None:
    """Return why rates cannot be compared over a step; None if they can be compared."""
    if not ends.valid[step + 1]:
        return "no position fix"
    if not ends.valid[step]:
        return "no earlier snapshot with a position fix"
    if not interval_s[step] > 0:
        return "the previous snapshot has the same time"
    if not covered[step]:
        return f"the accelerations do not cover the time since {ends.time.at(step)}"
    return None


def _gained(
    ends: _Ends, sensed: _Sensed, interval_s: Float[np.ndarray, " k"], steps: Int64[np.ndarray, " p"]
) -> Float[np.ndarray, "p m"]:
    """Return the velocity increments towards the satellites in steps that have equal numbers of increments."""
    here = np.stack([np.flatnonzero(sensed.step == step) for step in steps.tolist()])
    ends_s = sensed.time[here] - ends.time[steps[:, None]]
    places = np.stack([ends.position_m[steps], ends.position_m[steps + 1]], axis=1)
    local = sensed.delta_velocity_mps[here]
    path = _bent(places, ends_s, interval_s[steps], np.zeros(local.shape))
    for _ in range(2):  # the first path is a straight line, and the second path follows from the increments
        axes = local_axes_at(path.middles_m.reshape(-1, 3)).reshape(*local.shape, 3)
        gained = np.einsum("pkij,pki->pkj", axes, local)
        path = _bent(places, ends_s, interval_s[steps], gained)
    return delta_velocity_towards_mps(
        ends.towards[steps], ends.towards[steps + 1], np.sum(gained, axis=1), path.mean_of_ends_mps
    )


class _Path(NamedTuple):
    """Positions in the middle of k increments of p steps, and the mean of the velocities at both ends of each step."""

    middles_m: Float[np.ndarray, "p k 3"]
    mean_of_ends_mps: Float[np.ndarray, "p 3"]


def _bent(
    places: Float[np.ndarray, "p 2 3"],
    ends_s: Float[np.ndarray, "p k"],
    interval_s: Float[np.ndarray, " p"],
    gained: Float[np.ndarray, "p k 3"],
) -> _Path:
    """Return the path between two positions from velocity increments; acceleration is constant in each increment.

    Positions and velocities are ECEF. `ends_s` are the ends of the increments in s after the first position. The
    receiver reaches the second position `interval_s` after the first position.
    """
    steps_s = np.diff(ends_s, prepend=0.0)[..., None]
    before = np.cumsum(gained, axis=1) - gained
    moved = steps_s * (before + gained / 2)  # displacement by the increments, without the velocity at the beginning
    rest_s = interval_s - (ends_s[:, -1] if ends_s.shape[1] else 0.0)
    total = np.sum(gained, axis=1)
    first = (places[:, 1] - places[:, 0] - np.sum(moved, axis=1) - rest_s[:, None] * total) / interval_s[:, None]
    so_far = np.cumsum(moved, axis=1) - moved + steps_s / 2 * (before + gained / 4)
    middles_s = (ends_s - steps_s[..., 0] / 2)[..., None]
    return _Path(places[:, :1] + middles_s * first[:, None] + so_far, first + total / 2)
