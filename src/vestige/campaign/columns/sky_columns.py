"""Compute the additional result columns of a sky: directions of the satellites, position fixes and their errors.

The processor makes two position fixes. The fix `all` uses all E1 pseudoranges at every epoch. At epochs with RECS, the
fix `authenticated` uses the ranges in use of satellites with navigation data that OSNMA authenticates. This fix needs
at least four of these ranges. The time `available_at_s` of this fix is the time at which the OSNMA key of the RECS is
complete. Both fixes assume correct broadcast orbits.

Without an attack and without the table `[atmosphere]`, the errors of E1 pseudoranges are noise, multipath and a
residual of the ionosphere. The residual on E1 is d/(γ − 1), where d is the residual of the delay difference E6 − E1,
and γ is the squared ratio of the carrier frequencies of E1 and E6. The range check compares E6 with E1, so from the
ionosphere only d affects the range check.

The receiver assumes σ² = σ_code²(C/N0) + σ_ionosphere² M(e)² + σ_multipath² A(e)² + σ_floor² for each pseudorange. The
functions M (`obliquity`) and A (`relative_ray_amplitude`) of the elevation e come from `navigation.elevation_model`. A
part of the ionosphere's variance is assumed to be common to all satellites (`ionosphere_common` of `[position]`). The
covariance P of the fix contains the correlation of the errors that follows from this common part. The weights 1/σ²
ignore this correlation, and RAIM and solution separation take σ from the weights.

The NEES, xᵀP⁻¹x, combines the errors x of the three coordinates and of the clock. For a consistent fix, the NEES has a
χ² distribution with 4 degrees of freedom. With multipath the NEES is smaller, because σ_multipath is an upper limit
that also covers rare large errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int64

from vestige.acas_processor.measurement import FixBlock, spread_over_block
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.campaign.plan import Coord, column_table
from vestige.navigation.earth import local_axes_at
from vestige.navigation.position_fix import UNKNOWNS, Fix, dilution, local_geometry
from vestige.receiver.truth import TruthBlock
from vestige.scenario.campaign import CampaignScenario

FIXES = ("all", "authenticated")
_AXES = ("east", "north", "up")
_DILUTIONS = ("geometric", "position", "horizontal", "vertical", "time")
_SATELLITE, _FIX = ("epoch", "satellite"), ("fix", "epoch")

SKY_COLUMNS = column_table(
    ("azimuth_deg", _SATELLITE, "float32", "degree", "azimuth of a satellite in view"),
    ("elevation_deg", _SATELLITE, "float32", "degree", "elevation of a satellite in view"),
    ("e1_sigma_m", _SATELLITE, "float32", "m", "standard deviation assumed for the pseudorange"),
    ("e1_rate_sigma_mps", _SATELLITE, "float32", "m s-1", "standard deviation assumed for the range rate"),
    ("fix_satellites", _FIX, "int8", "1", "satellites in the position fix"),
    ("fix_position_m", (*_FIX, "axis"), "float64", "m", "position, ECEF x, y, z"),
    ("fix_error_m", (*_FIX, "local_axis"), "float64", "m", "estimated minus true position"),
    ("fix_clock_m", _FIX, "float64", "m", "estimated error of the receiver clock"),
    ("fix_clock_error_m", _FIX, "float64", "m", "estimated minus true error of the receiver clock"),
    ("fix_drift_mps", _FIX, "float64", "m s-1", "estimated drift of the receiver clock"),
    ("fix_drift_error_mps", _FIX, "float64", "m s-1", "estimated minus true drift of the receiver clock"),
    ("fix_sigma_m", (*_FIX, "local_axis"), "float32", "m", "standard deviation of the position, as estimated"),
    ("fix_sigma_clock_m", _FIX, "float32", "m", "standard deviation of the clock, as estimated"),
    ("fix_own_sigma_clock_m", _FIX, "float32", "m", "standard deviation of the clock, without common errors"),
    ("fix_sigma_drift_mps", _FIX, "float32", "m s-1", "standard deviation of the drift, as estimated"),
    ("fix_nees", _FIX, "float32", "1", "normalised squared error of position and clock"),
    ("fix_dilution", (*_FIX, "dilution"), "float32", "1", "dilution of precision"),
    ("raim_statistic", _FIX, "float32", "1", "sum of squared residuals over their variances"),
    ("separation_sigmas", (*_FIX, "local_axis"), "float32", "1", "largest solution separation over its 1σ"),
    ("separation_modes", _FIX, "int8", "1", "number of satellites left out in turn for the solution separation"),
    ("available_at_s", _FIX, "float64", "s", "time after the start of the scenario at which the fix is available"),
)


def sky_coords() -> dict[str, Coord]:
    """Return the coordinates of the axes of the position fixes."""
    labels = {"fix": FIXES, "axis": ("x", "y", "z"), "local_axis": _AXES, "dilution": _DILUTIONS}
    texts = {"fix": "satellites of a fix", "axis": "ECEF axis", "local_axis": "local axis", "dilution": "dilution"}
    return {name: Coord(dim=name, values=np.array(values), long_name=texts[name]) for name, values in labels.items()}


def view_columns(truth: Sequence[TruthBlock]) -> dict[str, np.ndarray]:
    """Return azimuth and elevation of the satellites; NaN for satellites out of view."""

    def degrees(name: str) -> Float[np.ndarray, "n m"]:
        return np.stack(
            [np.where(one.geometry.in_view, np.degrees(getattr(one.geometry, name)), np.nan) for one in truth], axis=1
        )

    return {"azimuth_deg": degrees("azimuth_rad"), "elevation_deg": degrees("elevation_rad")}


def fix_columns(
    scenario: CampaignScenario, block: VerdictBlock, columns: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Return the columns of the fixes, and the standard deviations that the receiver assumes for E1 observations."""
    measured, position = block.measured, block.position
    if measured.fix is None or position is None:
        raise ValueError("the position fixes: found none, expected those of a campaign with [constellation]")
    time_s, clock_m = columns["time_s"], columns["truth_clock_m"]
    truth = _Truth(true_place_m(scenario, time_s, clock_m), clock_m, columns["truth_clock_drift_mps"])
    everything: Int64[np.ndarray, " n"] = np.arange(time_s.size)
    of_rows = ((everything, measured.fix), (position.rows, position.fixes))
    fixes = [_fix_columns(rows, fixes, truth) for rows, fixes in of_rows]
    complete_s = np.where(position.used, measured.recs.complete.since(scenario.start_time), -np.inf).max(axis=1)
    known_s = np.where(position.used.any(axis=1), complete_s, np.nan)
    return {
        "e1_sigma_m": measured.fix.sigma_m,
        "e1_rate_sigma_mps": measured.fix.sigma_rate_mps,
        **{name: np.stack([one[name] for one in fixes]) for name in fixes[0]},
        "available_at_s": np.stack([time_s, known_s]),
    }


