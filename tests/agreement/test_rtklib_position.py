"""The files of `vestige rinex` in `rnx2rtkp` of RTKLIB: out comes the true position, a faulty satellite or not.

Debian has it in the package `rtklib`. It weighs satellites nearly evenly, for its settings believe in metres of error
that we have not. So the error budget is that of even weights, S Σ Sᵀ with S = (HᵀH)⁻¹Hᵀ and Σ what our receiver
believes of each pseudorange. Statistics of fixed seeds, each two-sided at 1e-6.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray
from scipy.special import chdtri

from exact_sky import geometry_of_sky
from night import invoke
from real_ephemerides import ECCENTRIC, recorded_ephemerides
from sky_builder import CLEAN, SCENARIO, sky_scenario
from vestige.campaign.rinex_export import COMMAND
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.cli.services.rinex import command as rinex
from vestige.navigation.earth import ecef_from_geodetic, local_axes_at
from vestige.recording.navigation.rinex_navigation import write_rinex_navigation

ALL_SATELLITES = "constellation.svids=none"
WEEKS_END = 'start="2026-11-21T23:57:00 GST"'  # week 1422 begins in the middle of 90 epochs
SIX_MINUTES = ("epochs=90", "interval_s=4.0", "recs.every=15")  # the loops forget in 4 s

Solved = tuple[xarray.Dataset, np.ndarray, np.ndarray]


@pytest.fixture
def solve(tmp_path: Path) -> Callable[..., Solved]:
    """Return what runs `sky.toml` with some settings: results, RTKLIB's errors east, north, up, satellites used."""
    program = shutil.which("rnx2rtkp")
    if program is None:
        pytest.skip("needs rnx2rtkp of RTKLIB")

    def solved(*settings: str, path: Path = SCENARIO) -> Solved:
        scenario = sky_scenario(*settings, path=path)
        results = run(ScenarioPlan(scenario=scenario), tmp_path / "sky.zarr", executor="threads")
        written = invoke(rinex, tmp_path / "sky.zarr", "-o", tmp_path / "sky")
        assert written.exception is None
        assert COMMAND in written.stderr
        command = [program, *COMMAND.split()[1:]]
        subprocess.run(command, cwd=tmp_path / "sky", check=True, capture_output=True)  # noqa: S603
        text = (tmp_path / "sky" / "position.pos").read_text().splitlines()
        rows = np.array([[float(value) for value in line.split()[2:7]] for line in text if not line.startswith("%")])
        place = scenario.trajectory
        truth = ecef_from_geodetic(
            *np.radians([[place.latitude_deg], [place.longitude_deg]]), np.array([place.height_m])
        )
        return results, (rows[:, :3] - truth) @ local_axes_at(truth)[0].T, rows[:, 4]

    return solved


def _budget_m(results: xarray.Dataset, used: np.ndarray | None = None) -> np.ndarray:
    """Return the standard deviation of each axis at each epoch, of even weights."""
    azimuth, elevation = (np.radians(results[f"{name}_deg"].values) for name in ("azimuth", "elevation"))
    used = np.isfinite(elevation) if used is None else used
    gain = np.stack([np.linalg.pinv(h) for h in np.where(used[..., None], geometry_of_sky(azimuth, elevation), 0.0)])
    return np.sqrt(np.einsum("nqm,nm->nq", gain**2, np.where(used, results["e1_sigma_m"].values, 0.0) ** 2))[:, :3]


def _check_normal(error_m: np.ndarray, sigma_m: np.ndarray) -> None:
    """Check that errors of independent epochs have mean zero and the standard deviation that is expected."""
    n = len(error_m)
    scaled = error_m / sigma_m
    assert np.all(np.abs(scaled.mean(axis=0)) * np.sqrt(n) < 4.9)
    assert np.all(np.sum(scaled**2, axis=0) < chdtri(n, 5e-7))
    assert np.all(np.sum(scaled**2, axis=0) > chdtri(n, 1 - 5e-7))


@pytest.mark.judged(
    by="RTKLIB",
    what="RINEX of a simulated sky",
    figure="true position in 90 epochs, through the end of a week",
)
def test_the_true_position_through_a_weeks_end(solve: Callable[..., Solved]) -> None:
    results, error_m, n_used = solve(*CLEAN, *SIX_MINUTES, WEEKS_END, ALL_SATELLITES)
    assert len(error_m) == 90
    assert np.array_equal(n_used, results["fix_satellites"].sel(fix="all").values)
    assert results["svid"].size > 8  # one sets
    _check_normal(error_m, _budget_m(results))


@pytest.mark.judged(
    by="RTKLIB",
    what="error budget of a sky with ionosphere and multipath",
    figure="no axis beyond 5 σ in 240 epochs",
)
def test_with_ionosphere_and_rays_within_the_budget(solve: Callable[..., Solved]) -> None:
    """These errors last, so no mean: no axis at any of four minutes' epochs is out by 5 σ."""
    results, error_m, _ = solve("epochs=240", WEEKS_END, ALL_SATELLITES)
    assert len(error_m) == 240
    assert np.all(np.abs(error_m) < 5 * _budget_m(results))


@pytest.mark.judged(
    by="RTKLIB",
    what="a satellite that is pulled away",
    figure="RAIM of RTKLIB excludes the satellite and uses the other 7",
)
def test_raim_of_rtklib_leaves_out_a_satellite_that_is_pulled_away(solve: Callable[..., Solved]) -> None:
    attack = (
        'attack=[{kind="position-push", svids=[7], start_s=20, power_db=10, '
        'delay_m={kind="ramp", first=0, last=250, start_s=20, stop_s=120}}]'
    )
    results, error_m, n_used = solve(*CLEAN, *SIX_MINUTES, attack)
    pulled = results["truth_e1_error_m"].values[:, list(results["svid"].values).index(7)] > 200
    assert np.count_nonzero(pulled) > 40
    assert np.all(n_used[pulled] == 7)
    others = np.broadcast_to(results["svid"].values != 7, results["elevation_deg"].shape)
    _check_normal(error_m[pulled], _budget_m(results, others)[pulled])


def test_real_orbits_and_clocks(solve: Callable[..., Solved], osnma_data: Path, tmp_path: Path) -> None:
    """Broadcast orbits with harmonics, clocks that are off by up to a millisecond, the group delay E1-E5b."""
    orbits = [one for svid, one in recorded_ephemerides(osnma_data).items() if svid != ECCENTRIC]
    assert max(abs(one.af0_s) for one in orbits) > 1e-4
    write_rinex_navigation(tmp_path / "day.rnx", orbits)
    text = SCENARIO.read_text(encoding="utf-8").replace('kind = "walker"', 'kind = "rinex"\npath = "day.rnx"')
    (tmp_path / "day.toml").write_text(text, encoding="utf-8")
    start = f'start="{orbits[0].toe + 5400.0}"'
    results, error_m, n_used = solve(*CLEAN, *SIX_MINUTES, start, ALL_SATELLITES, path=tmp_path / "day.toml")
    assert len(error_m) == 90
    assert np.array_equal(n_used, results["fix_satellites"].sel(fix="all").values)
    _check_normal(error_m, _budget_m(results))
