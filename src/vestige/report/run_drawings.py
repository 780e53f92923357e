"""Prepare the data of the drawings on a run's page: time-lines, correlators, range offsets, checks and position."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray
from jaxtyping import Bool, Float

from vestige.acas_processor.levels import ALARMS, GRAVITY, POSITION, is_alarm
from vestige.campaign.outcomes import due_verdicts
from vestige.campaign.store.attributes import attributes_of, scenario_of
from vestige.campaign.verdicts import range_limit_m
from vestige.plots.attacks.attack_comparison import spoofing_power_and_offset
from vestige.plots.epochs import column, is_attacked, is_missed, magnitudes_sigma, select
from vestige.records import Status
from vestige.records.checks import CheckSeries
from vestige.report.drawing import Rows, chosen_rows, outermost, packed, scaled, stretches

ROWS = 24_000  # largest number of epochs that are drawn individually, over all satellites
ROW_BYTES = 1_200_000  # largest size in bytes of the epochs drawn individually; more correlators allow fewer epochs
STRETCHES = 720  # largest number of stretches of a time-line
STRETCH_BYTES = 400_000
BINS = 80  # number of bins of a histogram
_OF_NONE = 0.5  # threshold that is drawn for a count that must be 0
_OUTERMOST = 250  # number of equal parts of a run over all satellites; the extreme offsets of each part are drawn


def run_drawings(
    results: xarray.Dataset, checks: tuple[CheckSeries, ...]
) -> tuple[dict[str, Any], dict[str, dict[str, int]]]:
    """Return the data that the script of a run's page draws, and `Rows.every` of each satellite.

    `checks` are the checks of the highest level for which the results allow verdicts, and the user's own checks.
    `checks` is empty for a run without a sky and without own checks.
    """
    detectors = [str(name) for name in results["detector"].values]
    svids = [int(svid) for svid in results["svid"].values]
    due = due_verdicts(results)
    shown = {svid: due[:, place] for place, svid in enumerate(svids) if due[:, place].any()}
    scenario = scenario_of(results)
    satellites, thinned = [], {}
    top = _top(results)
    for svid, mask in shown.items():
        one, rows = _satellite(results, svid, mask, len(shown), top, scenario.recs_interval_s)
        satellites.append(one)
        thinned[one["name"]] = rows.every
    time_s = results["time_s"].values
    data = {
        "span_s": [float(time_s[0]), float(time_s[-1]) + scenario.interval_s],
        "statuses": [status.value for status in Status],
        "alarms": [POSITION[status] for status in ALARMS],
        "gravity": [POSITION[status] for status in GRAVITY],
        "detectors": detectors,
        "offsets_m": results["tap_offset_m"].values.tolist(),
        "threshold_sigma": attributes_of(results).threshold_sigma,
        "limit_m": range_limit_m(results),
        "top_sigma": top,
        "satellites": satellites,
        "histogram": _histogram(results, detectors, due),
    }
    if checks:
        data["checks"] = _checks(time_s, scenario.interval_s, checks)
    if checks and scenario.constellation is not None:
        data["position"] = _position(results, time_s)
    return data, thinned


def _satellite(
    results: xarray.Dataset, svid: int, due: Bool[np.ndarray, " n"], n_satellites: int, top: float, interval_s: float
) -> tuple[dict[str, Any], Rows]:
    """Return the drawings of a satellite for the epochs in which a verdict was due, and the rows drawn individually."""
    of = {
        str(name): select(results, detector=str(name), svid=svid).isel(epoch=np.flatnonzero(due))
        for name in results["detector"].values
    }
    one = next(iter(of.values()))
    time_s, magnitude, status = column(one, "time_s"), magnitudes_sigma(one), one["status"].values.astype(np.int64)
    n_taps, n_attacks = magnitude.shape[1], results.sizes.get("attack", 0)
    fitting = STRETCH_BYTES // (n_satellites * (17 + n_taps))
    parts = stretches(time_s, interval_s, min(STRETCHES, fitting))
    row_bytes = 29 + 2 * n_taps + 8 * n_attacks
    everything = np.ones(time_s.size, dtype=bool)
    offsets = {name: column(each, "range_offset_m") for name, each in of.items()}
    rows = chosen_rows(
        {
            "misses": np.any([is_missed(each) for each in of.values()], axis=0),
            "alarms": is_alarm(status),
            "outermost offsets": np.any(
                [outermost(each, max(1, _OUTERMOST // n_satellites)) for each in offsets.values()], axis=0
            ),
        },
        everything,
        min(ROWS, ROW_BYTES // row_bytes) // n_satellites,
    )
    at = rows.places
    drawn = {
        "name": f"E{svid:02d}",
        "stretches": parts.drawn() | {"length": parts.length},
        "statuses": packed(parts.occurring(status, everything)),
        "heat": scaled(parts.mean(magnitude), top, bits=8),
        "time_s": packed(time_s[at]),
        "taps": scaled(magnitude[at], top, bits=16),
        "status": packed(status[at].astype(np.uint8)),
        "offset_m": {name: packed(each[at].astype(np.float32)) for name, each in offsets.items()},
        "magnitude": {
            name: packed(column(each, "magnitude_sigma")[at].astype(np.float32)) for name, each in of.items()
        },
    }
    return drawn | (_truth(one.isel(epoch=at)) if is_attacked(results) else {}), rows


def _truth(one: xarray.Dataset) -> dict[str, Any]:
    """Return the range offset of the true signal, and range offset and power of spoofing signals with true chips.

    A value is NaN at epochs without the signal.
    """
    power_db, place_m = spoofing_power_and_offset(one)
    matching = ~one["forged"].values.astype(bool) if "forged" in one.variables else np.ones(power_db.shape[1], bool)
    names = [str(name) for name in one["attack"].values]
    return {
        "true_m": packed(column(one, "truth_prediction_error_m").astype(np.float32)),
        "spoofing_signals": [
            {
                "name": names[place],
                "place_m": packed(place_m[:, place].astype(np.float32)),
                "power_db": packed(power_db[:, place].astype(np.float32)),
            }
            for place in np.flatnonzero(matching)
        ],
    }


def _top(results: xarray.Dataset) -> float:
    """Return the largest magnitude of all correlators in σ, but at least 1.5 times the threshold."""
    sigma = np.sqrt(results["noise_power"].transpose("epoch", "satellite").values.astype(np.float64) / 2)[..., None]
    magnitude = np.abs(results["taps"].transpose("epoch", "satellite", "tap").values) / np.where(
        sigma > 0, sigma, np.nan
    )
    return float(max(np.nanmax(magnitude, initial=0.0), 1.5 * attributes_of(results).threshold_sigma))


def _histogram(results: xarray.Dataset, detectors: list[str], due: Bool[np.ndarray, "n m"]) -> dict[str, Any]:
    """Return a histogram of the range offsets of all due verdicts for each detector."""
    offsets = results["range_offset_m"].transpose("detector", "epoch", "satellite").values.astype(np.float64)
    found = {name: offsets[place][due & np.isfinite(offsets[place])] for place, name in enumerate(detectors)}
    everything = np.concatenate(list(found.values()))
    if not everything.size:
        return {}
    edges = np.linspace(np.floor(everything.min()), np.ceil(everything.max()) + 1e-9, BINS + 1)
    return {
        "edges_m": edges.tolist(),
        "counts": {name: np.histogram(values, edges)[0].tolist() for name, values in found.items()},
    }


def _checks(time_s: Float[np.ndarray, " n"], interval_s: float, checks: tuple[CheckSeries, ...]) -> dict[str, Any]:
    """Return for each check the largest |statistic|/threshold of all satellites in each stretch.

    A threshold of 0 is replaced by `_OF_NONE`.
    """
    parts = stretches(time_s, interval_s, STRETCHES)
    lanes = []
    for check in checks:
        with np.errstate(invalid="ignore", divide="ignore"):
            limit = np.where(check.threshold > 0, check.threshold, _OF_NONE)
            ratio = np.where(check.run, np.abs(check.statistic) / limit, np.nan)
        of_all = np.fmax.reduce(ratio.reshape(time_s.size, -1), axis=1)
        lanes.append({"name": check.name, "ratio": packed(parts.largest(of_all).astype(np.float32))})
    return {"stretches": parts.drawn() | {"length": parts.length}, "lanes": lanes}


def _position(results: xarray.Dataset, time_s: Float[np.ndarray, " n"]) -> dict[str, Any]:
    """Return the errors along east, north and up of the fix of all satellites and of the authenticated satellites."""
    errors = results["fix_error_m"].transpose("fix", "local_axis", "epoch").values
    fixes = {}
    for place, fix in enumerate(map(str, results["fix"].values)):
        known = np.flatnonzero(np.isfinite(errors[place, 0]))
        every = max(1, -(-known.size // (ROWS // 3)))
        at = known[::every]
        fixes[fix] = {
            "every": every,
            "time_s": packed(time_s[at]),
            "error_m": [packed(axis[at].astype(np.float32)) for axis in errors[place]],
        }
    return {"axes": [str(axis) for axis in results["local_axis"].values], "fixes": fixes}
