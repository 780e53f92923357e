"""Compute the verdicts of measured blocks, and carry the receiver's state from block to block [WFO, Sec. IV].

Theory of operation
-------------------
`assess` computes the verdicts of a block of n epochs at once. The result has the same bits as the results of n blocks
of one epoch. Most checks use only the measurements of an epoch and of the epochs shortly before this epoch. Two
quantities depend on earlier verdicts. Reference levels are learned from epochs without an alarm. The searches cover the
possible clock error, which depends on the last epoch with AUTHENTIC satellites and without an alarm. The verdicts of a
block are therefore computed with a guess. The guess says for each epoch whether no satellite has an alarm, and how many
satellites are AUTHENTIC. Three steps find the right guess:

1. The first guess follows from the checks that do not depend on a guess.
2. Compute the verdicts of the block with the guess. The guess for an epoch affects only the verdicts of later epochs.
3. All verdicts up to and including the first wrongly guessed epoch are right. Take the verdicts as the next guess and
   repeat step 2, until the verdicts agree with the guess. The guess for the last epoch may be wrong, because no other
   epoch of the block depends on the last epoch.

Each repetition of step 2 makes the verdicts of at least one more epoch right. Few repetitions are needed, because
epochs with an alarm usually follow each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np
from jaxtyping import Bool, Float, Int64

from vestige.acas_processor.checks.check import CheckWithMemory, confirmed
from vestige.acas_processor.checks.osnma_subframes import subframes
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.levels import MINIMUM, POSITION, combine, is_alarm
from vestige.acas_processor.measurement import MeasurementBlock
from vestige.acas_processor.monitoring.baseline import Observed, Quantity, Reference
from vestige.acas_processor.monitoring.memory import CheckMemory, FixMemory
from vestige.acas_processor.monitoring.monitoring_settings import checks_of, shares_of
from vestige.acas_processor.monitoring.state import ReceiverState, SearchMemory
from vestige.acas_processor.position.clock_error import clock_error
from vestige.acas_processor.position.fix_measurement import elevations_from
from vestige.acas_processor.position.possible_range import known_positions
from vestige.acas_processor.position.range_in_use import ranges_in_use, ranges_near
from vestige.acas_processor.searches.block_searches import ProcessorSearches
from vestige.acas_processor.searches.searches import SearchResults, search_due
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.records import Assistance, Status
from vestige.records.checks import CheckName, CheckSeries
from vestige.records.recs_block import AssistanceData
from vestige.records.snapshot_block import SearchRequest
from vestige.records.time_uncertainty import FIXED_S, TimeUncertainty
from vestige.time import GalileoTime

if TYPE_CHECKING:
    from vestige.acas_processor.processor import AcasProcessor

FORGET_S = 3600.0  # time without tracking on E1 in s, after which a satellite counts as set and gets no verdict
# Largest clock error in s after an epoch without an alarm, with fewer than `POSITION_SATELLITES` AUTHENTIC satellites.
# This limit is larger than the differences of the travel times from all satellites to all receivers on Earth.
TRAVEL_TIME_SPREAD_S = 0.07
POSITION_SATELLITES = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Guess:
    """Assumption about each epoch: whether no satellite has an alarm, and the number of AUTHENTIC satellites."""

    quiet: Bool[np.ndarray, " n"]
    authentic: Int64[np.ndarray, " n"]

    def first_difference(self, other: _Guess) -> int:
        """Return the first epoch in which two guesses differ; the number of epochs if the guesses are equal."""
        differs = (self.quiet != other.quiet) | (self.authentic != other.authentic)
        return int(np.argmax(differs)) if differs.any() else differs.size


def assess(
    processor: AcasProcessor, state: ReceiverState | None, measured: MeasurementBlock, assistance: AssistanceData
) -> tuple[VerdictBlock, ReceiverState]:
    """Return the verdicts of a block, and the state for the next block.

    `state` is the state after the previous block, None for the first block. `measured` has at least one epoch.
    """
    times = measured.snapshots.time
    if state is None:
        uncertainty = TimeUncertainty(initial_s=float(measured.snapshots.time_uncertainty_s[0]))
        state = ReceiverState(origin=times.at(0), last=times.at(0), uncertainty=uncertainty)
    work = _Assessment(processor, state, measured.single_precision(), assistance)
    return work.verdicts, work.after()


class _Assessment:
    """Intermediate results of one block, from its measurements to its verdicts."""

    def __init__(
        self, processor: AcasProcessor, state: ReceiverState, measured: MeasurementBlock, assistance: AssistanceData
    ) -> None:
        self._processor, self._state, self._measured, self._assistance = processor, state, measured, assistance
        self._specs = {spec.name: spec for spec in processor.specs}
        self._p_fa = shares_of(processor)
        snapshots = measured.snapshots
        self._time_s = snapshots.time.since(state.origin)
        self._seen = snapshots.e1.seen
        self._lost = snapshots.asked & ~self._seen & self._seen_lately()
        self._positions_m = self._known_positions()
        sent = None if measured.fix is None else measured.fix.sent.position_m
        self._elevation_rad = (
            np.full(self._seen.shape, np.nan) if sent is None else elevations_from(self._positions_m, sent)
        )
        self._observed = Observed(measured=measured)
        self._subframes, self._osnma = subframes(snapshots.osnma, snapshots.svids, state.osnma)
        self._checks = checks_of(processor, self._p_fa)
        self._needs_references = {name for name in self._checks if self._specs[name].needs_references}
        evidence = self._evidence({})
        self._fixed = {
            name: self._series(name, evidence) for name in self._checks if name not in self._needs_references
        }
        self._settle()

    def _seen_lately(self) -> Bool[np.ndarray, "n m"]:
        """Return for each epoch and satellite whether its E1 signal was tracked in the last `FORGET_S` seconds."""
        before = np.array(
            [
                (self._state.on_e1[svid] - self._state.origin) if svid in self._state.on_e1 else -np.inf
                for svid in self._measured.snapshots.svids
            ]
        )
        times = np.where(self._seen, self._time_s[:, None], -np.inf)
        last = np.maximum(np.maximum.accumulate(times, axis=0), before)
        return self._time_s[:, None] - last < FORGET_S

    def _known_positions(self) -> Float[np.ndarray, "n 3"]:
        """Return the last known position at each epoch; NaN before the first position."""
        n, fix = self._time_s.size, self._measured.fix
        before = np.full(3, np.nan) if self._state.position_m is None else np.array(self._state.position_m)
        if fix is None:
            return np.broadcast_to(before, (n, 3))
        rows = np.maximum.accumulate(np.where(fix.fix.valid, np.arange(n), -1))
        return np.where(rows[:, None] < 0, before, fix.fix.position_m[np.maximum(rows, 0)])

    def _evidence(self, references: Mapping[Quantity, Reference]) -> Evidence:
        return Evidence(
            measured=self._measured,
            time_s=self._time_s,
            elevation_rad=self._elevation_rad,
            observed=self._observed.values,
            references=references,
            subframes=self._subframes,
        )

    def _series(self, name: CheckName | str, evidence: Evidence) -> CheckSeries:
        return self._checks[name].series(self._with_memory(name, evidence))

    def _with_memory(self, name: CheckName | str, evidence: Evidence) -> Evidence:
        """Return the evidence, with the numbers that a check remembers from the epochs before the block."""
        memory = self._state.memory.get(name)
        return replace(evidence, memory=memory) if memory else evidence

    def _settle(self) -> None:
        """Compute the verdicts of the block repeatedly until the guess is right for all epochs but the last."""
        failed = {name: self._confirmed(series) for name, series in self._fixed.items()}
        guess, _ = self._combined(failed)
        while True:
            found = self._judge(guess)
            if guess.first_difference(found) >= self._time_s.size - 1:
                return
            guess = found

    def _judge(self, guess: _Guess) -> _Guess:
        """Compute the verdicts with a guess, store the results, and return the next guess from the verdicts."""
        snapshots = self._measured.snapshots
        evidence = self._judged_by = self._evidence(self._references(guess.quiet & snapshots.recs))
        series = self._fixed | {
            name: self._series(name, evidence) for name in self._checks if name in self._needs_references
        }
        failed = {name: self._confirmed(one) for name, one in series.items()}
        self._uncertainties = self._clock_limits(guess)
        self._e1_search = self._search_e1()
        self._exhaustive = SearchResults.empty(self._seen.shape)
        self._searched = np.zeros(self._time_s.size, np.bool_)
        p_fa = self._processor.monitoring.search_p_fa
        if CheckName.E1_VESTIGIAL_SEARCH in self._specs:
            name = CheckName.E1_VESTIGIAL_SEARCH
            series[name] = self._e1_search.series(name, 2 * p_fa, evidence)
            failed[name] = self._confirmed(series[name])
        if CheckName.E6_EXHAUSTIVE_SEARCH in self._specs:
            name = CheckName.E6_EXHAUSTIVE_SEARCH
            self._search_after = self._search_exhaustively(failed)
            series[name] = self._exhaustive.series(name, p_fa, evidence)
            failed[name] = self._confirmed(series[name])
        self._found = {name: series[name] for name in self._specs if name in series}
        self._failed = {name: failed[name] for name in self._found}
        self._judged, self._status = self._combined(self._failed)
        return self._judged

    def _references(self, teaches: Bool[np.ndarray, " n"]) -> Mapping[Quantity, Reference]:
        """Return the reference level of each quantity at each epoch; an empty mapping if no check needs these levels.

        `teaches` marks the epochs from which the reference levels of later epochs are learned.
        """
        if not self._needs_references:
            return {}
        levels = self._processor.monitoring.levels
        return self._observed.references(levels, self._state.baseline, teaches, self._elevation_rad)

    def _confirmed(self, series: CheckSeries) -> Bool[np.ndarray, "*n"]:
        confirm = self._specs[series.name].confirm
        if confirm == 1:
            return series.failed
        streaks = self._state.streaks.get(series.name, {})
        svids = (0,) if series.of_receiver else self._measured.snapshots.svids
        return confirmed(series.failed, series.run, confirm, np.array([streaks.get(svid, 0) for svid in svids]))

    def _combined(self, failed: Mapping[CheckName | str, Bool[np.ndarray, "*n"]]) -> tuple[_Guess, np.ndarray]:
        """Return the next guess, and the status and cause of each satellite at each epoch, from the failed checks."""
        available = self._fixed[CheckName.E6_POWER].run
        status, cause = combine(self._processor.level, failed, available, self._processor.added_checks)
        due = self._seen | self._lost
        status = np.where(due, status, POSITION[Status.NOT_AVAILABLE]).astype(np.int8)
        quiet = ~np.any(is_alarm(status), axis=1)
        authentic = np.count_nonzero(status == POSITION[Status.AUTHENTIC], axis=1)
        return _Guess(quiet=quiet, authentic=authentic), np.stack([status, cause])

    def _clock_limits(self, guess: _Guess) -> list[TimeUncertainty]:
        """Return n + 1 limits of the clock error: a limit before each of the n epochs, and a limit after the block."""
        limits = [self._state.uncertainty]
        if CheckName.E1_VESTIGIAL_SEARCH not in self._specs:
            return limits * (self._time_s.size + 1)
        times = self._measured.snapshots.time
        fixes = guess.quiet & (guess.authentic > 0)
        shown = clock_error(self._measured)
        for epoch in np.flatnonzero(fixes).tolist():
            limits += limits[-1:] * (epoch + 1 - len(limits))
            fixed_s = FIXED_S if guess.authentic[epoch] >= POSITION_SATELLITES else TRAVEL_TIME_SPREAD_S
            # The receiver does not correct its clock with the fix, so an error that the fix shows remains.
            error_s = abs(float(shown.error_s[epoch]))
            remains_s = error_s if error_s > fixed_s else 0.0
            limits.append(limits[-1].after_fix(times.at(epoch), fixed_s=fixed_s + remains_s))
        return limits + limits[-1:] * (self._time_s.size + 1 - len(limits))

    def _request(self, epochs: Int64[np.ndarray, " k"]) -> SearchRequest:
        return SearchRequest(
            epoch=epochs,
            uncertainty=tuple(self._uncertainties[epoch] for epoch in epochs.tolist()),
            p_fa=self._processor.monitoring.search_p_fa,
            expected_s=self._measured.expected_s[epochs],
            # Only a recording has samples that can be searched. The assistance of a recording contains the downloaded
            # RECS.
            in_samples=ProcessorSearches(processor=self._processor, assistance=cast("Assistance", self._assistance)),
        )

    def _search_e1(self) -> SearchResults:
        """Return the results of the E1 vestigial search at every RECS; NaN if the level or the block has no search."""
        found, searches = SearchResults.empty(self._seen.shape), self._measured.snapshots.searches
        epochs = np.flatnonzero(self._measured.snapshots.recs)
        if searches is not None and epochs.size and CheckName.E1_VESTIGIAL_SEARCH in self._specs:
            found.put(epochs, searches.e1(self._request(epochs)))
        return found

    def _search_exhaustively(self, failed: Mapping[CheckName | str, Bool[np.ndarray, "*n"]]) -> SearchMemory:
        """Run the exhaustive search at each RECS where the search is due, and return the memory of the search."""
        searches, times = self._measured.snapshots.searches, self._measured.snapshots.time
        memory, period_s = self._state.search, self._processor.monitoring.exhaustive_period_s
        any_failed = np.zeros(self._time_s.size, np.bool_)
        for one in failed.values():
            any_failed |= one if one.ndim == 1 else one.any(axis=1)
        suspicious, first = memory.suspicious, 0
        for epoch in np.flatnonzero(self._measured.snapshots.recs).tolist():
            suspicious = suspicious or bool(any_failed[first : epoch + 1].any())
            now: GalileoTime = times.at(epoch)
            since_s = None if memory.searched_at is None else now - memory.searched_at
            due = search_due(since_s, period_s, suspicious=suspicious, found_twice=memory.found_twice)
            if due and searches is not None:
                here = np.array([epoch])
                self._exhaustive.put(here, searches.exhaustive(self._request(here)))
                self._searched[epoch] = True
                memory = replace(memory, searched_at=now, found_twice=bool(self._exhaustive.twice[epoch].any()))
            else:
                memory = replace(memory, found_twice=False)
            suspicious, first = False, epoch + 1
        return replace(memory, suspicious=suspicious or bool(any_failed[first:].any()))

    @property
    def verdicts(self) -> VerdictBlock:
        """Verdicts of the block."""
        status, cause = self._status
        state, self._alarm_after = self._state.alarm.over(
            self._measured.snapshots.svids, self._time_s, status, self._seen | self._lost, self._lost
        )
        limit_s = self._clock_limit_s()
        found = ranges_in_use(
            VerdictBlock(
                measured=self._measured,
                level=self._processor.level,
                specs=self._processor.specs,
                status=status,
                cause=cause,
                state=state,
                before=self._state.alarm,
                due=self._seen | self._lost,
                checks=self._found,
                failed=self._failed,
                e1_search=self._e1_search,
                exhaustive_search=self._exhaustive,
                searched=self._searched,
                evidence=self._judged_by,
            ),
            self._processor,
            limit_s,
        )
        self._fixed_m = self._fixes_that_count(found)
        known = known_positions(self._time_s, self._fixed_m, self._state.fix, self._processor.monitoring.fix.near)
        return ranges_near(found, self._processor, limit_s, known)

    def _fixes_that_count(self, found: VerdictBlock) -> Float[np.ndarray, "n 3"]:
        """Return fixes of epochs that have no alarm and at least four AUTHENTIC satellites; NaN at other epochs.

        A later range of a signal other than the E1 signal must be possible near the last of these fixes. An epoch does
        not count if a satellite has a signal that is earlier than the E1 signal.
        """
        if found.position is None or CheckName.E1_VESTIGIAL_SEARCH not in self._specs:
            return np.full((self._time_s.size, 3), np.nan)
        judged = self._judged
        counts = judged.quiet & (judged.authentic >= POSITION_SATELLITES) & ~found.earlier.any(axis=1)
        return np.where(counts[:, None], found.position.position_m, np.nan)

    def _fix_after(self) -> FixMemory | None:
        """Return the last fix of `_fixes_that_count`, from this block or from an earlier block."""
        rows = np.flatnonzero(np.isfinite(self._fixed_m[:, 0]))
        if not rows.size:
            return self._state.fix
        x, y, z = self._fixed_m[rows[-1]].tolist()
        return FixMemory(time_s=float(self._time_s[rows[-1]]), position_m=(x, y, z))

    def _clock_limit_s(self) -> Float[np.ndarray, " n"]:
        """Return the upper limit of the error of the receiver's clock at each epoch, in s."""
        times, limits = self._measured.snapshots.time, self._uncertainties
        if limits[-1].fixed_at is None:
            return np.full(self._time_s.size, limits[0].initial_s)
        limit_s, first = np.empty(self._time_s.size), 0
        for last in range(1, limit_s.size + 1):  # only an epoch with AUTHENTIC satellites starts a new limit
            if last == limit_s.size or limits[last] is not limits[first]:
                limit_s[first:last] = limits[first].over(times[first:last])
                first = last
        return limit_s

    def after(self) -> ReceiverState:
        """Return the state after the block. The caller must read `verdicts` first, which computes part of the state."""
        state, snapshots = self._state, self._measured.snapshots
        quiet = self._judged.quiet
        on_e1 = dict(state.on_e1)
        for column, svid in enumerate(snapshots.svids):
            rows = np.flatnonzero(self._seen[:, column])
            if rows.size:
                on_e1[svid] = snapshots.time.at(int(rows[-1]))
        position = self._positions_m[-1]
        known = bool(np.isfinite(position[0]))
        further = len(self._specs) > len(MINIMUM)
        return replace(
            state,
            last=snapshots.time.at(len(snapshots.time) - 1),
            uncertainty=self._clock_limits(self._judged)[-1],
            baseline=self._observed.after(state.baseline, quiet & snapshots.recs) if further else state.baseline,
            position_m=(float(position[0]), float(position[1]), float(position[2])) if known else None,
            fix=self._fix_after(),
            osnma=self._osnma,
            memory=self._memory_after(),
            search=self._search_after if CheckName.E6_EXHAUSTIVE_SEARCH in self._specs else state.search,
            streaks=self._streaks(),
            alarm=self._alarm_after,
            on_e1=on_e1,
        )

    def _memory_after(self) -> dict[CheckName | str, CheckMemory]:
        """Return the memory of each check after the block; checks without a memory are left out."""
        found = {
            name: check.remember(self._with_memory(name, self._judged_by))
            for name, check in self._checks.items()
            if isinstance(check, CheckWithMemory)
        }
        return {name: memory for name, memory in found.items() if memory}

    def _streaks(self) -> dict[CheckName | str, dict[int, int]]:
        """Return the failures in a row up to the end of the block, at most `confirm`, for checks with `confirm` > 1."""
        found: dict[CheckName | str, dict[int, int]] = {}
        for name, series in self._found.items():
            confirm = self._specs[name].confirm
            if confirm == 1:
                continue
            known = dict(self._state.streaks.get(name, {}))
            svids = (0,) if series.of_receiver else self._measured.snapshots.svids
            flat_run, flat_failed = (one.reshape(one.shape[0], -1) for one in (series.run, series.failed))
            for column, svid in enumerate(svids):
                tests = flat_failed[flat_run[:, column], column][-confirm:]
                passed = np.flatnonzero(~tests)
                streak = tests.size + known.get(svid, 0) if not passed.size else tests.size - 1 - int(passed[-1])
                known[svid] = min(streak, confirm)
            found[name] = known
        return found
