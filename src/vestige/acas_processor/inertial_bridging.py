"""Inertial bridging over snapshots: what the range rates did since the snapshot before, against the accelerometers.

Each snapshot leaves behind the range rates of its satellites, what they would be if the receiver stood where its fix
puts it, and the directions to them. The next one compares (`monitors/inertial.py`). A snapshot without a position
leaves nothing behind, so the one after it has nothing to compare with.

What is sensed is in local axes, which turn with the place: over 7.5 km, 30 s of an aircraft, by 1.2 mrad. It is turned
into ECEF sample by sample, along the straight line between the two fixes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.fix_checks import SnapshotFix
from vestige.acas_processor.monitors.inertial import InertialMonitor, gained_towards_mps
from vestige.acas_processor.monitors.judgement import not_run
from vestige.navigation.earth import local_axes_at
from vestige.navigation.position_fix import standing_range_rate
from vestige.records import CheckResult
from vestige.time import GalileoTime
from vestige.valid_numbers import require_finite

LONGEST_STEP_S = 1.5  # between two samples; what a receiver does in a longer one, a straight line does not tell

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Accelerations:
    """What inertial sensors say of the antenna: its kinematic acceleration against the Earth.

    Attributes
    ----------
    start, elapsed_s
        Ascending times of the samples, `start` + `elapsed_s` on the receiver's clock.
    acceleration_mps2
        East, north, up where the receiver is at that time; gravity is taken off.
    """

    start: GalileoTime
    elapsed_s: Float[np.ndarray, " n"]
    acceleration_mps2: Float[np.ndarray, "n 3"]

    def __post_init__(self) -> None:
        for name, values in (("elapsed_s", self.elapsed_s), ("acceleration_mps2", self.acceleration_mps2)):
            require_finite("accelerations", **{name: float(np.abs(values).sum())})

    def gained_mps(
        self,
        first: GalileoTime,
        last: GalileoTime,
        places_m: tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]],
    ) -> Float[np.ndarray, " 3"] | None:
        """Return ∫ a dt in ECEF, a linear between samples; None if they do not cover the time.

        Parameters
        ----------
        first, last
            Begin and end, the second later.
        places_m
            Where the receiver is then, ECEF.
        """
        begin, end = first - self.start, last - self.start
        low = int(np.searchsorted(self.elapsed_s, begin, side="right")) - 1
        high = int(np.searchsorted(self.elapsed_s, end)) + 1
        time_s = self.elapsed_s[max(low, 0) : high]
        if low < 0 or high > self.elapsed_s.size or np.max(np.diff(time_s)) > LONGEST_STEP_S:
            return None
        part = (time_s - begin)[:, None] / (end - begin)
        axes = local_axes_at(places_m[0] + part * (places_m[1] - places_m[0]))
        sensed = np.einsum("nij,ni->nj", axes, self.acceleration_mps2[low:high])
        knots = np.clip(time_s, begin, end)
        values = np.stack([np.interp(knots, time_s, axis) for axis in sensed.T], axis=1)
        return np.sum((values[1:] + values[:-1]) / 2 * np.diff(knots)[:, None], axis=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SatelliteRate:
    """One satellite of a snapshot.

    Attributes
    ----------
    rate_mps, standing_mps
        Rate of the pseudorange, and what it would be if receiver and receiver clock stood still.
    towards
        Unit vector to the satellite, ECEF.
    """

    rate_mps: float
    standing_mps: float
    towards: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class RateEpoch:
    """What a snapshot leaves behind for the next: its time, the place in ECEF, its satellites by SVID."""

    time: GalileoTime
    place_m: Vector
    satellites: Mapping[int, SatelliteRate]


@dataclass(frozen=True, slots=True, kw_only=True)
class InertialBridging:
    """The inertial check from snapshot to snapshot.

    Attributes
    ----------
    accelerations
        None without sensors.
    monitor
        The check; 100 ms of E1 samples at 30 dBHz tell a range rate to 0.07 m/s.
    """

    accelerations: Accelerations | None = None
    monitor: InertialMonitor = field(default_factory=lambda: InertialMonitor(sigma_rate_mps=0.1))

    def step(
        self, before: RateEpoch | None, solved: SnapshotFix | None, svids: Iterable[int], p_fa: float
    ) -> tuple[RateEpoch | None, dict[int, CheckResult]]:
        """Return what the next snapshot needs, and the check of each satellite.

        Parameters
        ----------
        before
            What this function returned for the snapshot before; None at first.
        solved, svids
            Fix and satellites of the snapshot.
        p_fa
            Budget of one satellite.
        """
        monitor = replace(self.monitor, p_fa=p_fa)
        if self.accelerations is None:
            return None, {svid: not_run(monitor, "no accelerations of inertial sensors") for svid in svids}
        now = None if solved is None or not solved.valid else _rates(solved)
        if now is None:
            why = "no position fix"
        elif before is None:
            why = "no snapshot with a position fix before"
        elif not now.time - before.time > 0:
            why = "the snapshot before is of the same time"
        else:
            found = _checks(monitor, self.accelerations, before, now)
            if found is not None:
                alone = not_run(monitor, "no range rate at both ends")
                return now, {svid: found.get(svid, alone) for svid in svids}
            why = f"the accelerations do not cover the time since {before.time}"
        return now, {svid: not_run(monitor, why) for svid in svids}


def _rates(solved: SnapshotFix) -> RateEpoch:
    standing = standing_range_rate(solved.sent, solved.fix)[0]
    x, y, z = solved.fix.position_m[0].tolist()
    satellites = {}
    for k, svid in enumerate(solved.svids):
        rate = float(solved.range_rate_mps[0, k])
        if np.isfinite(rate) and np.isfinite(standing[k]):
            e_x, e_y, e_z = (-solved.fix.geometry[0, k, :3]).tolist()
            satellites[svid] = SatelliteRate(rate_mps=rate, standing_mps=float(standing[k]), towards=(e_x, e_y, e_z))
    return RateEpoch(time=solved.time, place_m=(x, y, z), satellites=satellites)


def _checks(
    monitor: InertialMonitor, accelerations: Accelerations, before: RateEpoch, now: RateEpoch
) -> dict[int, CheckResult] | None:
    """Return the checks of the satellites of both snapshots, None if the accelerations do not cover the time."""
    places = (np.array(before.place_m), np.array(now.place_m))
    gained = accelerations.gained_mps(before.time, now.time, places)
    if gained is None:
        return None
    interval_s = now.time - before.time
    both = sorted(before.satellites.keys() & now.satellites.keys())
    old, new = ([epoch.satellites[svid] for svid in both] for epoch in (before, now))
    begin, end = (np.array([one.towards for one in ends]).reshape(-1, 3) for ends in (old, new))
    own = gained_towards_mps(begin, end, gained, (places[1] - places[0]) / interval_s)
    return {
        svid: monitor.check(b.rate_mps - a.rate_mps, b.standing_mps - a.standing_mps, float(towards), interval_s)
        for svid, a, b, towards in zip(both, old, new, own, strict=True)
    }
