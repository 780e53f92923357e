"""What the results hold beside the ordinary columns under a sky: E1 observations of all satellites, position fixes.

The receiver fixes its position at every epoch from all E1 pseudoranges, and at every epoch with RECS from those of the
satellites whose E6 was authentic and whose navigation data OSNMA authenticates. The second is known when the OSNMA key
is: `available_at_s`. Both take the broadcast orbits for right. E1 holds, beside noise and multipath, the ionosphere's
residual e/(γ − 1) that belongs to the e of E6 − E1; it is common to both bands and no part of the range check.

The receiver believes σ² = σ_code²(C/N0) + σ_ionosphere² M(e)² + σ_multipath² A(e)² + σ_floor² of each pseudorange, with
M and A of `receiver.elevation`, and that a share of the ionosphere's variance is common to all (`ionosphere_common` of
`[position]`). The covariance P of the fix knows of that share; the weights do not, nor do RAIM and solution separation,
whose σ are of what residuals show. The NEES, xᵀP⁻¹x, is of the errors of the three coordinates and the clock; of a
consistent fix it is χ² with 4 degrees of freedom. With rays it is less: σ_multipath bounds their tails.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from vestige.acas_processor.monitors.raim_check import RaimMonitor, largest_separations
from vestige.campaign.osnma_columns import osnma_columns
from vestige.campaign.plan import Column, Coord
from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import local_axes_at
from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.position_fix import (
    UNKNOWNS,
    Fix,
    Transmission,
    dilution,
    inverse_normal,
    local_geometry,
    position_fix,
    static_range_rate,
    transmission,
    velocity_fix,
)
from vestige.navigation.raim import redundancy
from vestige.receiver.e1_loop import LOCK_DBHZ
from vestige.receiver.e1_samples import sampled_e1_taps, sampled_power_rise_db
from vestige.receiver.e1_taps import TAP_CHIPS, e1_taps, power_noise_db, power_rise_db
from vestige.receiver.elevation import obliquity, ray_amplitude
from vestige.receiver.simulation import Simulation
from vestige.receiver.tracking_noise import noise_growth
from vestige.receiver.trajectory import Trajectory
from vestige.receiver.truth import TruthBlock
from vestige.records import Status
from vestige.scenario.campaign import CampaignScenario

FIXES = ("all", "authenticated")
_AXES = ("east", "north", "up")
_DILUTIONS = ("geometric", "position", "horizontal", "vertical", "time")
_E1_OF_DIFFERENCE = 1 / ((E1_CARRIER_HZ / E6_CARRIER_HZ) ** 2 - 1)  # 1/(γ − 1)
_EPOCH, _SATELLITE, _FIX = ("epoch",), ("epoch", "satellite"), ("fix", "epoch")

# name: dims, dtype, units, meaning
SKY_COLUMNS = {
    name: Column(dims=dims, dtype=dtype, units=units, long_name=text)
    for name, dims, dtype, units, text in (
        ("recs", _EPOCH, "bool", "1", "whether a RECS is sent"),
        ("azimuth_deg", _SATELLITE, "float32", "degree", "azimuth of a satellite in view"),
        ("elevation_deg", _SATELLITE, "float32", "degree", "elevation of a satellite in view"),
        ("e1_pseudorange_m", _SATELLITE, "float64", "m", "E1 pseudorange"),
        ("e1_range_rate_mps", _SATELLITE, "float64", "m s-1", "its rate, from the Doppler"),
        ("e1_sigma_m", _SATELLITE, "float32", "m", "standard deviation that the receiver believes of it"),
        ("e1_rate_sigma_mps", _SATELLITE, "float32", "m s-1", "standard deviation of its rate"),
        ("e1_standing_rate_mps", _SATELLITE, "float64", "m s-1", "its rate if receiver and receiver clock stood still"),
        ("e1_cn0_dbhz", _SATELLITE, "float32", "dB Hz", "C/N0 that E1 tracking reports"),
        ("e1_taps", (*_SATELLITE, "e1_tap"), "complex64", "1", "E1 correlators; noise without interference is 1"),
        ("e1_power_db", _EPOCH, "float32", "dB", "power of the E1 band over that without attack"),
        ("osnma_due", _EPOCH, "int16", "1", "I/NAV pages that were due since the epoch before, by bits"),
        ("osnma_pages", _SATELLITE, "int16", "1", "those of them that were received, by bits"),
        ("osnma_differs", _SATELLITE, "bool", "1", "whether their data are not what the satellite sent"),
        ("osnma_data", _SATELLITE, "bool", "1", "whether that key authenticates its navigation data"),
        ("osnma_key", _EPOCH, "bool", "1", "whether the OSNMA key of a RECS of this epoch is received"),
        ("gained_mps", ("epoch", "local_axis"), "float64", "m s-1", "velocity gained, as accelerometers say"),
        ("fix_satellites", _FIX, "int8", "1", "satellites in the position fix"),
        ("fix_position_m", (*_FIX, "axis"), "float64", "m", "position, ECEF x, y, z"),
        ("fix_error_m", (*_FIX, "local_axis"), "float64", "m", "error of the position"),
        ("fix_clock_m", _FIX, "float64", "m", "receiver clock"),
        ("fix_clock_error_m", _FIX, "float64", "m", "error of the receiver clock"),
        ("fix_drift_mps", _FIX, "float64", "m s-1", "receiver clock drift"),
        ("fix_drift_error_mps", _FIX, "float64", "m s-1", "error of the receiver clock drift"),
        ("fix_sigma_m", (*_FIX, "local_axis"), "float32", "m", "standard deviation that the receiver believes of it"),
        ("fix_sigma_clock_m", _FIX, "float32", "m", "standard deviation that the receiver believes of its clock"),
        ("fix_own_sigma_clock_m", _FIX, "float32", "m", "the same if no error were common to the satellites"),
        ("fix_sigma_drift_mps", _FIX, "float32", "m s-1", "standard deviation that it believes of the drift"),
        ("fix_nees", _FIX, "float32", "1", "normalised squared error of position and clock"),
        ("fix_dilution", (*_FIX, "dilution"), "float32", "1", "dilution of precision"),
        ("raim_statistic", _FIX, "float32", "1", "sum of squared residuals over their variances"),
        ("separation_sigmas", (*_FIX, "local_axis"), "float32", "1", "largest solution separation over its deviation"),
        ("separation_modes", _FIX, "int8", "1", "satellites that were left out in turn for it"),
        ("available_at_s", _FIX, "float64", "s", "when the fix can be known, after the start"),
    )
}

E1_COLUMNS = {name: SKY_COLUMNS[name] for name in ("e1_cn0_dbhz", "e1_taps", "e1_power_db")}


def e1_coords() -> dict[str, Coord]:
    """Return the axis of the E1 correlators."""
    taps = Coord(dim="e1_tap", values=np.array(TAP_CHIPS), units="1", long_name="chips of E1 after where it is tracked")
    return {"e1_tap_chips": taps}


def sky_coords() -> dict[str, Coord]:
    """Return the axes of the fixes."""
    labels = {"fix": FIXES, "axis": ("x", "y", "z"), "local_axis": _AXES, "dilution": _DILUTIONS}
    texts = {"fix": "satellites of a fix", "axis": "ECEF axis", "local_axis": "local axis", "dilution": "dilution"}
    return {
        name: Coord(dim=name, values=np.array(values), units="1", long_name=texts[name])
        for name, values in labels.items()
    }


def sky_columns(
    scenario: CampaignScenario, first: int, truth: Sequence[TruthBlock], together: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Return the values of `SKY_COLUMNS`; what is of a satellite out of view is NaN in the other columns, too.

    Parameters
    ----------
    scenario, first
        The campaign, and the number of the first epoch.
    truth
        Of each satellite.
    together
        The ordinary columns.
    """
    simulations = scenario.simulations
    time_s, clock_m = truth[0].time_s, truth[0].clock_m
    recs = (first + np.arange(time_s.size)) % scenario.recs.every == 0
    view = _stacked([one.view.in_view for one in truth])
    observed = _observations(scenario, simulations, truth)
    tracked = view & (observed["e1_cn0_dbhz"] > LOCK_DBHZ)
    seen = {name: np.where(view, values, np.nan) for name, values in observed.items()}
    authentic = together["status"] == list(Status).index(Status.AUTHENTIC)
    ephemerides = [one.elevation.path.ephemeris for one in simulations if one.elevation is not None]
    trajectory = next(one.elevation.path.trajectory for one in simulations if one.elevation is not None)
    ahead_s = clock_m / SPEED_OF_LIGHT_MPS
    sent = _transmission(scenario, ephemerides, time_s, seen["e1_pseudorange_m"])
    place_m = trajectory.motion(time_s - ahead_s).position_m
    drift_mps = truth[0].clock_drift_mps
    osnma = osnma_columns(scenario, truth)
    common_m = _common_m(scenario, truth)
    fixes = [
        _fix_columns(scenario, sent, seen, used, common_m, place_m=place_m, clock_m=clock_m, drift_mps=drift_mps)
        for used in (tracked, tracked & authentic & osnma["osnma_data"] & recs[:, None])
    ]
    columns = {name: np.stack([one[name] for one in fixes]) for name in fixes[0]}
    known_s = np.where(columns["fix_satellites"][1] > 0, _key_times(simulations[0], scenario, first, recs), np.nan)
    return {
        "recs": recs,
        **seen,
        **e1_columns(scenario, first, truth, view),
        **osnma,
        **columns,
        "e1_standing_rate_mps": columns["e1_standing_rate_mps"][0],
        "gained_mps": _gained_mps(scenario, trajectory, time_s, first),
        "available_at_s": np.stack([time_s, known_s]),
    }


