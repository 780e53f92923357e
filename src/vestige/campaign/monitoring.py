"""The checks of a receiver over the results of a campaign: statistic, threshold and outcome of every epoch.

Each `Track` is one check. Those that look at satellites have a second axis. What the receiver knows beforehand comes
from the scenario in the results: its oscillator, its antenna's C/N0 against elevation, its error budget.

| track | statistic | budget |
|---|---|---|
| E1 received power | ΔP of the band | two-sided normal |
| C/N0 | of the prompt correlator, against that of the elevation | two-sided non-central χ² |
| power-distortion | class in the decision map | a bound, 0.6 % |
| wrong-code floor | against the median of a satellite's first RECS, five to ten of them | two-sided normal |
| E1-E6 range | range offset | κσ of the error budget |
| clock innovation, consistency, slope | of the fix with all satellites | each a third |
| RAIM, solution separation | of the fix with all satellites | χ², a bound |
| OSNMA availability, reception | keys and pages of a subframe that are missing | binomial, bounds |
| OSNMA agreement | pages of a subframe that are not what a second channel has | a bound, that of the checksum |
| of one RECS (`snapshot_tracks.py`) | E6 found, its power and strength, second signals, searches | normal, bounds |
| inertial range rate | change between two RECS, against accelerometers | normal; satellites share clock and sensor |
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from scipy.special import chndtrix, erfc

from vestige.acas_processor.baseline import LEARNED
from vestige.acas_processor.checks.check import two_sided_factor
from vestige.acas_processor.checks.clock import ClockDriftMonitor, ClockHistory
from vestige.acas_processor.checks.cn0 import Cn0Monitor
from vestige.acas_processor.checks.noise_floor import WrongCodeFloorMonitor
from vestige.acas_processor.checks.raim import RaimMonitor
from vestige.acas_processor.checks.received_power import ReceivedPowerMonitor
from vestige.acas_processor.checks.solution_separation import SolutionSeparationMonitor
from vestige.acas_processor.error_budget import ErrorBudget
from vestige.campaign.inertial_track import inertial_track
from vestige.campaign.osnma_tracks import osnma_tracks
from vestige.campaign.power_distortion_track import power_distortion_track
from vestige.campaign.sky_columns import SKY_COLUMNS
from vestige.campaign.snapshot_tracks import expected_cn0_dbhz, snapshot_tracks
from vestige.campaign.track import Track, observed_scenario, oscillator, values
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.position_fix import UNKNOWNS
from vestige.navigation.raim import chi_square_threshold
from vestige.receiver.e1_taps import INTEGRATION_S, TAP_CHIPS
from vestige.records import Band
from vestige.signals.definitions import E6C
from vestige.time import GalileoTime

if TYPE_CHECKING:
    import xarray

__all__ = ["P_FA", "Track", "tracks"]

P_FA = 1e-5
_PROMPT = TAP_CHIPS.index(0.0)
_CALIBRATION = 10  # first RECS whose median is the usual floor of a satellite
_LEAST, _GRID_DB = 1e-3, 0.1


def tracks(
    results: xarray.Dataset,
    *,
    p_fa: float | Mapping[str, float] = P_FA,
    cn0_model_sigma_db: float = Cn0Monitor().sigma_model_db,
    sigma_system_db: float = 0.0,
) -> tuple[Track, ...]:
    """Return every check over the results of a campaign; what the results hold nothing for is left out.

    On a single line of sight there is no position fix, no OSNMA of several satellites, nor what is made of them.

    Parameters
    ----------
    results
        As `run` returns them, of a sky or with a processor of level 2 or 3.
    p_fa
        Budget of one test of each check whose budget is free; or by name of the check, where a name that is not there
        has the default. As a number it is that of the three checks of the clock together.
    cn0_model_sigma_db
        What the C/N0 may differ from that of the elevation, 1σ.
    sigma_system_db
        Drift of a real front end that the thresholds of power and floor allow for, 1σ; the simulated one does not
        drift.

    Raises
    ------
    VestigeError
        If the results hold no observations of E1.
    """
    scenario = observed_scenario(results)

    def share(name: str) -> float:
        return p_fa if isinstance(p_fa, float) else p_fa.get(name, P_FA)

    found = (
        _received_power(results, share("E1 received power"), sigma_system_db),
        _cn0_track(results, scenario, share("C/N0"), cn0_model_sigma_db),
        power_distortion_track(results),
        _floor(results, scenario, share("wrong-code floor"), sigma_system_db),
        _range(results, scenario),
        *snapshot_tracks(results, scenario, share, sigma_system_db),
    )
    missing = set(SKY_COLUMNS) - set(results.variables)
    if missing:
        return found
    second_s = GalileoTime.parse(scenario["start"]).second + values(results, "time_s")
    return (
        *found,
        *_clock(results, scenario, share("clock slope") * (1 if isinstance(p_fa, Mapping) else 1 / 3)),
        *_consistency(results, scenario, share),
        *osnma_tracks(results, second_s, share),
        inertial_track(results, scenario, share("inertial range rate")),
    )


def _received_power(results: xarray.Dataset, p_fa: float, sigma_system_db: float) -> Track:
    monitor = ReceivedPowerMonitor(band=Band.E1, sigma_system_db=sigma_system_db, p_fa=p_fa)
    statistic = values(results, "e1_power_db")
    return Track(
        name=monitor.name,
        unit=monitor.unit,
        p_fa=p_fa,
        statistic=statistic,
        threshold=np.full(statistic.shape, monitor.threshold_db),
        exact=not sigma_system_db,
    )


def _cn0_track(results: xarray.Dataset, scenario: Mapping[str, Any], p_fa: float, model_sigma_db: float) -> Track:
    expected_dbhz = expected_cn0_dbhz(results, scenario, "cn0_e1_dbhz")
    taps = results["e1_taps"].transpose("epoch", "satellite", "e1_tap").values.astype(np.complex128)
    change_db, limit_db = _cn0(np.abs(taps[..., _PROMPT]), expected_dbhz, p_fa)
    return Track(
        name=Cn0Monitor().name,
        unit=Cn0Monitor().unit,
        p_fa=p_fa,
        statistic=change_db,
        threshold=np.hypot(limit_db, two_sided_factor(p_fa) * model_sigma_db),
        exact=model_sigma_db == 0,
    )


def _cn0(
    magnitude: Float[np.ndarray, "n m"], expected_dbhz: Float[np.ndarray, "n m"], p_fa: float
) -> tuple[Float[np.ndarray, "n m"], Float[np.ndarray, "n m"]]:
    """Return the C/N0 of prompt correlators over the expected one in dB, and how far it may be on its side.

    |ξ|² is non-central χ² with two degrees of freedom and λ = s² = 2 C/N0 T, so its logarithm is skewed.
    """
    squared = 2 * 10 ** (expected_dbhz / 10) * INTEGRATION_S
    measured = np.maximum(magnitude**2 - 2, _LEAST)  # |ξ|² has mean s² + 2
    change_db = 10 * np.log10(measured / squared)
    low, high = np.nanmin(expected_dbhz), np.nanmax(expected_dbhz)
    grid_dbhz = np.linspace(low, high, max(2, round((high - low) / _GRID_DB)))
    lam = 2 * 10 ** (grid_dbhz / 10) * INTEGRATION_S
    ends = [10 * np.log10(np.maximum(chndtrix(p, 2, lam) - 2, _LEAST) / lam) for p in (p_fa / 2, 1 - p_fa / 2)]
    below, above = (np.interp(expected_dbhz, grid_dbhz, end) for end in ends)
    return change_db, np.where(change_db < 0, -below, above)


def _floor(results: xarray.Dataset, scenario: Mapping[str, Any], p_fa: float, sigma_system_db: float) -> Track:
    """Return the floor against its median in a satellite's first RECS, less what the signal has in it by itself.

    Those are its calibration, ten or as many as were before, and five at least: what is judged with a RECS must not
    depend on what comes later.
    """
    power = values(results, "noise_power", "epoch", "satellite")
    gain_db = np.nan_to_num(values(results, "e6_agc_gain_db"))[:, None]
    n_chips = round(results.attrs["integration_s"] * E6C.chip_rate_hz)
    monitor = WrongCodeFloorMonitor(n_chips=n_chips, sigma_system_db=sigma_system_db, p_fa=p_fa)
    floor_db = np.where(power > 0, 10 * np.log10(np.where(power > 0, power, 1.0)) - gain_db, np.nan)
    floor_db = floor_db - 10 * np.log10(1 + _own_share(results, scenario))
    change_db, learned = (np.stack(parts, axis=1) for parts in zip(*map(_against_first, floor_db.T), strict=True))
    growth = np.sqrt(1 + np.pi / 2 / learned)  # a median of n has π/2n of the variance of one
    return Track(
        name=monitor.name,
        unit=monitor.unit,
        p_fa=p_fa,
        statistic=change_db,
        threshold=monitor.threshold_db * growth,
        exact=not sigma_system_db,
    )


def _against_first(floor_db: Float[np.ndarray, " n"]) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return the floor of a satellite less the median of its first RECS, and of how many; NaN until there are some."""
    usual_db, learned = np.full(floor_db.size, np.nan), np.full(floor_db.size, np.nan)
    known = np.flatnonzero(np.isfinite(floor_db))
    for n in range(LEARNED, min(known.size, _CALIBRATION + 1)):
        later = known[n:]
        usual_db[later], learned[later] = np.median(floor_db[known[:n]]), n
    return floor_db - usual_db, learned


