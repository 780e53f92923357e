"""The fix of every epoch and its checks, through the processor: exact observations of a Walker sky."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from exact_sky import ORBITS, START, exact_block
from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings
from vestige.acas_processor.position.fix_measurement import FixSettings
from vestige.acas_processor.position.pseudorange_errors import PseudorangeErrors
from vestige.acas_processor.processor import AcasProcessor
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.records import Assistance, CheckResult, Outcome

PLACE = StaticTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=500.0)
FIX = FixSettings(ephemerides=ORBITS)
NAMES = ["clock innovation", "clock consistency", "clock slope", "RAIM", "solution separation"]


def _night(late_m: list[dict[int, float]], fix: FixSettings = FIX) -> list[dict[str, CheckResult]]:
    """Return the checks of the fix of every epoch, 30 s apart."""
    block = exact_block(PLACE, 30.0 * np.arange(len(late_m)), late_m=late_m, drift_mps=0.5)
    found = AcasProcessor(level=2, monitoring=MonitoringSettings(fix=fix)).step(None, block, Assistance()).block
    return [
        {name: found.checks[name].result(epoch, 0) for name in found.checks if name in NAMES}  # type: ignore[misc]
        for epoch in range(len(late_m))
    ]


def _failed(checks: dict[str, CheckResult]) -> set[str]:
    return {str(name) for name, check in checks.items() if check.outcome is Outcome.FAIL}


def test_a_quiet_night_passes() -> None:
    night = _night([{}] * 12)
    assert all(not _failed(checks) for checks in night)
    assert [str(name) for name in night[-1]] == NAMES
    assert {check.outcome for check in night[-1].values()} == {Outcome.PASS}
    assert night[-1]["RAIM"].statistic == pytest.approx(0.0, abs=1e-3)
    assert night[0]["clock innovation"].reason == "no position fix shortly before"


def test_one_satellite_pulled_is_raims_and_is_named() -> None:
    svid = exact_block(PLACE, np.zeros(1)).svids[0]
    checks = _night([{}, {svid: 200.0}])[-1]
    assert {"RAIM", "solution separation"} <= _failed(checks)
    assert f"without E{svid:02d} they do" in checks["RAIM"].reason
    assert f"without E{svid:02d} the position moves" in checks["solution separation"].reason


def test_all_pulled_alike_is_the_clocks_and_raim_is_blind() -> None:
    everyone = dict.fromkeys(exact_block(PLACE, np.zeros(1)).svids, 200.0)
    checks = _night([{}, everyone])[-1]
    assert _failed(checks) == {"clock consistency"}
    assert checks["clock consistency"].statistic == pytest.approx(200.0, abs=0.5)


def test_without_orbits_there_is_no_fix() -> None:
    checks = _night([{}], FixSettings())[0]
    assert {check.outcome for check in checks.values()} == {Outcome.NOT_RUN}
    assert {check.reason for check in checks.values()} == {"no position fix, so no receiver clock", "no position fix"}


def test_an_ephemeris_is_used_near_its_time_and_the_nearest_one_counts() -> None:
    block = exact_block(PLACE, np.array([0.0, 4.5 * 3600.0]))
    found = FIX.measure(block.time, block.svids, block.e1)
    assert found is not None
    assert found.fix.valid.tolist() == [True, False], "toe is 10 min before, and an ephemeris is used for 4 h"
    wrong = tuple(replace(one, toe=one.toe + 3600.0) for one in ORBITS)  # an orbit of another time
    both = FixSettings(ephemerides=(*wrong, *ORBITS)).measure(block.time, block.svids, block.e1)
    assert both is not None
    np.testing.assert_array_equal(both.fix.position_m[0], found.fix.position_m[0])
    always = replace(FIX, fit_interval_s=np.inf).measure(block.time, block.svids, block.e1)
    assert always is not None
    assert always.fix.valid.all()


def test_what_is_assumed_of_low_satellites_is_larger() -> None:
    block = exact_block(PLACE, np.zeros(1))
    errors = PseudorangeErrors(floor_m=1.0, ionosphere_m=2.0, multipath_m=1.0)
    found = replace(FIX, errors=errors).measure(block.time, block.svids, block.e1)
    assert found is not None
    towards = -found.fix.geometry[0, :, :3]
    up = found.fix.position_m[0] / np.linalg.norm(found.fix.position_m[0])
    order = np.argsort(towards @ up)
    assert np.all(np.diff(found.sigma_m[0, order]) <= 1e-9)
    assert found.sigma_m.min() > 1.0
    assert block.time.at(0) == START