def _gained_mps(
    scenario: CampaignScenario, trajectory: Trajectory, time_s: Float[np.ndarray, " n"], first: int
) -> Float[np.ndarray, "n 3"]:
    """Return what the accelerometers say; NaN without them."""
    sensor = scenario.receiver.accelerometers
    if sensor is None:
        return np.full((time_s.size, 3), np.nan)
    return sensor.gained_mps(trajectory, time_s, scenario.interval_s, seed=scenario.seed, first=first)


def _observations(
    scenario: CampaignScenario, simulations: Sequence[Simulation], truth: Sequence[TruthBlock]
) -> dict[str, Float[np.ndarray, "n m"]]:
    """Return what E1 tracking says of each satellite, in view or not."""
    model, table = scenario.receiver.e1_tracking, scenario.position
    columns: dict[str, list[np.ndarray]] = {}
    for simulation, one in zip(simulations, truth, strict=True):
        gain_db = 10 * np.log10(one.e1.gain) + 20 * np.log10(one.view.amplitude)
        error_m = one.e1_noise_m + simulation.e1_multipath_m(one) + one.e1.error_m
        nominal_dbhz = simulation.cn0_e1_dbhz
        code_m = rate_mps = np.zeros(gain_db.size)
        if model is not None:
            code, doppler = noise_growth(model, nominal_dbhz, gain_db)
            code_m = model.code_sigma_m(nominal_dbhz) * code
            rate_mps = model.doppler_sigma_hz(nominal_dbhz) * doppler * SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ
        ionosphere_m = table.ionosphere_sigma_m * obliquity(one.view.elevation_rad)
        multipath_m = table.multipath_sigma_m * ray_amplitude(one.view.elevation_rad)
        values = {
            "azimuth_deg": np.degrees(one.view.azimuth_rad),
            "elevation_deg": np.degrees(one.view.elevation_rad),
            "e1_pseudorange_m": one.range_m + one.clock_m + _E1_OF_DIFFERENCE * one.iono_diff_m + error_m,
            "e1_range_rate_mps": one.rate_mps + one.clock_drift_mps + one.e1_rate_noise_mps + one.e1.rate_error_mps,
            "e1_sigma_m": np.sqrt(code_m**2 + ionosphere_m**2 + multipath_m**2 + table.floor_sigma_m**2),
            "e1_cn0_dbhz": nominal_dbhz + gain_db,
            "e1_rate_sigma_mps": rate_mps,
        }
        for name, column in values.items():
            columns.setdefault(name, []).append(column)
    return {name: _stacked(values) for name, values in columns.items()}


