"""Checks over an hour of a sky meet their budget of false alarms, and what makes those that do not exceed it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest
import xarray
from scipy.special import erfcinv

import campaign_checks
from campaign_checks import chance, checks_of
from sky_builder import CLEAN
from vestige.acas_processor.monitoring.baseline import Observed, Quantity
from vestige.campaign.levels import failures, measured_of
from vestige.campaign.statistics import binomial_test
from vestige.records.checks import CheckName, CheckSeries

P_FA = 0.01
HOUR = ("epochs=3600", "recs.every=5")
NO_IONOSPHERE = ("receiver.ionosphere=none", "position.ionosphere_sigma_m=0.0")


@cache
def results_of(*settings: str) -> xarray.Dataset:
    return campaign_checks.results_of(*settings)


def found_in(*settings: str, p_fa: float = P_FA) -> Mapping[CheckName, CheckSeries]:
    return checks_of(results_of(*settings), p_fa, cn0_model_sigma_db=0.0)


@pytest.mark.judged(by="theory", what="checks over an hour of a sky", figure="P_fa 0.01, two-sided at 1e-6")
def test_false_alarms_meet_their_budget_in_a_clean_world() -> None:
    found = found_in(*CLEAN, *HOUR)
    assert len(found) == 21
    for name, check in found.items():
        failed = failures(check)
        of_recs = name in ("E6 received power", "E6 exhaustive search")
        trials = 100 if name.startswith("OSNMA") else 700 if of_recs else 3500
        assert failed.trials > trials, name
        if check.exact:  # neighbouring epochs share a drift: half as many independent trials
            assert chance(check, 2 if name.startswith("clock") else 1) > 1e-6, name
        elif name != "inertial range rate":  # whose satellites share the oscillator, and all epochs the sensors' bias
            assert failed.low <= check.p_fa, name


def test_the_excess_of_the_floor_is_the_signals_own_share(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ec/N0 of 50 dBHz is 0.084 dB, five times the scatter of the floor."""
    name, strong = CheckName.NOISE_FLOOR, (*CLEAN, *HOUR, "receiver.cn0_dbhz=50.0")
    assert chance(found_in(*strong)[name]) > 1e-3

    def mean_db() -> float:
        _, measured = measured_of(results_of(*strong))
        return float(np.nanmean(Observed(measured=measured).values[Quantity.FLOOR_DB]))

    of_noise_db = mean_db()
    monkeypatch.setattr("vestige.acas_processor.monitoring.baseline.Observed._own_share", lambda *_: 0.0)
    assert 0.02 < mean_db() - of_noise_db < 0.084


def test_the_cn0_keeps_its_budget_beside_rays() -> None:
    check = checks_of(results_of(*NO_IONOSPHERE, *HOUR), P_FA)[CheckName.E1_CN0]
    assert not check.exact
    assert failures(check).high < P_FA


@pytest.mark.parametrize(("sigma_m", "enough"), [(0.9, False), (1.8, True)])
def test_the_excess_of_raim_and_clock_under_rays_is_a_sigma_that_bounds_no_tails(sigma_m: float, enough: bool) -> None:
    found = found_in(*NO_IONOSPHERE, *HOUR, f"position.multipath_sigma_m={sigma_m}", p_fa=1e-3)
    for name in ("RAIM", "clock consistency"):
        check = found[CheckName(name)]
        assert (failures(check).value <= check.p_fa) is enough, name


def test_the_excess_of_the_inertial_check_is_what_its_trials_share() -> None:
    """One satellite alone and sensors without bias leave trials that only share the range rate at their ends."""
    sound = ("receiver.accelerometers.sigma_bias_mps2=0.0", "processor.inertial.sigma_bias_mps2=0.0")
    check = found_in(*CLEAN, *HOUR, *sound)[CheckName.INERTIAL_RANGE_RATE]
    for column in range(8):
        failed = int(np.count_nonzero(check.failed[:, column]))
        assert binomial_test(failed, int(np.count_nonzero(check.run[:, column])), check.p_fa) > 1e-5


def test_the_separation_keeps_the_budget_that_is_asked_for() -> None:
    """Half of it is vertical, whose K is the least: √2 erfc⁻¹(p/2/8); the largest separation in σ knows no budget."""
    results, statistics = results_of(*CLEAN, *HOUR), {}
    sigmas = results["separation_sigmas"].sel(fix="all", local_axis="up").values.astype(np.float64)
    for p_fa in (1e-7, 9.6e-7, 0.01):
        check = checks_of(results, p_fa)[CheckName.SOLUTION_SEPARATION]
        assert check.p_fa == pytest.approx(p_fa)
        assert np.all(check.threshold == 1)
        statistics[p_fa] = check.statistic
        np.testing.assert_allclose(check.statistic, sigmas / (np.sqrt(2) * erfcinv(p_fa / 16)), rtol=1e-5)
    failed = np.count_nonzero(statistics[0.01] > 1)
    assert 0.3 * 0.01 * sigmas.size < failed < 0.01 * sigmas.size
    assert not np.any(statistics[1e-7] > 1)