def true_place_m(
    scenario: CampaignScenario, time_s: Float[np.ndarray, " n"], clock_m: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3"]:
    """Return the true ECEF position of the receiver of a sky in m, at times on the receiver's own clock."""
    return scenario.receiver_motion(time_s, clock_m).position_m


class _Truth(NamedTuple):
    """True position of the receiver, and error and drift of the receiver clock."""

    place_m: Float[np.ndarray, "n 3"]
    clock_m: Float[np.ndarray, " n"]
    drift_mps: Float[np.ndarray, " n"]


def _fix_columns(rows: Int64[np.ndarray, " k"], fixes: FixBlock, truth: _Truth) -> dict[str, np.ndarray]:
    """Return the columns of one fix for all epochs; NaN, or 0 for a count, in epochs that are not in `rows`."""
    fix, (place_m, clock_m, drift_mps) = fixes.fix, (values[rows] for values in truth)
    # epochs without a fix get the true position, so that the local axes are always defined
    placed = replace(fix, position_m=np.where(fix.valid[:, None], fix.position_m, place_m))
    local = dilution(local_geometry(placed))
    error = np.concatenate([fix.position_m - place_m, (fix.clock_m - clock_m)[:, None]], axis=1)
    axes = local_axes_at(place_m)
    found = {
        "fix_satellites": fixes.satellites,
        "fix_position_m": np.where(fix.valid[:, None], fix.position_m, np.nan),
        "fix_error_m": np.einsum("nij,nj->ni", axes, error[:, :3]),
        "fix_clock_m": fix.clock_m,
        "fix_clock_error_m": error[:, 3],
        "fix_drift_mps": np.where(fix.valid, fixes.drift_mps, np.nan),
        "fix_drift_error_mps": np.where(fix.valid, fixes.drift_mps - drift_mps, np.nan),
        "fix_sigma_m": np.sqrt(np.einsum("nqi,nij,nqj->nq", axes, fix.covariance_m2[:, :3, :3], axes)),
        "fix_sigma_clock_m": np.sqrt(fix.covariance_m2[:, 3, 3]),
        "fix_own_sigma_clock_m": fixes.own_sigma_clock_m,
        "fix_sigma_drift_mps": fixes.sigma_drift_mps,
        "fix_nees": _nees(fix, error),
        "fix_dilution": np.stack([getattr(local, name) for name in _DILUTIONS], axis=-1),
        "raim_statistic": fixes.raim_statistic,
        "separation_sigmas": fixes.separation_sigmas,
        "separation_modes": fixes.separation_modes,
    }
    counted = {name: 0.0 for name, values in found.items() if values.dtype.kind == "i"}
    n = truth.clock_m.shape
    return {name: spread_over_block(values, rows, n, counted.get(name, np.nan)) for name, values in found.items()}


def _nees(fix: Fix, error: Float[np.ndarray, "n 4"]) -> Float[np.ndarray, " n"]:
    """Return the NEES, xᵀP⁻¹x, of the errors x; NaN in epochs without a fix."""
    covariance = np.where(fix.valid[:, None, None], fix.covariance_m2, np.eye(UNKNOWNS))
    return np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[..., None])[..., 0])
