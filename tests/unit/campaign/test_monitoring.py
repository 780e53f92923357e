"""Checks over a campaign of a sky: false alarms meet their budget where the world is as supposed, attacks are seen."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import xarray
from scipy.special import chndtr, erfcinv
from tests.sky_builder import CLEAN, sky_scenario

from vestige.campaign.monitoring import Track, tracks
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import binomial_test
from vestige.errors import VestigeError

pytestmark = pytest.mark.many_epochs

P_FA = 0.01
PUSH = (
    'attack=[{kind="time-push", start_s=100, '
    'delay_m={kind="ramp", first=0, last=600, start_s=150, stop_s=250}, power_db=6}]'
)


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


def test_a_time_push_is_seen_by_the_clock_and_by_power_and_not_by_raim() -> None:
    found = tracks_of(*CLEAN, "epochs=300", "recs.every=4", PUSH, p_fa=1e-5)
    during = slice(155, 250)
    assert found["E1 received power"].failed[during].all()
    assert found["clock innovation"].failed[150:156].any()
    assert not found["RAIM"].failed.any()
    for track in found.values():
        assert not track.failed[:100].any() or track.name == "power-distortion"


def test_the_limits_of_the_cn0_are_quantiles_of_the_correlator() -> None:
    """|ξ|² has mean λ + 2: a satellite of 25 dBHz may be as far above λ as non-central χ² is with p/2."""
    results = results_of(*CLEAN, "epochs=60", "receiver.cn0_e1_dbhz=27.0")
    track = next(one for one in tracks(results, p_fa=P_FA, cn0_model_sigma_db=0.0) if one.name == "C/N0")
    elevation_rad = np.radians(results["elevation_deg"].values.astype(np.float64))
    expected_dbhz = 27.0 - 9.0 * (1 - np.sin(elevation_rad))
    lam = 2 * 10 ** (expected_dbhz / 10) * 0.1
    sign = np.sign(track.statistic)
    limit = 2 + lam * 10 ** (sign * track.threshold / 10)
    outside = np.where(sign > 0, 1 - chndtr(limit, 2.0, lam), chndtr(limit, 2.0, lam))
    looked_at = expected_dbhz > 22  # below, the lower limit would be a negative power
    assert np.count_nonzero(looked_at & (sign > 0)) > 50
    assert np.count_nonzero(looked_at & (sign < 0)) > 50
    np.testing.assert_allclose(outside[looked_at], P_FA / 2, rtol=0.02)


def test_the_slope_of_a_perfect_clock_may_be_what_a_straight_line_makes_of_the_fixes() -> None:
    results = results_of(*CLEAN, "epochs=60", "receiver.clock=none")
    track = next(one for one in tracks(results, p_fa=3 * P_FA) if one.name == "clock slope")
    variance = results["fix_sigma_drift_mps"].sel(fix="all").values.astype(np.float64) ** 2
    of_one = np.polyfit(np.arange(10.0), np.eye(10), 1)[0]  # slope that each of ten drifts alone makes
    assert not np.isfinite(track.threshold[:9]).any()
    for epoch in range(9, 60):
        sigma = np.sqrt(np.sum(of_one**2 * variance[epoch - 9 : epoch + 1]))
        assert track.threshold[epoch] == pytest.approx(np.sqrt(2) * erfcinv(P_FA) * sigma, rel=1e-5)


def test_other_results_are_refused() -> None:
    with pytest.raises(VestigeError, match="e1_taps"):
        tracks(xarray.Dataset({"time_s": ("epoch", np.zeros(3))}))