def _own_share(results: xarray.Dataset, scenario: Mapping[str, Any]) -> Float[np.ndarray, "n m"]:
    """Return what the signal itself adds to the floor of wrong codes, Ec/N0 where it meets two chips of the replica."""
    signal = scenario["receiver"]["signal"]
    expected_dbhz = expected_cn0_dbhz(results, scenario, "cn0_dbhz") if signal else np.full((1, 1), -np.inf)
    offset_m = values(results.sel(detector=scenario["processor"]["detector"]), "range_offset_m", "epoch", "satellite")
    between = np.nan_to_num(offset_m) * E6C.chip_rate_hz / SPEED_OF_LIGHT_MPS % 1.0
    return 10 ** (expected_dbhz / 10) / E6C.chip_rate_hz * ((1 - between) ** 2 + between**2)


def _range(results: xarray.Dataset, scenario: Mapping[str, Any]) -> Track:
    table = scenario["processor"]
    kappa = table["kappa"]
    offset_m = results["range_offset_m"].sel(detector=table["detector"]).transpose("epoch", "satellite").values
    return Track(
        name="E1-E6 range",
        unit="m",
        p_fa=float(erfc(kappa / np.sqrt(2))),
        statistic=offset_m.astype(np.float64),
        threshold=np.full(offset_m.shape, kappa * ErrorBudget(**table["budget"]).sigma_m),
        exact=False,
    )


