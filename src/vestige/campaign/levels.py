"""What each mitigation level makes of a campaign: verdicts, alarms, and the ranges and positions that are in use.

Theory of operation
-------------------
Steps 1 and 2 are the `status` of the results. All other checks come from `monitoring.tracks`, with the share of the
false-alarm budget that the level gives them (`alarm_budget`), confirmed as often as its row says. `combine_block`
makes the status of every epoch and satellite, `state_block` the state that a user is shown. Thresholds of power and
noise floor allow for a front end that drifts; the simulated one does not, so theirs are bounds.

**Searches.** The hand-over search is made with every RECS of which E1 has more than one signal. The exhaustive search
of level 3 is made when the processor would make it (`acas_processor/search_schedule.py`).

**Ranges.** What a RECS authenticates is the time since the RECS before. The range of E1 is in use where the state is
AUTHENTIC, and with it the largest error that the attack made in that time. Where a search was made that found more than
one signal, the earliest is in use instead, whatever the state: that is what the paper calls mitigation. Where the
correlators hold two signals and the earlier one is where E1 says, E1 stays in use. Otherwise there is no range. The
position is the fix of all satellites with a range in use.

All of it is a function of the whole results: alarms, confirmation and schedule have memory.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Int8

from vestige.acas_processor.alarm import AlarmState
from vestige.acas_processor.alarm_budget import ALARMS_A_DAY, Cadence, Share, false_alarm_budget
from vestige.acas_processor.error_budget import ErrorBudget
from vestige.acas_processor.levels import ALARMS, GRAVITY, LEVELS, combine, confirmed
from vestige.acas_processor.search_schedule import search_due
from vestige.acas_processor.thresholds import probability_of_detection
from vestige.campaign.monitoring import tracks
from vestige.campaign.snapshot_tracks import earlier_of_two_m, expected_cn0_dbhz
from vestige.records import Status

if TYPE_CHECKING:
    import xarray

FRONT_END_DRIFT_DB = 0.3  # 1σ, of gain and temperature: as `ReceivedPowerMonitor` has it
_MINIMUM = {"E6 power": Status.NOT_DETECTED, "E1-E6 range": Status.SPOOFED}
_EXHAUSTIVE = "E6 exhaustive search"


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelVerdicts:
    """A level over a campaign of n epochs and m satellites.

    Attributes
    ----------
    level
        1 to 3.
    status, state
        Of every epoch, and as a user is shown it: positions in `Status`.
    tests, failed
        Where each check was made, and where it failed, after confirmation; of the receiver or of each satellite.
    budget
        Share of each check.
    not_run
        Checks of the level for which the results hold nothing.
    recs, seen
        Epochs with RECS, and where a satellite is in view.
    searched
        Where the exhaustive search was made.
    range_error_m
        Error that the attack makes of the range in use, the largest since the RECS before; NaN where none is.
    earlier
        Whether that range is the earliest of several.
    """

    level: int
    status: Int8[np.ndarray, "n m"]
    state: Int8[np.ndarray, "n m"]
    tests: Mapping[str, Bool[np.ndarray, "..."]]
    failed: Mapping[str, Bool[np.ndarray, "..."]]
    budget: Mapping[str, Share]
    not_run: tuple[str, ...]
    recs: Bool[np.ndarray, " n"]
    seen: Bool[np.ndarray, "n m"]
    searched: Bool[np.ndarray, " n"]
    range_error_m: Float[np.ndarray, "n m"]
    earlier: Bool[np.ndarray, "n m"]

    @property
    def alarm(self) -> Bool[np.ndarray, "n m"]:
        """Whether an alarm stands."""
        return np.isin(self.state, [_position(one) for one in ALARMS])

    @property
    def begins(self) -> Bool[np.ndarray, " n"]:
        """Where an alarm begins, of any satellite where none stood before."""
        stands = np.any(self.alarm, axis=1)
        return stands & np.concatenate([[True], np.logical_not(stands[:-1])])

    def of_recs(self) -> Int8[np.ndarray, "n m"]:
        """Return the verdict of each RECS, the gravest status since the one before; NOT_AVAILABLE in other epochs."""
        gravity = np.argsort([_position(one) for one in GRAVITY])[self.status]
        verdict = np.full(self.status.shape, _position(Status.NOT_AVAILABLE), np.int8)
        after = 0
        for place in np.flatnonzero(self.recs).tolist():
            gravest = gravity[after : place + 1].max(axis=0)
            verdict[place] = np.array([_position(one) for one in GRAVITY], np.int8)[gravest]
            after = place + 1
        return verdict

    def first_failures(self, rows: Bool[np.ndarray, " n"]) -> tuple[tuple[str, int], ...]:
        """Return the checks that failed in some of the epochs, each with the first of them, the earliest first."""
        found = []
        for name, failed in self.failed.items():
            any_satellite = failed if failed.ndim == 1 else failed.any(axis=1)
            where = np.flatnonzero(any_satellite & rows)
            if where.size:
                found.append((name, int(where[0])))
        return tuple(sorted(found, key=lambda one: one[1]))


def level_verdicts(
    results: xarray.Dataset, levels: Sequence[int] = tuple(LEVELS), *, alarms_a_day: float = ALARMS_A_DAY
) -> tuple[LevelVerdicts, ...]:
    """Return what mitigation levels make of a campaign.

    Parameters
    ----------
    results
        As `run` returns them, of a sky or with a processor of level 2 or 3.
    levels
        Keys of `LEVELS`.
    alarms_a_day
        False alarms of all checks together whose probability can be chosen.

    Raises
    ------
    VestigeError
        If the results hold too little for a level above 1.
    """
    scenario = json.loads(results.attrs["scenario"])
    cadence = cadence_of(results, scenario)
    return tuple(_verdicts(results, scenario, level, cadence, alarms_a_day) for level in levels)


def verdicts_of_run(results: xarray.Dataset) -> tuple[xarray.Dataset, LevelVerdicts | None]:
    """Return a run with the verdicts of its scenario's level in the place of those of steps 1 and 2, and that level.

    Nothing and None at level 1, which is steps 1 and 2, and of a run that has not ended (coordinate `epoch`).
    """
    level = json.loads(results.attrs["scenario"])["processor"]["level"]
    if level == 1 or "epoch" in results.coords:
        return results, None
    (found,) = level_verdicts(results, (level,))
    return results.assign(status=(("epoch", "satellite"), found.of_recs())), found


def cadence_of(results: xarray.Dataset, scenario: Mapping[str, Any]) -> Cadence:
    """Return how often the receiver tests, with the mean number of satellites in view."""
    in_view = np.mean(np.count_nonzero(_seen(results), axis=1))
    return Cadence(
        satellites=max(1, round(float(in_view))),
        observation_s=scenario["interval_s"],
        recs_s=scenario["interval_s"] * scenario["recs"]["every"],
        search_s=scenario["processor"]["search_s"],
    )


def _verdicts(
    results: xarray.Dataset, scenario: Mapping[str, Any], level: int, cadence: Cadence, alarms_a_day: float
) -> LevelVerdicts:
    processor = scenario["processor"]
    budget = false_alarm_budget(
        level, cadence, alarms_a_day=alarms_a_day, kappa=processor["kappa"], pd=_mean_pd(results, scenario)
    )
    status = results["status"].transpose("epoch", "satellite").values
    available = status != _position(Status.NOT_AVAILABLE)
    failed = {name: status == _position(one) for name, one in _MINIMUM.items()}
    tests = dict.fromkeys(_MINIMUM, available)
    shares = {name: share.p_fa for name, share in budget.items()}
    found = (
        {}
        if level == 1
        else {one.name: one for one in tracks(results, p_fa=shares, sigma_system_db=FRONT_END_DRIFT_DB)}
    )
    for row in LEVELS[level]:
        if row.name in found and row.name not in _MINIMUM:
            tests[row.name] = found[row.name].run
            one = found[row.name]
            nothing = np.zeros(one.failed.shape[1:], np.int64)
            failed[row.name] = confirmed(one.failed, one.run, row.confirm, nothing)
    recs = _recs(scenario, status.shape[0])
    searched = np.zeros(status.shape[0], np.bool_)
    if _EXHAUSTIVE in failed:
        twice = failed[_EXHAUSTIVE].any(axis=1)
        searched = search_schedule(recs, results["time_s"].values, _suspicion(failed), twice, cadence.search_s)
        tests[_EXHAUSTIVE] = tests[_EXHAUSTIVE] & searched[:, None]
        failed[_EXHAUSTIVE] = failed[_EXHAUSTIVE] & searched[:, None]
    combined, _ = combine(level, failed, available)
    always = np.ones(combined.shape, np.bool_)
    svids = tuple(results["svid"].values.tolist())
    state, _ = AlarmState().over(svids, results["time_s"].values, combined, always, ~always)
    error_m, earlier = _ranges(
        results, failed, state, recs, searched, processor["kappa"] * ErrorBudget(**processor["budget"]).sigma_m
    )
    return LevelVerdicts(
        level=level,
        status=combined,
        state=state,
        tests=tests,
        failed=failed,
        budget=budget,
        not_run=tuple(row.name for row in LEVELS[level] if row.name not in tests or not tests[row.name].any()),
        recs=recs,
        seen=_seen(results),
        searched=searched,
        range_error_m=error_m,
        earlier=earlier,
    )


def search_schedule(
    recs: Bool[np.ndarray, " n"],
    time_s: Float[np.ndarray, " n"],
    suspicious: Bool[np.ndarray, " n"],
    twice: Bool[np.ndarray, " n"],
    period_s: float,
) -> Bool[np.ndarray, " n"]:
    """Return in which epochs an exhaustive search is made, by the rule of the processor (`search_due`).

    Parameters
    ----------
    recs
        Epochs with RECS.
    suspicious
        Epochs in which another check failed.
    twice
        Epochs in which a search finds more than one signal.
    period_s
        Time between two searches without suspicion.
    """
    searched = np.zeros(recs.size, np.bool_)
    failures = np.concatenate([[0], np.cumsum(suspicious)])
    last = before = -1
    for place in np.flatnonzero(recs).tolist():
        since_s = None if last < 0 else float(time_s[place] - time_s[last])
        suspicion = bool(failures[place + 1] > failures[before + 1])
        if search_due(since_s, period_s, suspicious=suspicion, found_twice=last == before and bool(twice[last])):
            searched[place] = True
            last = place
        before = place
    return searched


def _suspicion(failed: Mapping[str, Bool[np.ndarray, "..."]]) -> Bool[np.ndarray, " n"]:
    """Return the epochs in which any check but the exhaustive search failed."""
    others = [one for name, one in failed.items() if name != _EXHAUSTIVE]
    return np.any([one if one.ndim == 1 else one.any(axis=1) for one in others], axis=0)


def _ranges(
    results: xarray.Dataset,
    failed: Mapping[str, Bool[np.ndarray, "..."]],
    state: Int8[np.ndarray, "n m"],
    recs: Bool[np.ndarray, " n"],
    searched: Bool[np.ndarray, " n"],
    limit_m: float,
) -> tuple[Float[np.ndarray, "n m"], Bool[np.ndarray, "n m"]]:
    """Return the error of the ranges in use with every RECS, and which of them are the earliest of several signals."""
    error_m = np.where(state == _position(Status.AUTHENTIC), _e1_error_m(results, recs), np.nan)
    earlier = np.zeros(state.shape, np.bool_)
    sources = []
    if "E6 second signal" in failed:
        agrees = np.abs(earlier_of_two_m(results)) <= limit_m
        error_m = np.where(failed["E6 second signal"] & agrees, _e1_error_m(results, recs), error_m)
    if "E1 vestigial search" in failed:
        sources.append((recs[:, None], _of_satellites(results["handover_error_m"])))
    if _EXHAUSTIVE in failed:
        sources.append((searched[:, None], _of_satellites(results["exhaustive_error_m"])))
    for made, of_earliest_m in sources:  # the later one is the better one
        better = made & np.isfinite(of_earliest_m)
        error_m, earlier = np.where(better, of_earliest_m, error_m), earlier | better
    return np.where(recs[:, None], error_m, np.nan), earlier & recs[:, None]


def _of_satellites(values: xarray.DataArray) -> Float[np.ndarray, "n m"]:
    return values.transpose("epoch", "satellite").values.astype(np.float64)


def _mean_pd(results: xarray.Dataset, scenario: Mapping[str, Any]) -> float:
    """Return the mean probability that E6 is detected, at the C/N0 that is expected."""
    expected_dbhz = expected_cn0_dbhz(results, scenario)
    known = expected_dbhz[np.isfinite(expected_dbhz)]
    attrs = results.attrs
    if not known.size:
        return 1.0
    return float(np.mean(probability_of_detection(known, float(attrs["integration_s"]), float(attrs["p_fa"]))))


def _e1_error_m(results: xarray.Dataset, recs: Bool[np.ndarray, " n"]) -> Float[np.ndarray, "n m"]:
    """Return the largest error that the attack made of E1 since the RECS before, in epochs with RECS."""
    shape = (results.sizes["epoch"], results.sizes["satellite"])
    if "truth_e1_worst_error_m" not in results:
        return np.zeros(shape)
    error_m = _of_satellites(results["truth_e1_worst_error_m"])
    worst = np.zeros(shape)
    after = 0
    for place in np.flatnonzero(recs).tolist():
        part = error_m[after : place + 1]
        worst[place] = part[np.argmax(np.abs(part), axis=0), np.arange(shape[1])]
        after = place + 1
    return worst


def _seen(results: xarray.Dataset) -> Bool[np.ndarray, "n m"]:
    if "elevation_deg" in results:
        return np.isfinite(results["elevation_deg"].transpose("epoch", "satellite").values)
    return np.ones((results.sizes["epoch"], results.sizes["satellite"]), np.bool_)


def _recs(scenario: Mapping[str, Any], n: int) -> Bool[np.ndarray, " n"]:
    return np.arange(n) % scenario["recs"]["every"] == 0


def _position(status: Status) -> int:
    return list(Status).index(status)
