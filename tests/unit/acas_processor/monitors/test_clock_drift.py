from __future__ import annotations

import numpy as np
import pytest

from vestige.acas_processor.monitors.clock_drift import ClockDriftMonitor, ClockEpoch, ClockStatistics
from vestige.acas_processor.monitors.judgement import two_sided_factor
from vestige.campaign.statistics import binomial_test
from vestige.receiver.clock import TwoStateClock
from vestige.receiver.error_process import named_streams
from vestige.records import CheckResult, Outcome
from vestige.streams import stream
from vestige.time import GalileoTime

LEVEL = 1e-4
START = GalileoTime(1372, 604_790)  # the week ends after 10 s


def _measured(
    monitor: ClockDriftMonitor, step_s: float, n: int, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    times = step_s * np.arange(n)
    bias, drift = TwoStateClock().process(named_streams(seed)).advance(times)
    rng = stream(seed, "fix")
    return (
        times,
        bias + monitor.sigma_bias_m * rng.standard_normal(n),
        drift + monitor.sigma_drift_mps * rng.standard_normal(n),
    )


def _normalised(found: ClockStatistics) -> dict[str, np.ndarray]:
    return {
        "innovation": found.innovation_mps / found.innovation_threshold_mps,
        "consistency": found.consistency_m / found.consistency_threshold_m,
        "slope": found.slope_mps2 / found.slope_threshold_mps2,
    }


def test_threshold_of_the_innovation() -> None:
    """1 s, 3 cm/s, K = 5: 0.486 m/s."""
    monitor = ClockDriftMonitor()
    assert 5 * monitor.innovation_sigma_mps(np.ones(1))[0] == pytest.approx(0.486, abs=1e-3)
    assert monitor.factor == pytest.approx(two_sided_factor(monitor.p_fa / 3))


@pytest.mark.parametrize(("step_s", "sigma_bias_m"), [(1.0, 3.0), (30.0, 3.0), (30.0, 0.1), (0.1, 0.01)])
def test_false_alarms_of_each_part(step_s: float, sigma_bias_m: float) -> None:
    """Consecutive epochs share an error, windows share all: only epochs that share nothing are counted."""
    n, p_fa = 400_000, 0.03
    monitor = ClockDriftMonitor(sigma_bias_m=sigma_bias_m, window=5, p_fa=p_fa)
    found = _normalised(monitor.statistics(*_measured(monitor, step_s, n, seed=7)))
    for name, every in (("innovation", 2), ("consistency", 2), ("slope", 5)):
        apart = found[name][4::every]
        alarms = int(np.count_nonzero(np.abs(apart) > 1))
        assert binomial_test(alarms, apart.size, p_fa / 3) > LEVEL, name


def test_uneven_steps_have_the_right_spread() -> None:
    monitor = ClockDriftMonitor(window=4, p_fa=0.03)
    rng = stream(3, "steps")
    times = np.cumsum(rng.choice([1.0, 30.0, 60.0], 200_000))
    bias, drift = TwoStateClock().process(named_streams(3)).advance(times)
    drift = drift + monitor.sigma_drift_mps * rng.standard_normal(times.size)
    bias = bias + monitor.sigma_bias_m * rng.standard_normal(times.size)
    for name, values in _normalised(monitor.statistics(times, bias, drift)).items():
        spread = np.sqrt(np.mean((values[4:] * monitor.factor) ** 2))
        assert spread == pytest.approx(1.0, abs=0.01), name  # 200,000 dependent values: 1σ is 0.3 %


def test_detection_of_a_step() -> None:
    monitor = ClockDriftMonitor(p_fa=1e-3)
    n = 100_000
    times, bias, drift = _measured(monitor, 1.0, 2, seed=1)
    rng = stream(4, "step")
    for pull in (0.3, 0.5):
        change = pull + monitor.innovation_sigma_mps(np.ones(1))[0] * rng.standard_normal(n)
        limit = monitor.statistics(times, bias, drift).innovation_threshold_mps[1]
        expected = float(monitor.probability_of_detection(np.array([pull]), 1.0)[0])
        assert binomial_test(int(np.count_nonzero(np.abs(change) > limit)), n, expected) > LEVEL


def _run(monitor: ClockDriftMonitor, values: list[tuple[float, float, float]]) -> list[tuple[CheckResult, ...]]:
    history: tuple[ClockEpoch, ...] = ()
    results = []
    for elapsed, bias, drift in values:
        history, checks = monitor.step(history, ClockEpoch(time=START + elapsed, bias_m=bias, drift_mps=drift))
        results.append(checks)
    return results


def test_the_fold_says_what_the_block_says_through_the_end_of_a_week() -> None:
    monitor = ClockDriftMonitor(window=5)
    times, bias, drift = _measured(monitor, 1.0, 40, seed=5)
    block = monitor.statistics(times, bias, drift)
    results = _run(monitor, list(zip(times.tolist(), bias.tolist(), drift.tolist(), strict=True)))
    for k, (innovation, consistency, slope) in enumerate(results):
        if k:
            assert innovation.statistic == pytest.approx(block.innovation_mps[k], abs=1e-9)
            assert consistency.statistic == pytest.approx(block.consistency_m[k], abs=1e-6)
        assert (slope.outcome is Outcome.NOT_RUN) is (k < 4)
        if k >= 4:
            assert slope.statistic == pytest.approx(block.slope_mps2[k], rel=1e-6)
            assert slope.threshold == pytest.approx(block.slope_threshold_mps2[k], rel=1e-6)
    assert all(check.outcome is Outcome.PASS for checks in results[4:] for check in checks)


def test_each_part_sees_its_attack() -> None:
    monitor = ClockDriftMonitor(window=5, sigma_bias_m=1.0)
    still = [(float(t), 0.0, 0.0) for t in range(10)]
    jump = _run(monitor, [*still, (10.0, 1.0, 2.0)])[-1]
    assert jump[0].outcome is Outcome.FAIL
    push = _run(monitor, [*still, (10.0, 30.0, 0.0)])[-1]
    assert [check.outcome for check in push] == [Outcome.PASS, Outcome.FAIL, Outcome.PASS]
    assert "bias left its drift by +30" in push[1].reason
    pulled = _run(monitor, [(float(t), 0.15 * t**2, 0.3 * t) for t in range(10)])[-1]
    assert [check.outcome for check in pulled] == [Outcome.PASS, Outcome.PASS, Outcome.FAIL]
    hidden = _run(monitor, [(float(t), 0.015 * t**2, 0.03 * t) for t in range(10)])[-1]
    assert all(check.outcome is Outcome.PASS for check in hidden), "0.03 m/s² is below the oscillator's own walk"


def test_gaps_and_missing_fixes() -> None:
    monitor = ClockDriftMonitor(window=3, max_gap_s=60.0)
    results = _run(monitor, [(0.0, 0.0, 0.0), (30.0, 0.0, 0.0), (200.0, 1e6, 500.0), (230.0, 1e6 + 15_000, 500.0)])
    assert all(check.outcome is Outcome.NOT_RUN for check in (*results[0], *results[2]))
    assert results[2][0].reason == "no epoch shortly before"
    assert results[3][0].outcome is Outcome.PASS
    assert results[3][2].reason == "fewer than 3 epochs in a row"
    history, checks = monitor.step((), None)
    assert history == ()
    assert all(check.reason.startswith("no position fix") for check in checks)
    with pytest.raises(ValueError, match="three epochs"):
        ClockDriftMonitor(window=2)
