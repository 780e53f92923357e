"""The checks of level 2 and 3 that look at one RECS of one satellite, over the results of a campaign.

| track | statistic | budget |
|---|---|---|
| E6 power | signals that E1 predicts and that are missing | a bound, 1 − `min_pd` |
| E6 received power | ΔP of the band | two-sided normal |
| E6 C/N0 | largest correlator against the expected one | a bound: fading |
| E6 second signal | what a second signal explains in the taps | a bound: rays |
| E1 vestigial search, E6 exhaustive search | signals more than one | of one search, in the results |

The searches' threshold is one signal, and their p_fa that with which they were drawn, whatever is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from vestige.acas_processor.checks.e6_cn0 import E6StrengthMonitor
from vestige.acas_processor.checks.received_power import ReceivedPowerMonitor
from vestige.acas_processor.checks.second_signal import SecondSignalMonitor
from vestige.campaign.outcomes import position
from vestige.campaign.track import Track
from vestige.receiver.elevation import ray_amplitude
from vestige.receiver.search_outcome import P_FA
from vestige.records import Band, Status
from vestige.records.checks import CheckName

if TYPE_CHECKING:
    import xarray

_SEARCHES: tuple[tuple[str, CheckName, float], ...] = (
    ("handover_signals", CheckName.E1_VESTIGIAL_SEARCH, 2 * P_FA),
    ("exhaustive_signals", CheckName.E6_EXHAUSTIVE_SEARCH, P_FA),
)


def snapshot_tracks(
    results: xarray.Dataset, scenario: Mapping[str, Any], p_fa: Callable[[str], float], sigma_system_db: float
) -> tuple[Track, ...]:
    """Return the checks of one RECS; those for which the results hold nothing are left out.

    Parameters
    ----------
    results
        As `run` returns them.
    scenario
        What is in them as text.
    p_fa
        Budget of one test of a check.
    sigma_system_db
        Drift of a real front end, 1σ.
    """
    found = [_missing(results, scenario), _strength(results, scenario, p_fa)]
    if scenario["receiver"]["front_end"]["bandwidth_hz"] is None:  # a filter bends the triangle
        found.append(_second_signal(results, scenario, p_fa))
    if "e6_power_db" in results:
        found.append(_power(results, scenario, p_fa, sigma_system_db))
        found += [_search(results, *one) for one in _SEARCHES]
    return tuple(found)


def expected_cn0_dbhz(
    results: xarray.Dataset, scenario: Mapping[str, Any], key: str = "cn0_dbhz"
) -> Float[np.ndarray, "n m"]:
    """Return what C/N0 the receiver expects: of its antenna at the elevation, or of its single line of sight."""
    zenith_dbhz = float(scenario["receiver"][key])
    if "elevation_deg" not in results:
        return np.full((results.sizes["epoch"], results.sizes["satellite"]), zenith_dbhz)
    return zenith_dbhz - scenario["constellation"]["cn0_fall_db"] * (1 - np.sin(_elevation_rad(results)))


def _elevation_rad(results: xarray.Dataset) -> Float[np.ndarray, "n m"]:
    return np.radians(results["elevation_deg"].transpose("epoch", "satellite").values.astype(np.float64))


def _missing(results: xarray.Dataset, scenario: Mapping[str, Any]) -> Track:
    """Return whether E6 was missed where E1 predicts that it is found with `min_pd` at least: as the status has it."""
    status = results["status"].transpose("epoch", "satellite").values
    run, missed = (status != position(Status.NOT_AVAILABLE)), (status == position(Status.NOT_DETECTED))
    return Track(
        name="E6 power",
        unit="signals missing",
        p_fa=1 - scenario["processor"]["min_pd"],
        statistic=np.where(run, missed.astype(np.float64), np.nan),
        threshold=np.zeros(status.shape),
        exact=False,
    )


def _strength(results: xarray.Dataset, scenario: Mapping[str, Any], p_fa: Callable[[str], float]) -> Track:
    monitor = E6StrengthMonitor(p_fa=p_fa("E6 C/N0"))
    expected_dbhz = expected_cn0_dbhz(results, scenario)
    integration_s = float(results.attrs["integration_s"])
    power = results["noise_power"].transpose("epoch", "satellite").values.astype(np.float64)
    taps = np.abs(results["taps"].transpose("epoch", "satellite", "tap").values)
    magnitude = np.max(taps, axis=2) / np.sqrt(power / 2)
    statistic = monitor.statistic(magnitude, expected_dbhz, integration_s)
    return Track(
        name=monitor.name,
        unit=monitor.unit,
        p_fa=monitor.p_fa,
        statistic=statistic,
        threshold=monitor.threshold(expected_dbhz, integration_s),
        exact=False,
    )


def _second_signal(results: xarray.Dataset, scenario: Mapping[str, Any], p_fa: Callable[[str], float]) -> Track:
    rays = scenario["receiver"]["multipath"]
    known = {} if rays is None else {"ray_power_db": float(rays["power_db"])}
    monitor = SecondSignalMonitor(p_fa=p_fa("E6 second signal"), **known)
    statistic, amplitude, _ = _two_signals(results, monitor)
    # low satellites have stronger rays, high ones weaker
    relative = 1.0 if "elevation_deg" not in results else ray_amplitude(np.nan_to_num(_elevation_rad(results)))
    threshold = monitor.threshold(amplitude * relative, results["tap_offset_m"].values.astype(np.float64))
    return Track(
        name=monitor.name, unit=monitor.unit, p_fa=monitor.p_fa, statistic=statistic, threshold=threshold, exact=False
    )


def earlier_of_two_m(results: xarray.Dataset) -> Float[np.ndarray, "n m"]:
    """Return where the earlier of two signals in a bank is, in m after the prediction; NaN without a bank."""
    return _two_signals(results, SecondSignalMonitor())[2]


def _two_signals(results: xarray.Dataset, monitor: SecondSignalMonitor) -> tuple[Float[np.ndarray, "n m"], ...]:
    """Return statistic, amplitude and place of the earlier signal; NaN where nothing was correlated."""
    taps = results["taps"].transpose("epoch", "satellite", "tap").values.astype(np.complex128)
    power = results["noise_power"].transpose("epoch", "satellite").values.astype(np.float64)
    offsets_m = results["tap_offset_m"].values.astype(np.float64)
    correlated = np.isfinite(power)
    found = []
    for values in monitor.statistic(taps[correlated], power[correlated], offsets_m):
        found.append(np.full(power.shape, np.nan))
        found[-1][correlated] = values
    return tuple(found)


def _power(
    results: xarray.Dataset, scenario: Mapping[str, Any], p_fa: Callable[[str], float], sigma_system_db: float
) -> Track:
    receiver = scenario["receiver"]
    monitor = ReceivedPowerMonitor(
        band=Band.E6,
        sigma_system_db=sigma_system_db,
        bandwidth_hz=receiver["front_end"]["bandwidth_hz"] or receiver["sample_rate_hz"],
        averaging_s=float(results.attrs["integration_s"]),
        p_fa=p_fa("E6 received power"),
    )
    statistic = results["e6_power_db"].values.astype(np.float64)
    threshold = np.full(statistic.shape, monitor.threshold_db)
    # on samples it is a mean over satellites, each with noise of its own
    exact = bool(np.all(np.isnan(results["e6_total_power_db"].values))) and not sigma_system_db
    return Track(
        name=monitor.name, unit=monitor.unit, p_fa=monitor.p_fa, statistic=statistic, threshold=threshold, exact=exact
    )


def _search(results: xarray.Dataset, column: str, name: CheckName, p_fa: float) -> Track:
    signals = results[column].transpose("epoch", "satellite").values.astype(np.float64)
    return Track(
        name=name,
        unit="signals",
        p_fa=p_fa,
        statistic=np.where(signals > 0, signals, np.nan),
        threshold=np.ones(signals.shape),
        exact=False,
    )
