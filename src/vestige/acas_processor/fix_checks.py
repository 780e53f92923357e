"""The position fix of a snapshot and what its checks say: clock drift, RAIM, solution separation [WFO, Sec. IV-B].

The fix takes all E1 pseudoranges of a snapshot and the broadcast orbits. What the receiver believes of a pseudorange
is one σ for all; the clock's drift comes from the Doppler.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.monitors.clock_drift import ClockDriftMonitor, ClockEpoch
from vestige.acas_processor.monitors.raim_check import RaimMonitor, SolutionSeparationMonitor
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.navigation.ephemeris import Ephemeris, nearest_ephemerides, why_no_orbits
from vestige.navigation.position_fix import (
    UNKNOWNS,
    Fix,
    Transmission,
    position_fix,
    transmission,
    velocity_fix,
)
from vestige.records import CheckResult, E1Observation
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class SnapshotFix:
    """The fix of a snapshot, and what it was made of: one epoch, its satellites along the second axis.

    Attributes
    ----------
    time, svids
        Of the snapshot, and the satellites with an orbit.
    sent
        The satellites at transmission.
    fix
        Of all of them.
    range_rate_mps
        Rates of the pseudoranges, from the Doppler.
    """

    time: GalileoTime
    svids: tuple[int, ...]
    sent: Transmission
    fix: Fix
    range_rate_mps: Float[np.ndarray, "1 m"]

    @property
    def valid(self) -> bool:
        """Whether there is a position."""
        return bool(self.fix.valid[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class FixChecks:
    """The checks of the fix, and the orbits that it needs.

    Attributes
    ----------
    ephemerides
        Broadcast orbits and clocks of any satellites; authenticated with OSNMA, if the fix is to be.
    sigma_m
        What the receiver believes of a pseudorange, 1σ.
    clock, raim, separation
        The checks.
    """

    ephemerides: tuple[Ephemeris, ...] = ()
    sigma_m: float = 5.0
    clock: ClockDriftMonitor = field(default_factory=lambda: ClockDriftMonitor(sigma_bias_m=5.0, sigma_drift_mps=0.1))
    raim: RaimMonitor = field(default_factory=RaimMonitor)
    separation: SolutionSeparationMonitor = field(default_factory=SolutionSeparationMonitor)

    def with_budget(self, p_fa: Mapping[str, float]) -> FixChecks:
        """Return the same with the false-alarm probabilities of a level, by name of the check."""
        return replace(
            self,
            clock=replace(self.clock, p_fa=3 * p_fa["clock innovation"]),
            raim=replace(self.raim, p_fa=p_fa["RAIM"]),
            separation=SolutionSeparationMonitor.of_budget(p_fa["solution separation"]),
        )

    def solve(self, time: GalileoTime, observations: Mapping[int, E1Observation]) -> SnapshotFix | None:
        """Return the fix of a snapshot, which need not be valid; None if there is no orbit of any of its satellites.

        Parameters
        ----------
        time, observations
            Of the snapshot.
        """
        orbits = nearest_ephemerides(self.ephemerides, time)
        seen = [observations[svid] for svid in sorted(observations) if svid in orbits]
        if not seen:
            return None
        range_m = np.array([[one.pseudorange_m for one in seen]])
        sent = transmission([orbits[one.svid] for one in seen], time, np.zeros(1), range_m)
        return SnapshotFix(
            time=time,
            svids=tuple(one.svid for one in seen),
            sent=sent,
            fix=position_fix(sent, range_m, np.full(range_m.shape, self.sigma_m)),
            range_rate_mps=np.array([[-SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ * one.doppler_hz for one in seen]]),
        )

    def why_no_fix(self, time: GalileoTime) -> str | None:
        """Return why no fix is possible at a time in spite of ephemerides; None if it is, or none are given."""
        return why_no_orbits(self.ephemerides, time, UNKNOWNS) if self.ephemerides else None

    def step(
        self, history: tuple[ClockEpoch, ...], solved: SnapshotFix | None
    ) -> tuple[tuple[ClockEpoch, ...], tuple[CheckResult, ...]]:
        """Return the clock's history with this snapshot, and the five checks.

        Parameters
        ----------
        history
            What this function returned before; `()` at first.
        solved
            What `solve` returned.
        """
        fix, svids = (None, ()) if solved is None else (solved.fix, solved.svids)
        epoch = None if solved is None or not solved.valid else _clock_epoch(solved)
        history, clock = self.clock.step(history, epoch)
        return history, (*clock, self.raim.check(fix, svids), self.separation.check(fix, svids))


def _clock_epoch(solved: SnapshotFix) -> ClockEpoch:
    drift_mps = float(velocity_fix(solved.sent, solved.fix, solved.range_rate_mps)[1][0])
    return ClockEpoch(time=solved.time, bias_m=float(solved.fix.clock_m[0]), drift_mps=drift_mps)
