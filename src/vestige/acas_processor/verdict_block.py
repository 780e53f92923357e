"""Define the verdicts on n epochs and m satellites, with states, checks, ranges in use and positions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int8, Int64

from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.levels import MINIMUM, OTHERS, CheckSpec
from vestige.acas_processor.measurement import Availability, FixBlock, MeasurementBlock, spread_over_block
from vestige.acas_processor.monitoring.alarm import AlarmState, StateChange, state_changes
from vestige.acas_processor.position.possible_range import REASONS
from vestige.acas_processor.searches.searches import SearchResults
from vestige.records import Status, Verdict
from vestige.records.checks import CheckName, CheckSeries

STATUSES = tuple(Status)
_NO_KEY = (Availability.NOT_SEEN, Availability.NO_RECS, Availability.NO_KEY, Availability.NOT_PROVEN)
_NOTHING = np.zeros((0, 0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PositionBlock:
    """Positions of n epochs from ranges in use."""

    rows: Int64[np.ndarray, " k"]  # epochs with enough ranges in use
    fixes: FixBlock  # position fix of each epoch in `rows`
    used: Bool[np.ndarray, "n m"]  # satellites whose range is used in the position
    orbits_authenticated: Bool[np.ndarray, " n"]  # whether the ephemerides of all used satellites are authenticated

    @property
    def position_m(self) -> Float[np.ndarray, "n 3"]:
        """ECEF positions; NaN where there is no position."""
        position_m = np.where(self.fixes.fix.valid[:, None], self.fixes.fix.position_m, np.nan)
        return spread_over_block(position_m, self.rows, self.used.shape[:1])

    @property
    def covariance_m2(self) -> Float[np.ndarray, "n 3 3"]:
        """Covariances of the positions in m²; NaN where there is no position."""
        return spread_over_block(self.fixes.fix.covariance_m2[:, :3, :3], self.rows, self.used.shape[:1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VerdictBlock:
    """Verdicts on n epochs and m satellites at one mitigation level, with the checks that led to them."""

    measured: MeasurementBlock  # measurements from which the verdicts follow
    level: int  # mitigation level
    specs: tuple[CheckSpec, ...]  # checks of the level
    status: Int8[np.ndarray, "n m"]  # verdict of each satellite at each epoch, as index in `Status`
    cause: Int8[np.ndarray, "n m"]  # index in `specs` of the check that caused the verdict (`combine`)
    state: Int8[np.ndarray, "n m"]  # state that a receiver shows its user after each epoch
    before: AlarmState  # state before the block
    due: Bool[np.ndarray, "n m"]  # epochs and satellites that need a verdict
    checks: Mapping[CheckName | str, CheckSeries]  # all checks of the level that could be made
    failed: Mapping[CheckName | str, Bool[np.ndarray, "*n"]]  # failures of the checks after confirmation
    e1_search: SearchResults  # results of the E1 vestigial search
    exhaustive_search: SearchResults  # results of the exhaustive search
    searched: Bool[np.ndarray, " n"]  # epochs in which the exhaustive search was made
    evidence: Evidence  # input of the checks
    # offset of the true signal from the E1 prediction (`Verdict.true_offset_m`)
    true_offset_m: Float[np.ndarray, "n m"] = field(default_factory=lambda: _NOTHING)
    # pseudorange in use; NaN if no range is in use
    range_in_use_m: Float[np.ndarray, "n m"] = field(default_factory=lambda: _NOTHING)
    # whether the range in use is the range of the earliest of several signals, not the E1 range
    earlier: Bool[np.ndarray, "n m"] = field(default_factory=lambda: _NOTHING.astype(np.bool_))
    # reason why a range is impossible, as an index of `possible_range.REASONS`; 0 if the range is possible
    impossible: Int8[np.ndarray, "n m"] = field(default_factory=lambda: _NOTHING.astype(np.int8))
    position: PositionBlock | None = None  # position of each epoch; None if no orbits are known

    @property
    def found_twice(self) -> Bool[np.ndarray, "n m"]:
        """Epochs and satellites for which a search found more than one signal."""
        return self.e1_search.twice | self.exhaustive_search.twice

    def verdicts(self) -> Iterator[Verdict]:
        """Yield the verdicts of all epochs and satellites that need a verdict, in order of epoch and SVID."""
        for epoch, satellite in zip(*(axis.tolist() for axis in np.nonzero(self.due)), strict=True):
            yield self.verdict(epoch, satellite)

    def verdict(self, epoch: int, satellite: int) -> Verdict:
        """Return the verdict of one satellite at one epoch, with its checks and its reason."""
        here, snapshots = (epoch, satellite), self.measured.snapshots
        with_key = Availability(int(self.measured.availability[here])) not in _NO_KEY
        return Verdict(
            index=int(snapshots.index[epoch]),
            time=snapshots.time.at(epoch),
            available_at=self.measured.recs.complete.at(*here) if with_key else None,
            svid=snapshots.svids[satellite],
            level=self.level,
            status=STATUSES[self.status[here]],
            checks=tuple(series.result(epoch, satellite) for series in self.checks.values()),
            range_offset_m=float(self.measured.detected.range_offset_m[here]),
            reason=self.reason(epoch, satellite),
            true_offset_m=float(self.true_offset_m[here]),
        )

    def reason(self, epoch: int, satellite: int) -> str:
        """Return the reason for a satellite's status at an epoch, and why an impossible range is not used."""
        why = self._why(epoch, satellite)
        impossible = int(self.impossible[epoch, satellite]) if self.impossible.size else 0
        return f"{why}; its range is not used: {REASONS[impossible]}" if impossible else why

    def _why(self, epoch: int, satellite: int) -> str:
        here, cause = (epoch, satellite), int(self.cause[epoch, satellite])
        if STATUSES[self.status[here]] is Status.NOT_AVAILABLE:
            return self._why_not_available(epoch, satellite)
        if cause >= 0:
            return self.checks[self.specs[cause].name].explain(epoch, satellite)
        if cause == OTHERS:
            twice = np.flatnonzero(self.found_twice[epoch]).tolist()
            names = " ".join(f"E{self.measured.snapshots.svids[column]:02d}" for column in twice)
            return f"{names}: more than one signal"
        missing = [name for name, one in self.checks.items() if not one.run[one.place(*here)]]
        if missing:
            return f"all checks that could be run passed; not run: {', '.join(missing)}"
        return "all checks passed"

    def _why_not_available(self, epoch: int, satellite: int) -> str:
        why = self.measured.why_unavailable(epoch, satellite)
        if why:
            return why
        return next((text for name in MINIMUM if (text := self.checks[name].explain(epoch, satellite))), "")

    def changes(self) -> Iterator[StateChange]:
        """Yield the changes of the states of satellites, in order of time."""
        snapshots = self.measured.snapshots
        for epoch, column, before, after in state_changes(snapshots.svids, self.state, self.before):
            same = STATUSES[self.status[epoch, column]] is after
            yield StateChange(
                time=snapshots.time.at(epoch),
                svid=snapshots.svids[column],
                before=before,
                after=after,
                reason=self.reason(epoch, column) if same else "",
            )
