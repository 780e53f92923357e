"""Checks over an hour of a sky meet their budget of false alarms, and what makes those that do not exceed it."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import xarray
from scipy.special import erfcinv
from tests.sky_builder import CLEAN, sky_scenario

from vestige.campaign.monitoring import Track, tracks
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import binomial_test

P_FA = 0.01


@cache
def results_of(*settings: str) -> xarray.Dataset:
    with TemporaryDirectory() as folder:
        return run(ScenarioPlan(scenario=sky_scenario(*settings)), Path(folder) / "sky").load()


def tracks_of(*settings: str, p_fa: float = P_FA) -> dict[str, Track]:
    return {one.name: one for one in tracks(results_of(*settings), p_fa=p_fa, cn0_model_sigma_db=0.0)}


HOUR = ("epochs=3600", "recs.every=5")
NO_IONOSPHERE = ("receiver.ionosphere=none", "position.ionosphere_sigma_m=0.0")


def chance(track: Track, share: int = 1) -> float:
    """Return how likely so many alarms are; of tests that depend on each other only one in `share` counts."""
    return binomial_test(track.alarms.successes // share, track.alarms.trials // share, track.p_fa)


def test_false_alarms_meet_their_budget_in_a_clean_world() -> None:
    found = tracks_of(*CLEAN, *HOUR)
    assert len(found) == 20
    for name, track in found.items():
        alarms = track.alarms
        trials = 100 if name.startswith("OSNMA") else 700 if name == "E6 received power" else 3500
        assert alarms.trials > trials, name
        if track.exact:  # neighbouring epochs share a drift: half as many independent trials
            assert chance(track, 2 if name.startswith("clock") else 1) > 1e-6, name
        elif name != "inertial range rate":  # whose satellites share the oscillator, and all epochs the sensors' bias
            assert alarms.low <= track.p_fa, name


def test_the_excess_of_the_floor_is_the_signals_own_share(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ec/N0 of 50 dBHz is 0.084 dB, five times the scatter of the floor, and a satellite that sinks takes it along."""
    name, strong = "wrong-code floor", (*CLEAN, *HOUR, "receiver.cn0_dbhz=50.0")
    assert chance(tracks_of(*strong)[name]) > 1e-3
    monkeypatch.setattr("vestige.campaign.monitoring._own_share", lambda *_: 0.0)
    assert chance(tracks_of(*strong)[name]) < 1e-6


def test_the_excess_of_the_cn0_is_fading() -> None:
    settings = (*NO_IONOSPHERE, *HOUR)
    bare = tracks_of(*settings)["C/N0"]
    assert bare.alarms.low > 10 * P_FA
    slack = next(one for one in tracks(results_of(*settings), p_fa=P_FA) if one.name == "C/N0")
    assert not slack.exact
    assert slack.alarms.high < P_FA


@pytest.mark.parametrize(("sigma_m", "enough"), [(0.9, False), (1.8, True)])
def test_the_excess_of_raim_and_clock_under_rays_is_a_sigma_that_bounds_no_tails(sigma_m: float, enough: bool) -> None:
    found = tracks_of(*NO_IONOSPHERE, *HOUR, f"position.multipath_sigma_m={sigma_m}", p_fa=1e-3)
    for name in ("RAIM", "clock consistency"):
        track = found[name]
        assert not track.exact
        assert (track.alarms.value <= track.p_fa) is enough, name


def test_the_excess_of_the_inertial_check_is_what_its_trials_share() -> None:
    """One satellite alone and sensors without bias leave trials that only share the range rate at their ends."""
    track = tracks_of(*CLEAN, *HOUR, "receiver.accelerometers.sigma_bias_mps2=0.0")["inertial range rate"]
    for column in range(8):
        alarms = int(np.count_nonzero(track.failed[:, column]))
        assert binomial_test(alarms, int(np.count_nonzero(track.run[:, column])), track.p_fa) > 1e-5


def test_the_separation_keeps_the_budget_that_is_asked_for() -> None:
    """Half of it is vertical, whose K is the least: √2 erfc⁻¹(p/2/8); the largest separation in σ knows no budget."""
    results, statistics = results_of(*CLEAN, *HOUR), {}
    sigmas = results["separation_sigmas"].sel(fix="all", local_axis="up").values.astype(np.float64)
    for p_fa in (1e-7, 9.6e-7, 0.01):
        shares = {"solution separation": p_fa, "RAIM": 0.5}
        track = next(one for one in tracks(results, p_fa=shares) if one.name == "solution separation")
        assert track.p_fa == pytest.approx(p_fa)
        assert np.all(track.threshold == 1)
        statistics[p_fa] = track.statistic
        np.testing.assert_allclose(track.statistic, sigmas / (np.sqrt(2) * erfcinv(p_fa / 16)), rtol=1e-5)
    failures = np.count_nonzero(statistics[0.01] > 1)
    assert 0.3 * 0.01 * sigmas.size < failures < 0.01 * sigmas.size
    assert not np.any(statistics[1e-7] > 1)
