"""The inertial check over a campaign of a sky: what a range rate did between two RECS against accelerometers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.checks.check import two_sided_factor
from vestige.acas_processor.checks.inertial import InertialMonitor
from vestige.acas_processor.inertial_bridging import gained_towards_mps
from vestige.campaign.track import Track, oscillator, values
from vestige.navigation.earth import local_axes_at
from vestige.navigation.position_fix import geometry_of_sky

if TYPE_CHECKING:
    import xarray


def inertial_track(results: xarray.Dataset, scenario: Mapping[str, Any], p_fa: float) -> Track:
    """Return the check at every epoch with RECS but the first; NaN elsewhere, and without accelerometers.

    Parameters
    ----------
    results, scenario
        Of a campaign of a sky.
    p_fa
        Budget of one satellite between two RECS.
    """
    sensor = scenario["receiver"]["accelerometers"]
    walk_hz = oscillator(scenario).walk_hz
    monitor = InertialMonitor(clock_walk_hz=walk_hz, p_fa=p_fa, **_errors(sensor))
    rate = values(results, "e1_range_rate_mps", "epoch", "satellite")
    statistic, threshold = np.full(rate.shape, np.nan), np.full(rate.shape, np.nan)
    recs = np.flatnonzero(values(results, "recs"))
    place = values(results.sel(fix="all"), "fix_position_m", "epoch", "axis")
    if sensor is not None and recs.size > 1 and np.isfinite(place).any():
        now, before = recs[1:], recs[:-1]
        time_s = values(results, "time_s")
        interval_s = time_s[now] - time_s[before]
        # the local axes turn with the place, by 8 mrad over 50 km, and all that is compared must be in one system
        axes = _axes(place)
        towards = -geometry_of_sky(*(np.radians(_of_sky(results, name)) for name in ("azimuth", "elevation")))[..., :3]
        towards = np.einsum("nij,nmi->nmj", axes, towards)
        gained = np.einsum("nij,ni->nj", axes, np.nan_to_num(values(results, "gained_mps", "epoch", "local_axis")))
        gained = np.cumsum(gained, axis=0)
        gained = gained[now] - gained[before]
        mean = (place[now] - place[before]) / interval_s[:, None]
        own = gained_towards_mps(towards[before], towards[now], gained, mean)
        standing = values(results, "e1_standing_rate_mps", "epoch", "satellite")
        statistic[now] = monitor.statistic(rate[now] - rate[before], standing[now] - standing[before], own)
        measured = values(results, "e1_rate_sigma_mps", "epoch", "satellite") ** 2
        of_rates = two_sided_factor(p_fa) * np.sqrt(measured[now] + measured[before])
        threshold[now] = np.hypot(monitor.threshold_mps(interval_s)[:, None], of_rates)
    return Track(name=monitor.name, unit=monitor.unit, p_fa=p_fa, statistic=statistic, threshold=threshold, exact=False)


def _axes(place_m: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Return the local axes at each epoch's place; without a fix, at the last one before, or at the first."""
    known = np.flatnonzero(np.isfinite(place_m[:, 0]))
    last = np.searchsorted(known, np.arange(len(place_m)), side="right") - 1
    return local_axes_at(place_m[known[np.maximum(last, 0)]])


def _of_sky(results: xarray.Dataset, name: str) -> Float[np.ndarray, "n m"]:
    return values(results, f"{name}_deg", "epoch", "satellite")


def _errors(sensor: Mapping[str, Any] | None) -> dict[str, float]:
    return {name: value for name, value in (sensor or {}).items() if name != "kind"}
