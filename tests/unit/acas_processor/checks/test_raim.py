from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import erfcinv

from evidence_builder import evidence, fix_block, outcome
from vestige.acas_processor.checks.check import Check
from vestige.acas_processor.checks.raim import RaimMonitor, raim_statistic
from vestige.acas_processor.checks.solution_separation import SolutionSeparationMonitor, largest_separations
from vestige.campaign.statistics import binomial_test
from vestige.navigation.position_fix import Fix, local_geometry, position_fix, transmission
from vestige.navigation.raim import redundancy, solution_separation
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.records import CheckResult, Outcome
from vestige.streams import stream
from vestige.time import GalileoTime
from whole_sky import sky

START = GalileoTime(1373, 0)
ALL = walker_ephemerides(START)
SIGMA_M = 5.0
LEVEL = 1e-4


def _fixes(
    n: int, *, bias_m: float = 0.0, column: int = 0, common_m: float = 0.0, keep: int = 99
) -> tuple[Fix, tuple[int, ...]]:
    """n fixes of one sky with independent errors."""
    times = np.zeros(n)
    motion = StaticTrajectory(latitude_deg=45.0, longitude_deg=8.0).motion(times[:1])
    view = sky(ALL, START, times[:1], motion, mask_deg=10.0)
    pseudorange = (view.range_m - view.satellite_clock_m)[:, :keep]
    svids = view.svids[:keep]
    sent = transmission([ALL[svid - 1] for svid in svids], START, times[:1], pseudorange)
    noise = SIGMA_M * stream(5, "raim check").standard_normal((n, len(svids)))
    noise[:, column] += bias_m
    repeated = type(sent)(**{name: np.repeat(getattr(sent, name), n, axis=0) for name in sent.__slots__})
    measured = np.repeat(pseudorange, n, axis=0) + noise + common_m
    return position_fix(repeated, measured, np.full_like(measured, SIGMA_M)), svids


@pytest.mark.parametrize("bias_m", [0.0, 30.0])
def test_rate_of_alarms(bias_m: float) -> None:
    n, column = 20_000, 2
    monitor = RaimMonitor(p_fa=0.01)
    fix, _ = _fixes(n, bias_m=bias_m, column=column)
    alarms = int(np.count_nonzero(raim_statistic(fix) > monitor.threshold(fix)))
    expected = float(monitor.probability_of_detection(fix, column, np.array([bias_m]))[0])
    assert binomial_test(alarms, n, expected) > LEVEL
    assert (expected == pytest.approx(0.01)) is (bias_m == 0.0)


def test_rate_of_alarms_of_the_separation() -> None:
    """The modes depend on each other, so the budget is a bound; with eight satellites it is nearly reached."""
    n = 20_000
    monitor = SolutionSeparationMonitor(p_fa_horizontal=0.002, p_fa_vertical=0.02)
    fix, _ = _fixes(n)
    alarms = int(np.count_nonzero(monitor.statistic(fix) > 1.0))
    assert 0.6 * monitor.p_fa * n < alarms < monitor.p_fa * n


def test_the_budget_of_each_axis_is_shared_by_the_modes() -> None:
    """Each horizontal axis has half of 9e-8, the vertical one 3.9e-6; seven modes, two-sided: erfc(K/√2) = p/7."""
    fix, _ = _fixes(3)
    monitor = SolutionSeparationMonitor()
    found = solution_separation(redundancy(local_geometry(fix), fix.weight), fix.residual_m, fix.weight)
    assert fix.n_used.tolist() == [7, 7, 7]
    factor = np.abs(found.difference_m[:, :3]) / found.sigma_m[:, :3] / monitor.ratios(fix)
    expected = np.sqrt(2) * erfcinv(np.array([4.5e-8, 4.5e-8, 3.9e-6]) / 7)[:, None]
    np.testing.assert_allclose(factor, np.broadcast_to(expected, factor.shape), rtol=1e-6)


def test_detection_by_the_separation() -> None:
    """A lower bound, and a close one: when another satellite shows the bias, this one nearly always does as well."""
    n, column, bias_m = 20_000, 2, 25.0
    monitor = SolutionSeparationMonitor(p_fa_horizontal=1e-4, p_fa_vertical=1e-3)
    fix, _ = _fixes(n, bias_m=bias_m, column=column)
    seen = np.count_nonzero(monitor.statistic(fix) > 1.0) / n
    bound = float(monitor.probability_of_detection(fix, column, np.array([bias_m]))[0])
    assert 0.2 < bound < 0.95
    assert bound - 0.015 < seen < bound + 0.05


def _of(monitor: Check, fix: Fix | None, svids: tuple[int, ...], epoch: int = 0) -> CheckResult:
    if fix is None:
        return outcome(monitor, evidence((1, len(svids)), svids=svids))
    sigmas, modes = largest_separations(fix)
    found = fix_block(
        fix, raim_statistic=raim_statistic(fix), separation_sigmas=sigmas, separation_modes=modes.astype(np.int64)
    )
    return outcome(monitor, evidence(fix.residual_m.shape, fix=found, svids=svids), epoch)


def test_a_common_push_is_not_seen() -> None:
    quiet, svids = _fixes(3)
    pushed, _ = _fixes(3, common_m=600.0)
    np.testing.assert_allclose(raim_statistic(pushed), raim_statistic(quiet), rtol=1e-4)
    assert _of(RaimMonitor(), pushed, svids).outcome is Outcome.PASS
    np.testing.assert_allclose(pushed.clock_m - quiet.clock_m, 600.0, atol=1e-2)


def test_the_reason_names_the_satellite() -> None:
    fix, svids = _fixes(2, bias_m=400.0, column=3)
    failed = _of(RaimMonitor(), fix, svids, epoch=1)
    assert failed.outcome is Outcome.FAIL
    assert failed.reason == f"the pseudoranges do not agree; without E{svids[3]:02d} they do"
    separated = _of(SolutionSeparationMonitor(), fix, svids, epoch=1)
    assert (separated.outcome, separated.threshold) == (Outcome.FAIL, 1.0)
    assert f"without E{svids[3]:02d} the position moves too far" in separated.reason


def test_checks_that_cannot_run() -> None:
    four, svids = _fixes(1, keep=4)
    assert _of(RaimMonitor(), four, svids).reason == "4 satellites give a position, but no further range to compare"
    assert _of(SolutionSeparationMonitor(), four, svids).outcome is Outcome.NOT_RUN
    three, svids = _fixes(1, keep=3)
    assert _of(RaimMonitor(), three, svids).reason == "no position fix"
    assert _of(SolutionSeparationMonitor(), None, svids).reason == "no position fix"
    assert _of(RaimMonitor(), None, svids).outcome is Outcome.NOT_RUN
    assert math.isnan(raim_statistic(four)[0])
    assert math.isnan(raim_statistic(three)[0])
    assert math.isnan(SolutionSeparationMonitor().statistic(three)[0])
