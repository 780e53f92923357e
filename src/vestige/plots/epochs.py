"""Select the results of one satellite, one detector and an interval of time for a figure."""

from __future__ import annotations

import math

import numpy as np
import xarray
from jaxtyping import Bool, Float

from vestige.errors import VestigeError

# allowed NumPy kinds (`dtype.kind`) and axes of the variables that figures read
VARIABLES = {
    "time_s": ("fiu", "epoch"),
    "taps": ("c", "epoch", "satellite", "tap"),
    "noise_power": ("f", "epoch", "satellite"),
    "tap_offset_m": ("fiu", "tap"),
    "tap_index": ("i", "detector", "epoch", "satellite"),
    "magnitude_sigma": ("f", "detector", "epoch", "satellite"),
    "phase_rad": ("f", "detector", "epoch", "satellite"),
    "range_offset_m": ("f", "detector", "epoch", "satellite"),
    "svid": ("iu", "satellite"),
    "detector": ("UOT", "detector"),
}


def select(results: xarray.Dataset, *, detector: str = "early", svid: int | None = None) -> xarray.Dataset:
    """Return the results of one satellite and one detector, without reading large variables.

    Without `svid` the only satellite is chosen.

    The function raises `VestigeError` if a variable is missing or has other axes or another type, or if the results
    lack the detector or the satellite. The error is also raised if `svid` is None and there are several satellites, or
    if times or tap offsets do not ascend.
    """
    for name, (kinds, *dims) in VARIABLES.items():
        expected = f"{name}({', '.join(dims)})"
        if name not in results.variables:
            raise VestigeError(f"results of a campaign: found no {name}, expected {expected}")
        found = results[name]
        if set(found.dims) != set(dims) or found.dtype.kind not in kinds:
            raise VestigeError(f"results of a campaign: found {name}{found.dims} {found.dtype}, expected {expected}")
    for name in ("time_s", "tap_offset_m"):
        values = results[name].values
        if not (values.size and np.all(np.isfinite(values)) and np.all(np.diff(values) > 0)):
            raise VestigeError(f"results of a campaign: found {name} of {values.size}, expected ascending numbers")
    detectors = [str(name) for name in results["detector"].values]
    if detector not in detectors:
        raise VestigeError(f"found no detector {detector}, expected {' or '.join(detectors)}")
    svids = [int(one) for one in results["svid"].values]
    if svid is None and len(svids) == 1:
        svid = svids[0]
    if svid not in svids:
        known = ", ".join(map(str, svids))
        if svid is None:
            raise VestigeError(f"found no choice of satellite, expected one of {known}: give --svid, in Python svid=")
        raise VestigeError(f"found no satellite {svid}, expected one of {known}")
    return results.isel(detector=detectors.index(detector), satellite=svids.index(svid))


def between(results: xarray.Dataset, start_s: float | None, stop_s: float | None) -> xarray.Dataset:
    """Return the epochs with `start_s` ≤ time < `stop_s`, in s after the start of the scenario.

    None means no limit. The function raises `VestigeError` if no epoch is in the interval, or if `time_s` is missing.
    """
    if start_s is None and stop_s is None:
        return results
    if "time_s" not in results.variables or results["time_s"].dims != ("epoch",):
        raise VestigeError("results of a campaign: found no time_s, expected time_s(epoch)")
    time_s = results["time_s"].values
    inside = np.full(time_s.shape, True)
    if start_s is not None:
        inside &= time_s >= start_s
    if stop_s is not None:
        inside &= time_s < stop_s
    if not inside.any():
        span = f"{time_s.min():g} to {time_s.max():g} s" if time_s.size else "no epoch"
        asked = " ".join(f"{word} {at_s:g} s" for word, at_s in (("from", start_s), ("to", stop_s)) if at_s is not None)
        raise VestigeError(f"results of a campaign: found {span}, expected an epoch {asked}")
    return results.isel(epoch=np.flatnonzero(inside))


def column(selected: xarray.Dataset, name: str) -> Float[np.ndarray, " n"]:
    """Return the values of a variable with one axis; NaN in place of values that are not finite."""
    values = np.asarray(selected[name].values, dtype=np.float64)
    return np.where(np.isfinite(values), values, np.nan)


def magnitudes_sigma(selected: xarray.Dataset) -> Float[np.ndarray, "n_epochs n_taps"]:
    """Return the magnitudes of the taps in standard deviations of the noise per dimension; NaN without correlation."""
    magnitudes = np.abs(selected["taps"].transpose("epoch", "tap").values).astype(np.float64)
    sigma = np.sqrt(_noise_power(selected) / 2)
    return np.where(np.isfinite(magnitudes), magnitudes, np.nan) / sigma[:, None]


def phase_rad(selected: xarray.Dataset) -> tuple[Float[np.ndarray, " n_epochs"], str]:
    """Return the phase of the detecting correlator in rad, and a label if the phase is relative to E1's prediction.

    The carrier phase usually changes by thousands of cycles from an epoch to the next epoch. The prediction from E1
    contains these cycles.
    """
    phase = column(selected, "phase_rad")
    if "predicted_phase_rad" not in selected.variables:
        return phase, ""
    against = phase - column(selected, "predicted_phase_rad")
    return np.angle(np.exp(1j * against)), "phase against the carrier phase of E1"


def is_attacked(results: xarray.Dataset) -> bool:
    """Return whether the campaign has an attack, so that the results have the truth of spoofing signals."""
    return {"truth_spoofer_offset_m", "truth_spoofer_power_db", "truth_prediction_error_m"} <= set(results.variables)


def is_detected(selected: xarray.Dataset) -> Bool[np.ndarray, " n_epochs"]:
    """Return whether the detector chose a tap in each epoch."""
    return np.asarray(selected["tap_index"].values >= 0)


def is_missed(selected: xarray.Dataset) -> Bool[np.ndarray, " n_epochs"]:
    """Return whether each epoch has a correlation in which the detector chose no tap."""
    return ~is_detected(selected) & np.isfinite(_noise_power(selected))


def _noise_power(selected: xarray.Dataset) -> Float[np.ndarray, " n_epochs"]:
    power = column(selected, "noise_power")
    return np.where(power > 0, power, np.nan)


def thinned(n: int, limit: int) -> slice:
    """Return a slice of every k-th of `n` indices, with the smallest k that leaves at most `limit` indices."""
    return slice(None, None, max(1, -(-n // limit)))


def title_of(what: str, selected: xarray.Dataset, *, with_detector: bool = True) -> str:
    """Return the title of a figure, with the subject, the detector if wanted, the satellite, and the C/N0 if known."""
    by_detector = [f"{selected['detector'].item()} detector"] if with_detector else []
    parts = [what, *by_detector, f"E{int(selected['svid']):02d}"]
    if (cn0_dbhz := attribute(selected, "cn0_dbhz")) is not None:
        parts.append(f"{cn0_dbhz:g} dBHz")
    return ", ".join(parts)


def attribute(selected: xarray.Dataset, name: str) -> float | None:
    """Return a number among the attributes of the results; None if the number is missing or not finite."""
    value = selected.attrs.get(name)
    try:
        number = float(value) if isinstance(value, (int, float, np.number)) else math.nan
    except OverflowError:  # for example, a whole number of 400 digits
        return None
    return number if math.isfinite(number) else None
