"""Checks over a campaign of a sky: what a time push shows, and where limits come from."""

from __future__ import annotations

import numpy as np
import pytest
import xarray
from scipy.special import erfcinv

from campaign_checks import checks_of, results_of
from sky_builder import CLEAN
from vestige.campaign.levels import judged_by
from vestige.errors import VestigeError

P_FA = 0.01
PUSH = (
    'attack=[{kind="time-push", start_s=100, '
    'delay_m={kind="ramp", first=0, last=600, start_s=150, stop_s=250}, power_db=6}]'
)


def test_a_time_push_is_seen_by_the_clock_and_by_power_and_not_by_raim() -> None:
    found = checks_of(results_of(*CLEAN, "epochs=300", "recs.every=4", PUSH))
    during = slice(155, 250)
    assert found["E1 received power"].failed[during].all()
    assert found["clock innovation"].failed[150:156].any()
    assert not found["RAIM"].failed.any()
    for name, check in found.items():
        assert not check.failed[:100].any() or name == "power-distortion"


def test_the_cn0_is_compared_with_that_of_the_elevation() -> None:
    """C/N0 falls by 9 dB from the zenith to the horizon; estimate and antenna spread by 0.3 dB and 1.5 dB."""
    results = results_of(*CLEAN, "epochs=60", "receiver.cn0_e1_dbhz=37.0")
    check = checks_of(results, P_FA)["C/N0"]
    elevation_rad = np.radians(results["elevation_deg"].values.astype(np.float64))
    expected_dbhz = 37.0 - 9.0 * (1 - np.sin(elevation_rad))
    np.testing.assert_allclose(check.statistic, results["e1_cn0_dbhz"].values - expected_dbhz, atol=1e-3)
    assert np.count_nonzero(check.statistic > 0) > 50
    assert np.count_nonzero(check.statistic < 0) > 50
    np.testing.assert_allclose(check.threshold, np.sqrt(2) * erfcinv(P_FA) * np.hypot(0.3, 1.5))


def test_the_slope_of_a_perfect_clock_may_be_what_a_straight_line_makes_of_the_fixes() -> None:
    perfect = ("receiver.clock=none", "processor.oscillator={h0_s=0.0, h_minus_2_hz=0.0}")
    results = results_of(*CLEAN, "epochs=60", *perfect)
    check = checks_of(results, 3 * P_FA)["clock slope"]
    variance = results["fix_sigma_drift_mps"].sel(fix="all").values.astype(np.float64) ** 2
    of_one = np.polyfit(np.arange(10.0), np.eye(10), 1)[0]  # slope that each of ten drifts alone makes
    assert not np.isfinite(check.threshold[:9]).any()
    for epoch in range(9, 60):
        sigma = np.sqrt(np.sum(of_one**2 * variance[epoch - 9 : epoch + 1]))
        assert check.threshold[epoch] == pytest.approx(np.sqrt(2) * erfcinv(P_FA) * sigma, rel=1e-5)


def test_other_results_are_refused() -> None:
    with pytest.raises(VestigeError, match="scenario"):
        judged_by(xarray.Dataset({"time_s": ("epoch", np.zeros(3))}), lambda processor: processor)
