"""Range rates from snapshot to snapshot against accelerometers: through `Watch.step`, with exact observations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydantic import TypeAdapter

from vestige.acas_processor.fix_checks import FixChecks
from vestige.acas_processor.inertial_bridging import LONGEST_STEP_S, Accelerations, InertialBridging
from vestige.acas_processor.monitors.judgement import two_sided_factor
from vestige.acas_processor.watch import Watch, WatchState
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.measurement import Measurement, SatelliteMeasurement
from vestige.navigation.earth import local_axes_at
from vestige.receiver.constellation import sky, walker_ephemerides
from vestige.receiver.trajectory import CircularTrajectory, StaticTrajectory, Trajectory
from vestige.records import Assistance, CheckResult, E1Observation, Outcome, Snapshot
from vestige.time import GalileoTime

START = GalileoTime(1372, 604_790)  # the week ends within the first interval
ORBITS = tuple(walker_ephemerides(GalileoTime(1372, 604_000)))
STANDING = StaticTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=500.0)
CIRCLE = CircularTrajectory(latitude_deg=48.0, longitude_deg=11.0, radius_m=400.0, speed_mps=20.0)
FLIGHT = CircularTrajectory(latitude_deg=48.0, longitude_deg=11.0, height_m=9e3, radius_m=20_000.0, speed_mps=250.0)
INTERVAL_S = 30.0
NOTHING = Assistance(segments=())


def _snapshot(n: int, trajectory: Trajectory, pull_mps: dict[int, float]) -> Snapshot:
    """Exact E1 observations, of some satellites with a range rate that is pulled."""
    at_s = np.array([INTERVAL_S * n])
    view = sky(ORBITS, START, at_s, trajectory.motion(at_s), mask_deg=10.0)
    observations = {
        svid: E1Observation(
            svid=svid,
            pseudorange_m=float(view.range_m[0, k] - view.satellite_clock_m[0, k]),
            carrier_phase_cycles=float("nan"),
            doppler_hz=-float(view.rate_mps[0, k] - view.satellite_clock_mps[0, k] + pull_mps.get(svid, 0.0))
            * E1_CARRIER_HZ
            / SPEED_OF_LIGHT_MPS,
            doppler_rate_hz_per_s=0.0,
            cn0_dbhz=45.0,
        )
        for k, svid in enumerate(view.svids)
        if view.in_view[0, k]
    }
    time = START + INTERVAL_S * n
    return Snapshot(index=n, time=time, received_at=time, time_uncertainty_s=1.0, observations=observations, e6=None)


def _sensed(
    trajectory: Trajectory, first_s: float = -1.0, last_s: float = 100.0, rate_hz: float = 20.0
) -> Accelerations:
    elapsed_s = np.arange(first_s, last_s, 1 / rate_hz)
    motion = trajectory.motion(elapsed_s)
    local = np.einsum("nij,nj->ni", local_axes_at(motion.position_m), motion.acceleration_mps2)
    return Accelerations(start=START + first_s, elapsed_s=elapsed_s - first_s, acceleration_mps2=local)


def _step(watch: Watch, state: WatchState, snapshot: Snapshot) -> tuple[WatchState, dict[int, CheckResult]]:
    measurement = Measurement(
        index=snapshot.index,
        time=snapshot.time,
        satellites=tuple(SatelliteMeasurement(svid=svid) for svid in snapshot.observations),
        observations=snapshot.observations,
        front_end={},
    )
    state, further = watch.step(3, state, snapshot, measurement, NOTHING, failed=False)
    found = {
        svid: next(one for one in own if one.name == "inertial range rate") for svid, own in further.checks.items()
    }
    return state, found


def _watch(accelerations: Accelerations | None) -> Watch:
    return Watch(fix=FixChecks(ephemerides=ORBITS), inertial=InertialBridging(accelerations=accelerations))


def _second(
    trajectory: Trajectory, accelerations: Accelerations | None, pull_mps: dict[int, float] | None = None
) -> dict[int, CheckResult]:
    """Return the checks of the second of two snapshots."""
    watch = _watch(accelerations)
    state, first = _step(watch, WatchState(), _snapshot(0, trajectory, {}))
    assert {one.outcome for one in first.values()} == {Outcome.NOT_RUN}
    return _step(watch, state, _snapshot(1, trajectory, pull_mps or {}))[1]


def _outcomes(checks: dict[int, CheckResult]) -> set[Outcome]:
    assert len(checks) >= 6
    return {one.outcome for one in checks.values()}


def test_a_receiver_that_stands_is_explained_by_zeros() -> None:
    checks = _second(STANDING, _sensed(STANDING))
    assert _outcomes(checks) == {Outcome.PASS}
    assert max(abs(one.statistic) for one in checks.values()) < 1e-3
    rates = [_snapshot(n, STANDING, {}).observations for n in (0, 1)]
    assert max(abs(rates[1][svid].doppler_hz - rates[0][svid].doppler_hz) for svid in checks) > 10.0  # 2 m/s
    # of 1 mg, the oscillator of the paper and 0.1 m/s of each range rate
    variance = 2 * 0.1**2 + 0.3**2 + 30 * (0.002**2 + (SPEED_OF_LIGHT_MPS * np.pi) ** 2 * 2 * 4.311e-21)
    (threshold,) = {one.threshold for one in checks.values()}
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
    svid = next(iter(_snapshot(0, CIRCLE, {}).observations))
    checks = _second(CIRCLE, _sensed(CIRCLE), {svid: pull_mps})
    assert {one for one, check in checks.items() if check.outcome is Outcome.FAIL} == {svid}
    assert checks[svid].statistic == pytest.approx(pull_mps, abs=0.05)
    assert f"changed by {checks[svid].statistic:+.2f} m/s more than the motion explains" in checks[svid].reason


def test_a_failure_is_a_reason_for_an_exhaustive_search() -> None:
    watch = replace(_watch(_sensed(CIRCLE)), exhaustive_period_s=1e9)
    state, _ = _step(watch, WatchState(), _snapshot(0, CIRCLE, {}))
    svid = next(iter(_snapshot(0, CIRCLE, {}).observations))
    quiet, _ = _step(watch, state, _snapshot(1, CIRCLE, {}))
    pulled, _ = _step(watch, state, _snapshot(1, CIRCLE, {svid: 6.0}))
    assert quiet.searched_at == START
    assert pulled.searched_at == START + INTERVAL_S


@pytest.mark.parametrize(
    ("accelerations", "reason"),
    [
        (None, "no accelerations of inertial sensors"),
        (_sensed(STANDING, last_s=29.9), "the accelerations do not cover the time since 2025-"),
        (_sensed(STANDING, first_s=0.1), "the accelerations do not cover"),
        (_sensed(STANDING, rate_hz=0.5), "the accelerations do not cover"),
        (_sensed(STANDING, last_s=-0.5), "the accelerations do not cover"),
        (_sensed(STANDING, last_s=-2.0), "the accelerations do not cover"),  # no row at all
    ],
)
def test_what_is_not_covered_is_not_run(accelerations: Accelerations | None, reason: str) -> None:
    checks = _second(STANDING, accelerations)
    assert _outcomes(checks) == {Outcome.NOT_RUN}
    assert all(one.reason.startswith(reason) for one in checks.values())


def test_without_a_position_there_is_nothing_to_compare() -> None:
    sound = _watch(_sensed(STANDING))
    first, second, third = (_snapshot(n, STANDING, {}) for n in range(3))
    state, checks = _step(sound, WatchState(), first)
    assert {one.reason for one in checks.values()} == {"no snapshot with a position fix before"}
    few = replace(second, observations=dict(list(second.observations.items())[:3]))
    lost, checks = _step(sound, state, few)
    assert {one.reason for one in checks.values()} == {"no position fix"}
    _, checks = _step(sound, lost, third)
    assert {one.reason for one in checks.values()} == {"no snapshot with a position fix before"}
    _, checks = _step(replace(sound, fix=FixChecks()), state, second)
    assert {one.reason for one in checks.values()} == {"no position fix"}
    _, checks = _step(sound, state, first)
    assert {one.reason for one in checks.values()} == {"the snapshot before is of the same time"}


def test_a_satellite_that_rose_in_between_is_not_run() -> None:
    watch, (first, second) = _watch(_sensed(STANDING)), (_snapshot(n, STANDING, {}) for n in range(2))
    risen = next(iter(second.observations))
    less = replace(first, observations={svid: one for svid, one in first.observations.items() if svid != risen})
    _, checks = _step(watch, _step(watch, WatchState(), less)[0], second)
    assert checks[risen].reason == "no range rate at both ends"
    assert {one.outcome for svid, one in checks.items() if svid != risen} == {Outcome.PASS}


def test_the_state_goes_through_json_unchanged() -> None:
    watch, adapter = _watch(_sensed(CIRCLE)), TypeAdapter(WatchState)
    state, _ = _step(watch, WatchState(), _snapshot(0, CIRCLE, {}))
    assert state.rates is not None
    again = adapter.validate_python(adapter.dump_python(state, mode="json"))
    snapshot = _snapshot(1, CIRCLE, {})
    assert _step(watch, again, snapshot)[1] == _step(watch, state, snapshot)[1]


def test_an_integral_from_between_samples_is_exact() -> None:
    """∫ (t, −2t, 1) dt along the local axes of one place."""
    elapsed_s = np.arange(0.0, 11.0)
    sensed = Accelerations(
        start=START,
        elapsed_s=elapsed_s,
        acceleration_mps2=np.stack((elapsed_s, -2 * elapsed_s, np.ones(11)), axis=1),
    )
    place = STANDING.motion(np.zeros(1)).position_m
    axes = local_axes_at(place)[0]

    def gained(first_s: float, last_s: float) -> np.ndarray | None:
        found = sensed.gained_mps(START + first_s, START + last_s, (place[0], place[0]))
        return None if found is None else axes @ found

    half = (7.25**2 - 2.5**2) / 2
    np.testing.assert_allclose(gained(2.5, 7.25), [half, -2 * half, 4.75], atol=1e-9)
    np.testing.assert_allclose(gained(2.5, 2.75), [0.65625, -1.3125, 0.25], atol=1e-9)
    np.testing.assert_allclose(gained(0.0, 10.0), [50, -100, 10], atol=1e-9)
    assert gained(-0.1, 5.0) is None
    assert gained(5.0, 10.1) is None


def test_a_gap_in_the_samples_counts_only_where_it_lies() -> None:
    elapsed_s = np.array([0.0, 1.0, 2.0, 2.0 + LONGEST_STEP_S + 0.1, 5.0, 6.0])
    sensed = Accelerations(start=START, elapsed_s=elapsed_s, acceleration_mps2=np.zeros((6, 3)))
    place = STANDING.motion(np.zeros(1)).position_m[0]
    covered = [
        sensed.gained_mps(START + first_s, START + last_s, (place, place)) is not None
        for first_s, last_s in ((0.0, 1.9), (0.5, 2.0), (1.0, 2.1), (2.5, 3.0), (3.7, 6.0))
    ]
    assert covered == [True, True, False, False, True]


def test_what_is_sensed_turns_with_the_place() -> None:
    """Upwards on the equator along a chord from −a to a in longitude: ∫ up dt is asinh(tan a)/tan a of the middle's."""
    tangent = 0.05
    sensed = Accelerations(
        start=START, elapsed_s=np.linspace(0.0, 10.0, 1001), acceleration_mps2=np.tile([0.0, 0.0, 1.0], (1001, 1))
    )
    ends = [np.array([6.4e6, side * 6.4e6 * tangent, 0.0]) for side in (-1, 1)]
    found = sensed.gained_mps(START, START + 10.0, (ends[0], ends[1]))
    assert found is not None
    np.testing.assert_allclose(found, [10 * np.arcsinh(tangent) / tangent, 0, 0], atol=1e-6)