def _common_m(scenario: CampaignScenario, truth: Sequence[TruthBlock]) -> Float[np.ndarray, "n m"]:
    """Return what the common part of the ionosphere, as the receiver believes in it, adds to each pseudorange."""
    table = scenario.position
    sigma_m = np.sqrt(table.ionosphere_common) * table.ionosphere_sigma_m
    return sigma_m * _stacked([obliquity(one.view.elevation_rad) for one in truth])


def e1_columns(
    scenario: CampaignScenario, first: int, truth: Sequence[TruthBlock], view: Bool[np.ndarray, "n m"]
) -> dict[str, np.ndarray]:
    """Return correlators and power of E1, behind the gain control."""
    simulations = scenario.simulations
    cn0_dbhz = _stacked(
        [
            simulation.cn0_e1_dbhz + 20 * np.log10(one.view.amplitude)
            for simulation, one in zip(simulations, truth, strict=True)
        ]
    )
    seen_dbhz = np.where(view, cn0_dbhz, np.nan)
    sampled = scenario.fidelity == "samples"
    if sampled:
        svids = tuple(simulation.svid for simulation in simulations)
        rise_db = read_db = sampled_power_rise_db(truth, seen_dbhz, svids, seed=scenario.seed, first=first)
    else:
        rise_db = power_rise_db(truth, seen_dbhz)
        read_db = rise_db + power_noise_db(scenario.seed, first, rise_db.size)
    taps = [
        (sampled_e1_taps if sampled else e1_taps)(
            one,
            cn0_dbhz[:, column],
            simulation.e1_multipath_m(one),
            with_rays=simulation.models.e1_multipath,
            seed=scenario.seed,
            svid=simulation.svid,
            first=first,
        )
        for column, (simulation, one) in enumerate(zip(simulations, truth, strict=True))
    ]
    gained = _stacked(taps) * 10 ** (-rise_db / 20)[:, None, None]
    return {
        "e1_taps": np.where(view[..., None], gained, np.nan),
        "e1_power_db": read_db,
    }