def _clock(results: xarray.Dataset, scenario: Mapping[str, Any], p_fa: float) -> tuple[Track, ...]:
    """Return the three clock checks, each of this p_fa, with the errors of the fix as they are in each epoch."""
    fix = results.sel(fix="all")
    clock = oscillator(scenario)
    monitor = ClockDriftMonitor(white_s=clock.white_s, walk_hz=clock.walk_hz, max_gap_s=np.inf, p_fa=3 * p_fa)
    found = monitor.statistics(
        ClockHistory(  # what satellites have in common lasts for hours and is in two successive clocks alike
            time_s=values(results, "time_s"),
            bias_m=values(fix, "fix_clock_m"),
            drift_mps=values(fix, "fix_drift_mps"),
            bias_variance=values(fix, "fix_own_sigma_clock_m") ** 2,
            drift_variance=values(fix, "fix_sigma_drift_mps") ** 2,
        )
    )
    parts = (
        ("innovation", "m/s", found.innovation, found.innovation_threshold),
        ("consistency", "m", found.consistency, found.consistency_threshold),
        ("slope", "m/s²", found.slope, found.slope_threshold),
    )
    return tuple(
        Track(
            name=f"clock {name}",
            unit=unit,
            p_fa=p_fa,
            statistic=statistic,
            threshold=threshold,
            exact=_normal_errors(scenario),
        )
        for name, unit, statistic, threshold in parts
    )


def _normal_errors(scenario: Mapping[str, Any]) -> bool:
    """Return whether pseudoranges have the errors that are believed; otherwise the belief is a bound of their tails."""
    return scenario["receiver"]["ionosphere"] is None and scenario["receiver"]["multipath"] is None


def _consistency(
    results: xarray.Dataset, scenario: Mapping[str, Any], p_fa: Callable[[str], float]
) -> tuple[Track, Track]:
    fix = results.sel(fix="all")
    raim = RaimMonitor(p_fa=p_fa("RAIM"))
    separation = SolutionSeparationMonitor.of_budget(p_fa("solution separation"))
    freedom = fix["fix_satellites"].values.astype(np.int64) - UNKNOWNS
    apart = separation.over_threshold(values(fix, "separation_sigmas"), fix["separation_modes"].values.astype(np.int64))
    return (
        Track(
            name=raim.name,
            unit=raim.unit,
            p_fa=raim.p_fa,
            statistic=values(fix, "raim_statistic"),
            threshold=chi_square_threshold(freedom, raim.p_fa),
            exact=_normal_errors(scenario),
        ),
        Track(
            name=separation.name,
            unit=separation.unit,
            p_fa=separation.p_fa,
            statistic=apart,
            threshold=np.ones(apart.shape),
            exact=False,
        ),
    )
