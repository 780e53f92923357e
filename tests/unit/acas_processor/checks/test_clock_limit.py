"""The limit of the receiver's clock: a replay that comes later than it allows fails, whatever the attacker nulls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evidence_builder import evidence, outcome
from exact_sky import ORBITS, exact_block
from vestige.acas_processor.checks import clock_limit
from vestige.acas_processor.checks.clock_limit import ClockLimitMonitor
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings
from vestige.acas_processor.position.clock_error import ClockError
from vestige.acas_processor.position.fix_measurement import FixSettings
from vestige.acas_processor.processor import AcasProcessor
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.sky.trajectory import StaticTrajectory
from vestige.records import Assistance, CheckResult, Outcome
from vestige.records.checks import CheckName

PLACE = StaticTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=500.0)
MONITOR = ClockLimitMonitor()


def _with_fix(late_s: float, limit_s: float) -> CheckResult:
    """Return the check of a sky that is wholly later, exact otherwise; the fix's clock has a σ of some 10 m."""
    block = exact_block(PLACE, np.zeros(1))
    e1 = replace(block.e1, pseudorange_m=block.e1.pseudorange_m + late_s * SPEED_OF_LIGHT_MPS)
    block = replace(block, e1=e1, time_uncertainty_s=np.full(1, limit_s))
    processor = AcasProcessor(level=2, monitoring=MonitoringSettings(fix=FixSettings(ephemerides=ORBITS)))
    return processor.step(None, block, Assistance()).block.checks[CheckName.CLOCK_LIMIT].result(0, 0)


@pytest.mark.parametrize("limit_s", [1e-4, 0.01, 1.0])
@pytest.mark.parametrize("sign", [-1, 1], ids=["early", "late"])
def test_with_a_fix_the_curve_steps_at_the_limit(limit_s: float, sign: int) -> None:
    """The step is 500 m and 6.1 σ of the fix behind the limit, 1.8 µs; the clock is 3.3 µs ahead as it is."""
    assert _with_fix(sign * (limit_s - 1e-5), limit_s).outcome is Outcome.PASS
    failed = _with_fix(sign * (limit_s + 1e-5), limit_s)
    assert failed.outcome is Outcome.FAIL
    assert "the position fix shows that the signals are" in failed.reason
    assert f"s {'late' if sign > 0 else 'early'} by the receiver's clock" in failed.reason
    assert limit_s + 1.7e-6 < failed.threshold < limit_s + 2.5e-6


def test_the_threshold_is_500_m_and_6_sigma_behind_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = ClockError(error_s=np.zeros(1), sigma_m=np.full(1, 10.0), of_fix=np.ones(1, bool))
    monkeypatch.setattr(clock_limit, "clock_error", lambda _measured: shown)
    found = outcome(MONITOR, _without_fix([0.08], 0.01)).threshold
    assert found == pytest.approx(0.01 + (500 + 6.109 * 10) / SPEED_OF_LIGHT_MPS, abs=1e-10, rel=0)


def _without_fix(late_s: list[float], limit_s: float) -> Evidence:
    """Return evidence of travel times without orbits."""
    given = evidence((1, len(late_s)))
    snapshots = given.measured.snapshots
    e1 = replace(snapshots.e1, pseudorange_m=np.array([late_s]) * SPEED_OF_LIGHT_MPS)
    snapshots = replace(snapshots, e1=e1, time_uncertainty_s=np.full(1, limit_s))
    return replace(given, measured=replace(given.measured, snapshots=snapshots))


@pytest.mark.parametrize(
    ("travel_s", "limit_s", "expected"),
    [
        ([0.0775], 0.0, Outcome.PASS),
        ([0.066], 0.0, Outcome.PASS),
        ([0.064], 0.0, Outcome.FAIL),
        ([1.10], 1.0, Outcome.PASS),
        ([1.11], 1.0, Outcome.FAIL),
        ([-0.93], 1.0, Outcome.PASS),
        ([-0.94], 1.0, Outcome.FAIL),
        ([0.08, 0.09, 5.0], 0.001, Outcome.PASS),  # one of three is the business of RAIM
        ([3.08, 3.09, 3.085, np.nan], 1.0, Outcome.FAIL),
        ([np.nan, np.nan], 1.0, Outcome.NOT_RUN),
        ([3.08, 3.09], np.inf, Outcome.NOT_RUN),
    ],
)
def test_without_a_fix_travel_times_tell(travel_s: list[float], limit_s: float, expected: Outcome) -> None:
    found = outcome(MONITOR, _without_fix(travel_s, limit_s))
    assert found.outcome is expected
    said = {
        Outcome.PASS: "",
        Outcome.FAIL: "the travel times on E1 show",
        Outcome.NOT_RUN: "no upper limit" if np.isinf(limit_s) else "no pseudorange",
    }[expected]
    assert said in found.reason
