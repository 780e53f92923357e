"""Range rates from one RECS to the next against accelerometers: through the processor, with exact observations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydantic import TypeAdapter

from exact_sky import ORBITS, START, exact_block
from vestige.acas_processor.checks.check import two_sided_factor
from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings
from vestige.acas_processor.monitoring.state import ReceiverState
from vestige.acas_processor.position.fix_measurement import FixSettings
from vestige.acas_processor.processor import AcasProcessor, Step
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.navigation.earth import local_axes_at
from vestige.receiver.sky.trajectory import CircularTrajectory, StaticTrajectory, Trajectory
from vestige.records import Assistance, CheckResult, Outcome
from vestige.records.checks import CheckName
from vestige.records.inertial import LONGEST_STEP_S, Accelerations
from vestige.records.snapshot_block import SnapshotBlock

STANDING = StaticTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=500.0)
CIRCLE = CircularTrajectory(latitude_deg=48.0, longitude_deg=11.0, radius_m=400.0, speed_mps=20.0)
FLIGHT = CircularTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=9e3, radius_m=20_000.0, speed_mps=250.0)
INTERVAL_S = 30.0
PROCESSOR = AcasProcessor(level=3, monitoring=MonitoringSettings(fix=FixSettings(ephemerides=ORBITS)))


def _sensed(
    trajectory: Trajectory, first_s: float = -1.0, last_s: float = 100.0, rate_hz: float = 20.0
) -> Accelerations:
    elapsed_s = np.arange(first_s, last_s, 1 / rate_hz)
    motion = trajectory.motion(elapsed_s)
    local = np.einsum("nij,nj->ni", local_axes_at(motion.position_m), motion.acceleration_mps2)
    return Accelerations(start=START + first_s, elapsed_s=elapsed_s - first_s, acceleration_mps2=local)


def _epoch(
    n: int, trajectory: Trajectory, sensed: Accelerations | None, pull_mps: dict[int, float] | None = None
) -> SnapshotBlock:
    block = exact_block(trajectory, np.array([INTERVAL_S * n]), pull_mps=[pull_mps or {}])
    since = None if n == 0 else START + INTERVAL_S * (n - 1)
    return replace(block, increments=None if sensed is None else sensed.increments(since, block.time.at(0)))


def _step(state: ReceiverState | None, block: SnapshotBlock) -> Step:
    return PROCESSOR.step(state, block, Assistance())


def _checks(step: Step) -> dict[int, CheckResult]:
    series = step.block.checks[CheckName.INERTIAL_RANGE_RATE]
    snapshots = step.block.measured.snapshots
    seen = np.flatnonzero(snapshots.e1.seen[0]).tolist()
    return {snapshots.svids[column]: series.result(0, column) for column in seen}


def _second(
    trajectory: Trajectory, sensed: Accelerations | None, pull_mps: dict[int, float] | None = None
) -> dict[int, CheckResult]:
    """Return the checks of the second of two epochs."""
    first = _step(None, _epoch(0, trajectory, sensed))
    assert {one.outcome for one in _checks(first).values()} == {Outcome.NOT_RUN}
    return _checks(_step(first.state, _epoch(1, trajectory, sensed, pull_mps)))


def _outcomes(checks: dict[int, CheckResult]) -> set[Outcome]:
    assert len(checks) >= 6
    return {one.outcome for one in checks.values()}


def test_a_receiver_that_stands_is_explained_by_zeros() -> None:
    checks = _second(STANDING, _sensed(STANDING))
    assert _outcomes(checks) == {Outcome.PASS}
    assert max(abs(one.statistic) for one in checks.values()) < 1e-3
    # of 1 mg, the oscillator of the paper and 0.1 m/s of each range rate
    variance = 2 * 0.1**2 + 0.3**2 + 30 * (0.002**2 + (SPEED_OF_LIGHT_MPS * np.pi) ** 2 * 2 * 4.311e-21)
    (threshold,) = {round(one.threshold, 9) for one in checks.values()}
    share = 0.0622  # of one false alarm a day, docs/levels; ten satellites each 30 s
    assert threshold == pytest.approx(two_sided_factor(share / 28_800) * np.sqrt(variance), rel=1e-3)


@pytest.mark.parametrize("trajectory", [CIRCLE, FLIGHT])
def test_a_manoeuvre_is_explained_by_the_sensors_and_by_nothing_else(trajectory: Trajectory) -> None:
    """FLIGHT turns lines of sight by 4 mrad and the vertical by 1.2 mrad, at 250 m/s."""
    checks = _second(trajectory, _sensed(trajectory))
    assert _outcomes(checks) == {Outcome.PASS}
    assert max(abs(one.statistic) for one in checks.values()) < 0.03
    assert Outcome.FAIL in _outcomes(_second(trajectory, _sensed(STANDING)))
    assert _outcomes(_second(trajectory, None)) == {Outcome.NOT_RUN}


def test_a_sensor_that_tells_another_story_fails() -> None:
    assert Outcome.FAIL in _outcomes(_second(STANDING, _sensed(CIRCLE)))


@pytest.mark.parametrize("pull_mps", [-6.0, 6.0])
def test_a_pull_of_one_satellite_fails_its_check(pull_mps: float) -> None:
    svid = next(iter(_checks(_step(None, _epoch(0, CIRCLE, _sensed(CIRCLE))))))
    checks = _second(CIRCLE, _sensed(CIRCLE), {svid: pull_mps})
    assert {one for one, check in checks.items() if check.outcome is Outcome.FAIL} == {svid}
    assert checks[svid].statistic == pytest.approx(pull_mps, abs=0.05)
    assert f"changed by {checks[svid].statistic:+.2f} m/s more than the motion explains" in checks[svid].reason


@pytest.mark.parametrize(
    ("sensed", "reason"),
    [
        (None, "no accelerations of inertial sensors"),
        (_sensed(STANDING, last_s=29.9), "the accelerations do not cover the time since 2025-"),
        (_sensed(STANDING, first_s=0.1), "the accelerations do not cover"),
        (_sensed(STANDING, rate_hz=0.5), "the accelerations do not cover"),
        (_sensed(STANDING, last_s=-0.5), "the accelerations do not cover"),
        (_sensed(STANDING, last_s=-2.0), "the accelerations do not cover"),  # no row at all
    ],
)
def test_what_is_not_covered_is_not_run(sensed: Accelerations | None, reason: str) -> None:
    checks = _second(STANDING, sensed)
    assert _outcomes(checks) == {Outcome.NOT_RUN}
    assert all(one.reason.startswith(reason) for one in checks.values())


def test_without_a_position_there_is_nothing_to_compare() -> None:
    sensed = _sensed(STANDING)
    first, second, third = (_epoch(n, STANDING, sensed) for n in range(3))
    before = _step(None, first)
    assert {one.reason for one in _checks(before).values()} == {"no earlier snapshot with a position fix"}
    kept = np.isin(second.svids, list(_checks(before))[:3])
    few = replace(second, e1=replace(second.e1, pseudorange_m=np.where(kept, second.e1.pseudorange_m, np.nan)))
    lost = _step(before.state, few)
    assert {one.reason for one in _checks(lost).values()} == {"no position fix"}
    assert {one.reason for one in _checks(_step(lost.state, third)).values()} == {
        "no earlier snapshot with a position fix"
    }
    again = _checks(_step(before.state, replace(first, increments=sensed.increments(START + -0.5, START))))
    assert {one.reason for one in again.values()} == {"the previous snapshot has the same time"}


def test_a_satellite_that_rose_in_between_is_not_run() -> None:
    first, second = (_epoch(n, STANDING, _sensed(STANDING)) for n in range(2))
    risen = next(iter(_checks(_step(None, second))))
    hidden = np.where(np.array(first.svids) == risen, np.nan, first.e1.pseudorange_m)
    less = replace(first, e1=replace(first.e1, pseudorange_m=hidden))
    checks = _checks(_step(_step(None, less).state, second))
    assert checks[risen].reason == "the range rate is not known at the beginning or the end of the interval"
    assert {one.outcome for svid, one in checks.items() if svid != risen} == {Outcome.PASS}


def test_the_state_goes_through_json_unchanged() -> None:
    adapter, sensed = TypeAdapter(ReceiverState), _sensed(CIRCLE)
    state = _step(None, _epoch(0, CIRCLE, sensed)).state
    assert state.memory[CheckName.INERTIAL_RANGE_RATE]
    again = adapter.validate_python(adapter.dump_python(state, mode="json"))
    assert again == state
    block = _epoch(1, CIRCLE, sensed)
    assert _checks(_step(again, block)) == _checks(_step(state, block))


def test_an_integral_from_between_samples_is_exact() -> None:
    """∫ (t, −2t, 1) dt."""
    elapsed_s = np.arange(0.0, 11.0)
    sensed = Accelerations(
        start=START,
        elapsed_s=elapsed_s,
        acceleration_mps2=np.stack((elapsed_s, -2 * elapsed_s, np.ones(11)), axis=1),
    )

    def gained(first_s: float, last_s: float) -> np.ndarray | None:
        found = sensed.increments(START + first_s, START + last_s)
        return found.delta_velocity_mps.sum(axis=0) if found.covered[0] else None

    half = (7.25**2 - 2.5**2) / 2
    np.testing.assert_allclose(gained(2.5, 7.25), [half, -2 * half, 4.75], atol=1e-9)  # type: ignore[arg-type]
    np.testing.assert_allclose(gained(2.5, 2.75), [0.65625, -1.3125, 0.25], atol=1e-9)  # type: ignore[arg-type]
    np.testing.assert_allclose(gained(0.0, 10.0), [50, -100, 10], atol=1e-9)  # type: ignore[arg-type]
    assert gained(-0.1, 5.0) is None
    assert gained(5.0, 10.1) is None


def test_a_gap_in_the_samples_counts_only_where_it_lies() -> None:
    elapsed_s = np.array([0.0, 1.0, 2.0, 2.0 + LONGEST_STEP_S + 0.1, 5.0, 6.0])
    sensed = Accelerations(start=START, elapsed_s=elapsed_s, acceleration_mps2=np.zeros((6, 3)))
    covered = [
        bool(sensed.increments(START + first_s, START + last_s).covered[0])
        for first_s, last_s in ((0.0, 1.9), (0.5, 2.0), (1.0, 2.1), (2.5, 3.0), (3.7, 6.0))
    ]
    assert covered == [True, True, False, False, True]
