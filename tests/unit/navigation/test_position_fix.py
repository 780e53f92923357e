from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import chdtri

from exact_sky import geometry_of_sky
from vestige.navigation.earth import geodetic_from_ecef, local_axes_at
from vestige.navigation.position_fix import (
    Fix,
    Transmission,
    dilution,
    inverse_normal,
    local_geometry,
    position_fix,
    transmission,
    velocity_fix,
)
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.receiver.sky.trajectory import CircularTrajectory
from vestige.streams import stream
from vestige.time import GalileoTime
from whole_sky import Sky, sky

START = GalileoTime(1372, 604_700)  # the week ends after 100 s
TIMES = np.arange(0.0, 200.0, 10.0)
DRIVER = CircularTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=500.0, radius_m=300.0, speed_mps=30.0)
CLOCK_M, DRIFT_MPS = 3e5 * 0.1, 20.0
# clocks as far off as those of real satellites: 0.5 ms are 1.5 m of orbit
ALL = [
    replace(slot, af0_s=5e-4 * (-1) ** slot.svid, af1=1e-11 * slot.svid, bgd_e1_e5b_s=1e-9 * slot.svid)
    for slot in walker_ephemerides(GalileoTime(1372, 604_200))
]


def _scene(times: np.ndarray) -> tuple[Sky, Transmission, np.ndarray, np.ndarray]:
    """A receiver whose clock is 0.1 ms ahead at first and drifts: reading = true time + clock."""
    clock_m = CLOCK_M + DRIFT_MPS * times
    true_s = times - clock_m / 299_792_458.0
    view = sky(ALL, START, true_s, DRIVER.motion(true_s), mask_deg=10.0)
    pseudorange = np.where(view.in_view, view.range_m + clock_m[:, None] - view.satellite_clock_m, np.nan)
    rate = np.where(view.in_view, view.rate_mps + DRIFT_MPS - view.satellite_clock_mps, np.nan)
    sent = transmission([ALL[svid - 1] for svid in view.svids], START, times, pseudorange)
    return view, sent, pseudorange, rate


def test_exact_pseudoranges_give_the_exact_fix_through_the_end_of_a_week() -> None:
    view, sent, pseudorange, rate = _scene(TIMES)
    fix = position_fix(sent, pseudorange, np.full_like(pseudorange, 5.0))
    assert fix.valid.all()
    np.testing.assert_array_equal(fix.n_used, view.in_view.sum(axis=1))
    clock_m = CLOCK_M + DRIFT_MPS * TIMES
    truth = DRIVER.motion(TIMES - clock_m / 299_792_458.0)
    np.testing.assert_allclose(fix.position_m, truth.position_m, atol=1e-6)
    np.testing.assert_allclose(fix.clock_m, clock_m, atol=1e-6)
    assert np.nanmax(np.abs(fix.residual_m)) < 1e-6
    velocity, drift = velocity_fix(sent, fix, rate)
    # a range rate per second of the reading is off by drift/c of 1 km/s
    np.testing.assert_allclose(velocity, truth.velocity_mps, atol=1e-3)
    np.testing.assert_allclose(drift, DRIFT_MPS, atol=1e-3)


def test_the_fix_is_unbiased_and_consistent_through_the_end_of_a_week() -> None:
    """NEES of 4000 fixes against its χ² interval, one-sided 5e-4 a side, and the mean error within 4σ an axis."""
    times = np.repeat(TIMES, 200)
    view, sent, pseudorange, _ = _scene(times)
    sigma = 1.0 + 4.0 * np.cos(view.elevation_rad) ** 2
    noise = sigma * stream(1, "test", "pseudorange").standard_normal(sigma.shape)
    fix = position_fix(sent, pseudorange + noise, sigma)
    clock_m = CLOCK_M + DRIFT_MPS * times
    truth = DRIVER.motion(times - clock_m / 299_792_458.0).position_m
    error = np.concatenate((fix.position_m - truth, (fix.clock_m - clock_m)[:, None]), axis=1)
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(fix.covariance_m2), error)
    n = 4 * times.size
    assert chdtri(n, 1 - 5e-4) < nees.sum() < chdtri(n, 5e-4)
    scaled = error / np.sqrt(np.diagonal(fix.covariance_m2, axis1=1, axis2=2))
    assert np.all(np.abs(scaled.mean(axis=0)) * np.sqrt(times.size) < 4)
    after = times >= 100
    assert chdtri(4 * int(after.sum()), 1 - 5e-4) < nees[after].sum() < chdtri(4 * int(after.sum()), 5e-4)


