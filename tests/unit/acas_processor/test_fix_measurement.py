from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vestige.acas_processor.fix_checks import FixChecks
from vestige.acas_processor.monitors.clock_drift import ClockEpoch
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.constellation import sky, walker_ephemerides
from vestige.receiver.trajectory import StaticTrajectory
from vestige.records import CheckResult, E1Observation, Outcome
from vestige.time import GalileoTime

START = GalileoTime(1372, 480_600)
PLACE = StaticTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=500.0)
ORBITS = tuple(walker_ephemerides(GalileoTime(1372, 480_000)))
CHECKS = FixChecks(ephemerides=ORBITS, sigma_m=5.0)
NAMES = ["clock innovation", "clock consistency", "clock slope", "RAIM", "solution separation"]
DRIFT_MPS = 0.5


def _observations(elapsed_s: float, late_m: dict[int, float]) -> dict[int, E1Observation]:
    """Exact E1 observations of a clock that drifts, some of them late."""
    clock_m = 1000.0 + DRIFT_MPS * elapsed_s
    true_s = np.array([elapsed_s - clock_m / SPEED_OF_LIGHT_MPS])
    view = sky(ORBITS, START, true_s, PLACE.motion(true_s), mask_deg=10.0)
    return {
        svid: E1Observation(
            svid=svid,
            pseudorange_m=float(view.range_m[0, k] + clock_m - view.satellite_clock_m[0, k]) + late_m.get(svid, 0.0),
            carrier_phase_cycles=float("nan"),
            doppler_hz=-float(view.rate_mps[0, k] + DRIFT_MPS - view.satellite_clock_mps[0, k])
            * E1_CARRIER_HZ
            / SPEED_OF_LIGHT_MPS,
            doppler_rate_hz_per_s=0.0,
            cn0_dbhz=45.0,
        )
        for k, svid in enumerate(view.svids)
        if view.in_view[0, k]
    }


def _night(late_m: list[dict[int, float]]) -> list[dict[str, CheckResult]]:
    history: tuple[ClockEpoch, ...] = ()
    found = []
    for n, late in enumerate(late_m):
        history, checks = CHECKS.step(history, CHECKS.solve(START + 30.0 * n, _observations(30.0 * n, late)))
        assert [check.name for check in checks] == NAMES
        found.append({check.name: check for check in checks})
    return found


def _failed(checks: dict[str, CheckResult]) -> set[str]:
    return {name for name, check in checks.items() if check.outcome is Outcome.FAIL}


def test_a_quiet_night_passes() -> None:
    night = _night([{}] * 12)
    assert all(not _failed(checks) for checks in night)
    assert {check.outcome for check in night[-1].values()} == {Outcome.PASS}
    assert night[-1]["RAIM"].statistic == pytest.approx(0.0, abs=1e-3)
    assert night[0]["clock innovation"].reason == "no epoch shortly before"


def test_one_satellite_pulled_is_raims_and_is_named() -> None:
    svid = next(iter(_observations(0.0, {})))
    checks = _night([{}, {svid: 200.0}])[-1]
    assert {"RAIM", "solution separation"} <= _failed(checks)
    assert f"without E{svid:02d} they do" in checks["RAIM"].reason


def test_all_pulled_alike_is_the_clocks_and_raim_is_blind() -> None:
    everyone = dict.fromkeys(_observations(0.0, {}), 200.0)
    checks = _night([{}, everyone])[-1]
    assert _failed(checks) == {"clock consistency"}
    assert checks["clock consistency"].statistic == pytest.approx(200.0, abs=0.5)


def test_without_orbits_there_is_no_fix() -> None:
    blind = replace(CHECKS, ephemerides=())
    history, checks = blind.step((), blind.solve(START, _observations(0.0, {})))
    assert history == ()
    assert [check.outcome for check in checks] == [Outcome.NOT_RUN] * 5
    assert {check.reason for check in checks} == {"no position fix, so no receiver clock", "no position fix"}


def test_the_budget_of_a_level_is_kept() -> None:
    p_fa = dict.fromkeys(NAMES, 1e-6)
    own = CHECKS.with_budget(p_fa)
    assert (own.clock.p_fa, own.raim.p_fa, own.separation.p_fa) == pytest.approx((3e-6, 1e-6, 1e-6))