def _transmission(
    scenario: CampaignScenario,
    ephemerides: Sequence[Ephemeris],
    time_s: Float[np.ndarray, " n"],
    pseudorange_m: Float[np.ndarray, "n m"],
) -> Transmission:
    typical_m = np.where(np.isfinite(pseudorange_m), pseudorange_m, 0.0)
    return transmission(ephemerides, scenario.start_time, time_s, typical_m)


def _fix_columns(
    scenario: CampaignScenario,
    sent: Transmission,
    seen: Mapping[str, Float[np.ndarray, "n m"]],
    used: Bool[np.ndarray, "n m"],
    common_m: Float[np.ndarray, "n m"],
    *,
    place_m: Float[np.ndarray, "n 3"],
    clock_m: Float[np.ndarray, " n"],
    drift_mps: Float[np.ndarray, " n"],
) -> dict[str, np.ndarray]:
    """Return the columns of one fix of all epochs, from the satellites that are used."""
    range_m = np.where(used, seen["e1_pseudorange_m"], np.nan)
    fix = position_fix(sent, range_m, seen["e1_sigma_m"].astype(np.float64), common_m=common_m)
    _, found_drift_mps = velocity_fix(sent, fix, seen["e1_range_rate_mps"])
    placed = _placed(fix, place_m)
    local, (sigmas, modes) = dilution(local_geometry(placed)), largest_separations(placed)
    error = np.concatenate([fix.position_m - place_m, (fix.clock_m - clock_m)[:, None]], axis=1)
    axes = local_axes_at(place_m)
    return {
        "e1_standing_rate_mps": static_range_rate(sent, fix),
        "fix_satellites": np.where(fix.valid, fix.n_used, 0),
        "fix_position_m": np.where(fix.valid[:, None], fix.position_m, np.nan),
        "fix_error_m": np.einsum("nij,nj->ni", axes, error[:, :3]),
        "fix_clock_m": fix.clock_m,
        "fix_clock_error_m": error[:, 3],
        "fix_drift_mps": np.where(fix.valid, found_drift_mps, np.nan),
        "fix_drift_error_mps": np.where(fix.valid, found_drift_mps - drift_mps, np.nan),
        "fix_sigma_m": np.sqrt(np.einsum("nqi,nij,nqj->nq", axes, fix.covariance_m2[:, :3, :3], axes)),
        "fix_sigma_clock_m": np.sqrt(fix.covariance_m2[:, 3, 3]),
        "fix_own_sigma_clock_m": np.sqrt(inverse_normal(fix.geometry, fix.weight)[:, 3, 3]),
        "fix_sigma_drift_mps": np.sqrt(_drift_variance(fix, seen["e1_rate_sigma_mps"])),
        "fix_nees": _nees(fix, error),
        "fix_dilution": np.stack([getattr(local, name) for name in _DILUTIONS], axis=-1),
        "raim_statistic": RaimMonitor(p_fa=scenario.position.p_fa).statistic(fix),
        "separation_sigmas": sigmas,
        "separation_modes": modes,
    }


def _placed(fix: Fix, place_m: Float[np.ndarray, "n 3"]) -> Fix:
    """Return the fixes with the true place where there is none, for axes that are always defined."""
    return replace(fix, position_m=np.where(fix.valid[:, None], fix.position_m, place_m))


def _drift_variance(fix: Fix, sigma_mps: Float[np.ndarray, "n m"]) -> Float[np.ndarray, " n"]:
    """Return the variance of the clock's drift from that of the range rates."""
    share = redundancy(fix.geometry, fix.weight).gain[:, 3]
    return np.sum(np.where(fix.weight > 0, share * sigma_mps, 0.0) ** 2, axis=1) + 0 * fix.clock_m


def _nees(fix: Fix, error: Float[np.ndarray, "n 4"]) -> Float[np.ndarray, " n"]:
    """Return eᵀP⁻¹e, NaN without a fix."""
    covariance = np.where(fix.valid[:, None, None], fix.covariance_m2, np.eye(UNKNOWNS))
    return np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[..., None])[..., 0])


def _key_times(
    simulation: Simulation, scenario: CampaignScenario, first: int, recs: Bool[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return when the key of each RECS is complete, in s after the start; NaN in epochs without RECS."""
    times_s = np.full(recs.size, np.nan)
    for row in np.flatnonzero(recs):
        key = simulation.key(simulation.transmit_time((first + int(row)) // scenario.recs.every))
        times_s[row] = key.complete_at - scenario.start_time
    return times_s


def _stacked(columns: Sequence[np.ndarray]) -> np.ndarray:
    return np.stack(columns, axis=1)