def test_an_error_that_all_satellites_share_is_the_clocks() -> None:
    """All error common and alike: position without error. In part common and unlike: S Σ Sᵀ, written out."""
    view, sent, pseudorange, _ = _scene(TIMES[:3])
    alike = np.full_like(pseudorange, 5.0)
    shared = position_fix(sent, pseudorange, alike, common_m=alike).covariance_m2
    expected = np.zeros((4, 4))
    expected[3, 3] = 25.0
    np.testing.assert_allclose(shared, np.broadcast_to(expected, shared.shape), atol=1e-9)
    common = 1.5 / (0.3 + np.sin(view.elevation_rad))
    sigma = np.hypot(common, 1.0 + np.arange(len(view.svids)))
    fix = position_fix(sent, pseudorange, sigma, common_m=common)
    for k in range(3):
        up = view.in_view[k]
        h, c = fix.geometry[k, up], common[k, up]
        gain = np.linalg.inv(h.T @ np.diag(sigma[k, up] ** -2) @ h) @ h.T @ np.diag(sigma[k, up] ** -2)
        errors = np.diag(sigma[k, up] ** 2 - c**2) + np.outer(c, c)
        np.testing.assert_allclose(fix.covariance_m2[k], gain @ errors @ gain.T, rtol=1e-7, atol=1e-9)
    alone = position_fix(sent, pseudorange, sigma)
    np.testing.assert_array_equal(fix.position_m, alone.position_m)
    np.testing.assert_array_equal(fix.weight, alone.weight)


def test_velocity_takes_the_weights_of_the_fix() -> None:
    """A range rate that is wrong on one satellite: weighted least squares of the rates, written out by rows."""
    view, sent, pseudorange, rate = _scene(TIMES[:2])
    sigma = np.broadcast_to(1.0 + np.arange(len(view.svids)), pseudorange.shape).astype(np.float64)
    fix = position_fix(sent, pseudorange, sigma)
    true_velocity, true_drift = velocity_fix(sent, fix, rate)
    wrong = np.zeros_like(rate)
    wrong[:, np.flatnonzero(view.in_view.all(axis=0))[1]] = 3.0
    velocity, drift = velocity_fix(sent, fix, rate + wrong)
    for k in range(2):
        up = view.in_view[k]
        root = 1 / sigma[k, up]
        moved, *_ = np.linalg.lstsq(fix.geometry[k, up] * root[:, None], wrong[k, up] * root, rcond=None)
        found = np.append(velocity[k] - true_velocity[k], drift[k] - true_drift[k])
        np.testing.assert_allclose(found, moved, atol=1e-4)  # 1 − u·ṡ/c is 1 to 1e-5


def test_too_few_satellites_are_no_fix_and_do_not_disturb_others() -> None:
    _, sent, pseudorange, rate = _scene(TIMES)
    whole = position_fix(sent, pseudorange, np.full_like(pseudorange, 5.0))
    poor = pseudorange.copy()
    poor[3, np.flatnonzero(np.isfinite(poor[3]))[3:]] = np.nan
    poor[4] = np.nan
    fix = position_fix(sent, poor, np.full_like(poor, 5.0))
    assert not fix.valid[3]
    assert not fix.valid[4]
    assert np.isnan(fix.position_m[3]).all()
    assert np.isnan(fix.residual_m[3]).all()
    others = np.delete(np.arange(TIMES.size), [3, 4])
    np.testing.assert_allclose(fix.position_m[others], whole.position_m[others], atol=1e-7)
    velocity, _ = velocity_fix(sent, fix, rate)
    assert np.isnan(velocity[3]).all()


def test_local_geometry_is_that_of_the_sky() -> None:
    view, sent, pseudorange, _ = _scene(TIMES[:1])
    fix: Fix = position_fix(sent, pseudorange, np.full_like(pseudorange, 5.0))
    nan = np.where(view.in_view, 1.0, np.nan)
    expected = geometry_of_sky(view.azimuth_rad * nan, view.elevation_rad * nan)
    np.testing.assert_allclose(local_geometry(fix), expected, atol=1e-8)
    dop = dilution(expected)
    axes = local_axes_at(fix.position_m)[0]
    local = axes @ fix.covariance_m2[0, :3, :3] @ axes.T / 25.0
    assert dop.vertical[0] == pytest.approx(np.sqrt(local[2, 2]), rel=1e-6)
    assert dop.horizontal[0] == pytest.approx(np.sqrt(local[0, 0] + local[1, 1]), rel=1e-6)
    (latitude,), _, (height,) = geodetic_from_ecef(fix.position_m)
    assert np.degrees(latitude) == pytest.approx(48.0, abs=1e-5)
    assert height == pytest.approx(500.0, abs=0.1)


def test_a_geometry_is_singular_where_its_eigenvalues_say_so() -> None:
    """The lower limit from the determinant decides nothing otherwise than eigenvalues, near the threshold too."""
    rng = stream(0, "geometries")
    directions = rng.standard_normal((2000, 6, 3))
    flat = 10.0 ** rng.uniform(-8, 0, 2000)  # how thick the sky is in one direction: singular below about 1e-5
    directions[..., 2] *= flat[:, None]
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    geometry = np.concatenate((directions, np.ones((2000, 6, 1))), axis=-1)
    geometry[:100, 3:] = 0.0  # three satellites
    geometry[100:150] = 0.0
    weight = np.any(geometry != 0, axis=-1).astype(np.float64)
    eigenvalues = np.linalg.eigvalsh(np.einsum("nmi,nmj->nij", geometry, geometry))
    solvable = eigenvalues[:, 0] > 1e-10 * np.maximum(eigenvalues[:, -1], 1.0)
    assert 500 < np.count_nonzero(solvable) < 1500
    found = inverse_normal(geometry, weight)
    np.testing.assert_array_equal(np.isfinite(found).all(axis=(1, 2)), solvable)
