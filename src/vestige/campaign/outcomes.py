"""Classify the detections under attack by the truth: true signal, spoofing signal, both in one peak, or no detection.

Theory of operation
-------------------
A detection gives the delay of a signal after the prediction. The simulated truth gives this delay for the line of sight
and for each spoofing signal. A detection belongs to the signal with the nearest delay. The true signal and a spoofing
signal make one common peak if their distance is below the *resolution*. A detection of this peak belongs to both
signals and is MIXED.

The correlation function of E6-C is a triangle of ±1 chip. The sum of two triangles has two maxima only if the distance
between the centres of the triangles is more than about half of the base. The default resolution is one chip, 58.6 m: at
this distance, neither triangle reaches the peak of the other triangle. From about this distance on, the sum has two
peaks, and the early detector finds the earlier peak.

A spoofing signal counts if its power relative to the true signal exceeds `FLOOR_DB`. A weaker spoofing signal moves a
detection by less than 1 m on average. A spoofing signal with invented chips makes no peak and never counts.

The report gives two times and an error:

    time to detect      from the attack's first epoch to the first alarm (SUSPECT, SPOOFED, NOT_DETECTED) under attack
    time to mitigate    from the attack's first epoch to the epoch from which on at least `SHARE` of detections are TRUE
    worst range         largest error of a range in use (`range_errors.py`)

No function has side effects. An argument `results` contains results as the campaign stores them. Without an attack
every detection is TRUE.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import xarray
from jaxtyping import Bool, Float, Int8

from vestige.acas_processor.levels import is_alarm
from vestige.campaign.range_errors import worst_range_m
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.signals.definitions import E6C

RESOLUTION_M = SPEED_OF_LIGHT_MPS / E6C.chip_rate_hz  # length of one chip of E6-C in m
FLOOR_DB = -15.0
SHARE = 0.97


class DetectedSignal(IntEnum):
    """Signal to which a detection belongs."""

    NONE = 0
    TRUE = 1
    SPOOFER = 2
    MIXED = 3


def classify(
    range_offset_m: Float[np.ndarray, " n"],
    prediction_error_m: Float[np.ndarray, " n"],
    spoofer_offset_m: Float[np.ndarray, "n n_attacks"],
    spoofer_power_db: Float[np.ndarray, "n n_attacks"],
    *,
    resolution_m: float = RESOLUTION_M,
) -> Int8[np.ndarray, " n"]:
    """Return the `DetectedSignal` of every epoch.

    `range_offset_m` is NaN where nothing was detected. `prediction_error_m` is the delay of the line of sight after its
    prediction. The true signal and a spoofing signal make one peak if their distance is below `resolution_m`. A
    spoofing signal whose power relative to the true signal is at most `FLOOR_DB` does not count.
    """
    found_m = range_offset_m - prediction_error_m
    counts = spoofer_power_db > FLOOR_DB
    distance_m = np.where(counts, np.abs(found_m[:, None] - spoofer_offset_m), np.inf)
    spoofer = np.min(distance_m, axis=1, initial=np.inf) < np.abs(found_m)
    near = counts & (np.abs(spoofer_offset_m) < resolution_m)
    mixed = np.any(near & (distance_m < np.abs(found_m)[:, None] + resolution_m), axis=1)
    outcome = np.where(mixed, DetectedSignal.MIXED, np.where(spoofer, DetectedSignal.SPOOFER, DetectedSignal.TRUE))
    return np.where(np.isnan(range_offset_m), DetectedSignal.NONE, outcome).astype(np.int8)


def outcomes(results: xarray.Dataset, *, resolution_m: float = RESOLUTION_M) -> xarray.DataArray:
    """Return the `DetectedSignal` of each detector, epoch and satellite."""
    offset = results["range_offset_m"].transpose("detector", "epoch", "satellite")
    values = np.full(offset.shape, DetectedSignal.NONE, np.int8)
    for satellite in range(offset.sizes["satellite"]):
        truth = _truth(results.isel(satellite=satellite))
        for detector in range(offset.sizes["detector"]):
            found_m = offset.values[detector, :, satellite].astype(np.float64)
            values[detector, :, satellite] = classify(found_m, *truth, resolution_m=resolution_m)
    flags = {
        "flag_values": [int(one) for one in DetectedSignal],
        "flag_meanings": " ".join(one.name for one in DetectedSignal),
    }
    return xarray.DataArray(values, dims=offset.dims, coords=offset.coords, name="outcome", attrs=flags)


def attacked_epochs(results: xarray.Dataset) -> Bool[np.ndarray, "n_epochs n_satellites"]:
    """Return whether each satellite is under attack at each epoch: by a spoofing signal or added noise on E1 or E6."""
    if "truth_spoofed" not in results:
        return np.zeros((results.sizes["epoch"], results.sizes["satellite"]), dtype=bool)
    truth = results.transpose("epoch", "satellite", ...)
    noisy = np.maximum(truth["truth_noise_rise_db"].values, truth["truth_e1_noise_rise_db"].values) > 0
    return truth["truth_spoofed"].values | noisy


def due_verdicts(results: xarray.Dataset) -> Bool[np.ndarray, "n_epochs n_satellites"]:
    """Return True where a verdict is due: in epochs with RECS, for satellites in view."""
    due = np.ones((results.sizes["epoch"], results.sizes["satellite"]), dtype=bool)
    if "recs" in results:
        due &= results["recs"].values[:, None]
    if "elevation_deg" in results:
        due &= np.isfinite(results["elevation_deg"].transpose("epoch", "satellite").values)
    return due


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackReport:
    """Report on an attack on one satellite: shares of the outcomes, times to detect and mitigate, worst error."""

    detector: str  # detector that made the outcomes; the status always comes from the detector of the scenario
    first_s: float  # time of the attack's first epoch, after the start of the campaign
    epochs: int  # number of attacked epochs with a due verdict
    shares: dict[DetectedSignal, float]  # share of each outcome in attacked epochs with a due verdict
    time_to_detect_s: float  # time from the attack's first epoch to the first alarm under attack; NaN without alarm
    # time from the attack's first epoch to the first epoch from which on at least the share `SHARE` of the detections
    # is of the true signal; NaN if there is no such epoch
    time_to_mitigate_s: float
    # error of a range in use with the largest magnitude, with its sign; NaN if no range was in use
    worst_range_m: float
    e1_captured: float  # share of the attacked epochs in which E1 tracking was on a spoofing signal


def report(results: xarray.Dataset, detector: str = "early", *, satellite: int = 0) -> AttackReport | None:
    """Return the report on the attack on a satellite; None if no verdict was due under attack.

    `satellite` is the index on the axis of satellites. From the time of mitigation on, at least the share `SHARE` of
    the detections belongs to the true signal.
    """
    if "truth_spoofed" not in results:
        return None
    one = results.isel(satellite=satellite)
    attacked = attacked_epochs(results)[:, satellite]
    due = due_verdicts(results)[attacked, satellite]
    if not due.any():
        return None
    time_s = one["time_s"].values[attacked]
    outcome = outcomes(results).sel(detector=detector).values[attacked, satellite]
    alarm = is_alarm(one["status"].values[attacked])
    return AttackReport(
        detector=detector,
        first_s=float(time_s[0]),
        epochs=int(np.count_nonzero(due)),
        shares={kind: float(np.mean(outcome[due] == kind)) for kind in DetectedSignal},
        time_to_detect_s=float(time_s[np.argmax(alarm)] - time_s[0]) if alarm.any() else float("nan"),
        time_to_mitigate_s=_time_to_mitigate_s(time_s, outcome),
        worst_range_m=worst_range_m(results.isel(satellite=[satellite])),
        e1_captured=float(np.mean(one["truth_e1_captured"].values[attacked])),
    )


def _truth(one: xarray.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the arguments of `classify` that come from the truth, for one satellite."""
    if "truth_spoofed" not in one:
        names = ("truth_iono_diff_m", "truth_bias_m", "truth_e1_noise_m", "truth_e1_multipath_m")
        iono_m, bias_m, noise_m, multipath_m = (one[name].values for name in names)
        nobody = np.zeros((iono_m.size, 0))
        return iono_m + bias_m - noise_m - multipath_m, nobody, nobody
    power_db = one["truth_spoofer_power_db"].transpose("epoch", "attack").values.astype(np.float64)
    power_db = np.where(one["forged"].values, -np.inf, power_db)
    offset_m = one["truth_spoofer_offset_m"].transpose("epoch", "attack").values
    return one["truth_prediction_error_m"].values, offset_m, power_db


def _time_to_mitigate_s(time_s: Float[np.ndarray, " n"], outcome: Int8[np.ndarray, " n"]) -> float:
    detected: Bool[np.ndarray, " n"] = outcome != DetectedSignal.NONE
    true_after = np.cumsum((outcome == DetectedSignal.TRUE)[::-1])[::-1]
    found_after = np.cumsum(detected[::-1])[::-1]
    held = (true_after >= SHARE * found_after) & (found_after > 0)
    return float(time_s[np.argmax(held)] - time_s[0]) if held.any() else float("nan")
