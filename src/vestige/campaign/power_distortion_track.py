"""Power and distortion over a campaign: what was measured, the maps that decide about it, and the check.

A map is of one C/N0, so there is one for every 3 dB of what is expected of a satellite.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.checks.decision_map import Hypotheses, PowerDistortionMonitor, SignalClass
from vestige.campaign.snapshot_tracks import expected_cn0_dbhz
from vestige.campaign.track import Track, observed_scenario, values
from vestige.receiver.e1_taps import INTEGRATION_S, POWER_BANDWIDTH_HZ, TAP_CHIPS
from vestige.signals.pulse import BOC11

if TYPE_CHECKING:
    import xarray

_EARLY, _LATE = TAP_CHIPS.index(-0.15), TAP_CHIPS.index(0.15)
_POWER_SIGMA_DB = 0.1  # of the decision map; the simulated front end does not drift


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerDistortion:
    """Power and distortion of n epochs and m satellites, and the monitor with the maps for them.

    Attributes
    ----------
    monitor
        Made for the receiver of the campaign.
    map_dbhz
        C/N0 of the map that decides; NaN where the satellite is not in view.
    rise_db, distortion
        ΔP of the band and D in σ.
    """

    monitor: PowerDistortionMonitor
    map_dbhz: Float[np.ndarray, "n m"]
    rise_db: Float[np.ndarray, "n m"]
    distortion: Float[np.ndarray, "n m"]


def power_distortion(results: xarray.Dataset) -> PowerDistortion:
    """Return what a receiver has between two RECS.

    Raises
    ------
    VestigeError
        If the results hold no observations of E1.
    """
    scenario = observed_scenario(results)
    expected_dbhz = expected_cn0_dbhz(results, scenario, "cn0_e1_dbhz")
    taps = results["e1_taps"].transpose("epoch", "satellite", "e1_tap").values.astype(np.complex128)
    monitor = PowerDistortionMonitor(
        hypotheses=replace(
            Hypotheses(),
            pulse=BOC11,
            sky_cn0_dbhz=float(np.nanmean(expected_dbhz)),
            integration_s=INTEGRATION_S,
            bandwidth_hz=POWER_BANDWIDTH_HZ,
            n_satellites=max(1, round(float(np.mean(np.sum(np.isfinite(expected_dbhz), axis=1))))),
            sigma_power_db=_POWER_SIGMA_DB,
        )
    )
    return PowerDistortion(
        monitor=monitor,
        map_dbhz=np.round(expected_dbhz / monitor.cn0_step_db) * monitor.cn0_step_db,
        rise_db=np.broadcast_to(values(results, "e1_power_db")[:, None], expected_dbhz.shape),
        distortion=np.abs(taps[..., _EARLY] - taps[..., _LATE]),
    )


def power_distortion_track(results: xarray.Dataset) -> Track:
    """Return the check: the class in the map, against MULTIPATH."""
    measured = power_distortion(results)
    monitor, found = measured.monitor, np.full(measured.distortion.shape, np.nan)
    for level in np.unique(measured.map_dbhz[np.isfinite(measured.map_dbhz)]).tolist():
        here = (measured.map_dbhz == level) & np.isfinite(measured.distortion)
        found[here] = monitor.map_for(level).classify(measured.rise_db[here], measured.distortion[here])
    return Track(
        name=monitor.name,
        unit=monitor.unit,
        p_fa=monitor.p_fa,
        statistic=found,
        threshold=np.full(found.shape, float(SignalClass.MULTIPATH)),
        exact=False,
    )
