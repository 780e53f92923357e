"""Compute the errors of the ranges in use, and the largest error under attack.

`acas_processor/position/range_in_use.py` decides which range may be used. The results store this range in
`range_in_use_m`. `range_is_earlier` says whether this range belongs to the earliest of several signals. This module
only compares the ranges with the truth.

**Error of a range in use.** A verdict applies to the whole time since the previous RECS. The error of an E1 range in
use is therefore the largest error that the attack caused since the previous RECS. If the range of the earliest of
several signals is in use instead, the error of this range counts.

**RECS that count.** All RECS from the first start of an attack to the last stop count. The first RECS after the stop
also counts if an epoch since the previous RECS was attacked, because the verdict of this RECS concerns that epoch, too.
Without an attack every RECS counts.

`vestige run`, the page of a run, sweeps and the threat table give this largest error. The name of this error in JSON
and in tables is `worst_range_m`.
"""

from __future__ import annotations

from math import inf, nan
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float

from vestige.campaign.store.attributes import scenario_of, values
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.stored import StoredScenario

if TYPE_CHECKING:
    import xarray


def range_errors_m(
    results: xarray.Dataset, in_use_m: Float[np.ndarray, "n m"], earlier: Bool[np.ndarray, "n m"]
) -> Float[np.ndarray, "n m"]:
    """Return the error of each range in use in m; NaN if no range is in use.

    Parameters
    ----------
    results
        Results of a campaign, with the columns of the truth.
    in_use_m
        Ranges in use; NaN if no range is in use.
    earlier
        Whether the range in use is the range of the earliest of several signals.
    """
    names = ("truth_e1_noise_m", "truth_e1_multipath_m", "truth_e1_error_m")
    errors_m = [values(results, name, "epoch", "satellite") for name in names if name in results]
    of_earlier_m = in_use_m - values(results, "e1_pseudorange_m", "epoch", "satellite") + np.sum(errors_m, axis=0)
    of_e1_m = np.where(np.isfinite(in_use_m), _e1_error_m(results, in_use_m.shape), np.nan)
    return np.where(earlier, of_earlier_m, of_e1_m)


def stored_range_errors_m(results: xarray.Dataset) -> Float[np.ndarray, "n m"]:
    """Return the error of each range in use at the level of the scenario; NaN if no range is in use."""
    in_use_m = values(results, "range_in_use_m", "epoch", "satellite")
    return range_errors_m(results, in_use_m, values(results, "range_is_earlier", "epoch", "satellite") > 0)


def worst_range_m(results: xarray.Dataset) -> float:
    """Return the largest error of a range in use under attack, with its sign; NaN if no range was in use."""
    return worst_of(stored_range_errors_m(results)[recs_that_count(results)])


def recs_that_count(results: xarray.Dataset) -> Bool[np.ndarray, " n"]:
    """Return True for the epochs whose RECS counts for the largest error; the scenario gives the times of attacks."""
    time_s = results["time_s"].values
    first_s, end_s = window_of(scenario_of(results))
    return recs_since(results["recs"].values.astype(np.bool_), (time_s >= first_s) & (time_s < end_s))


def recs_since(recs: Bool[np.ndarray, " n"], attacked: Bool[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Return True for epochs with RECS if an attack acted since the previous RECS, even if the attack has ended."""
    places = np.flatnonzero(recs)
    acted = np.diff(np.cumsum(attacked)[places], prepend=0) > 0
    found = np.zeros(recs.size, np.bool_)
    found[places[acted]] = True
    return found


def window_of(scenario: CampaignScenario | StoredScenario) -> tuple[float, float]:
    """Return the first start and the last stop of the attacks in s; 0 and infinity without attacks."""
    starts_s = [attack.start_s for attack in scenario.attack]
    stops_s = [inf if attack.stop_s is None else attack.stop_s for attack in scenario.attack]
    return min(starts_s, default=0.0), max(stops_s, default=inf)


def worst_of(values_m: Float[np.ndarray, "..."]) -> float:
    """Return the value with the largest magnitude; NaN if no value is finite."""
    known = values_m[np.isfinite(values_m)]
    return float(known[np.argmax(np.abs(known))]) if known.size else nan


def _e1_error_m(results: xarray.Dataset, shape: tuple[int, ...]) -> Float[np.ndarray, "n m"]:
    """Return the largest E1 error that the attack caused since the previous RECS; 0 in epochs without RECS."""
    worst_m = np.zeros(shape)
    places = np.flatnonzero(results["recs"].values)
    if "truth_e1_worst_error_m" not in results or not places.size:
        return worst_m
    error_m = values(results, "truth_e1_worst_error_m", "epoch", "satellite")[: places[-1] + 1]
    after = np.concatenate([[0], places[:-1] + 1])  # first epoch after the previous RECS
    largest_m, smallest_m = np.maximum.reduceat(error_m, after), np.minimum.reduceat(error_m, after)
    worst_m[places] = np.where(largest_m >= -smallest_m, largest_m, smallest_m)
    return worst_m
