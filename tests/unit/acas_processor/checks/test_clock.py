from __future__ import annotations

import numpy as np
import pytest

from evidence_builder import evidence, fix_block, outcome
from vestige.acas_processor.checks.check import two_sided_factor
from vestige.acas_processor.checks.clock import ClockCheck, ClockDriftMonitor, ClockHistory, ClockStatistics
from vestige.campaign.statistics import binomial_test
from vestige.navigation.position_fix import Fix
from vestige.receiver.errors.clock import TwoStateClock
from vestige.receiver.errors.error_process import named_streams
from vestige.records import CheckResult, Outcome
from vestige.records.checks import CheckName
from vestige.streams import stream

LEVEL = 1e-4
SIGMA_DRIFT_MPS = 0.03
NAMES = (CheckName.CLOCK_INNOVATION, CheckName.CLOCK_CONSISTENCY, CheckName.CLOCK_SLOPE)


def _history(times: np.ndarray, bias: np.ndarray, drift: np.ndarray, sigma_bias_m: float) -> ClockHistory:
    return ClockHistory(
        time_s=times,
        bias_m=bias,
        drift_mps=drift,
        bias_variance=np.full(times.size, sigma_bias_m**2),
        drift_variance=np.full(times.size, SIGMA_DRIFT_MPS**2),
    )


def _measured(times: np.ndarray, seed: int, sigma_bias_m: float = 3.0) -> ClockHistory:
    bias, drift = TwoStateClock().process(named_streams(seed)).advance(times)
    rng = stream(seed, "fix")
    bias = bias + sigma_bias_m * rng.standard_normal(times.size)
    return _history(times, bias, drift + SIGMA_DRIFT_MPS * rng.standard_normal(times.size), sigma_bias_m)


def _normalised(found: ClockStatistics) -> dict[str, np.ndarray]:
    return {
        "innovation": found.innovation / found.innovation_threshold,
        "consistency": found.consistency / found.consistency_threshold,
        "slope": found.slope / found.slope_threshold,
    }


def test_threshold_of_the_innovation() -> None:
    """1 s, 3 cm/s, K = 5: 0.486 m/s."""
    monitor = ClockDriftMonitor()
    found = monitor.statistics(_history(np.arange(2.0), np.zeros(2), np.zeros(2), 3.0))
    assert 5 / monitor.factor * found.innovation_threshold[1] == pytest.approx(0.486, abs=1e-3)
    assert monitor.factor == pytest.approx(two_sided_factor(monitor.p_fa / 3))


@pytest.mark.parametrize(("step_s", "sigma_bias_m"), [(1.0, 3.0), (30.0, 3.0), (30.0, 0.1), (0.1, 0.01)])
def test_false_alarms_of_each_part(step_s: float, sigma_bias_m: float) -> None:
    """Consecutive epochs share an error, windows share all: only epochs that share nothing are counted."""
    n, p_fa = 400_000, 0.03
    monitor = ClockDriftMonitor(window=5, p_fa=p_fa)
    found = _normalised(monitor.statistics(_measured(step_s * np.arange(n), 7, sigma_bias_m)))
    for name, every in (("innovation", 2), ("consistency", 2), ("slope", 5)):
        apart = found[name][4::every]
        alarms = int(np.count_nonzero(np.abs(apart) > 1))
        assert binomial_test(alarms, apart.size, p_fa / 3) > LEVEL, name


def test_uneven_steps_have_the_right_spread() -> None:
    monitor = ClockDriftMonitor(window=4, p_fa=0.03)
    rng = stream(3, "steps")
    times = np.cumsum(rng.choice([1.0, 30.0, 60.0], 200_000))
    for name, values in _normalised(monitor.statistics(_measured(times, 3))).items():
        spread = np.sqrt(np.mean((values[4:] * monitor.factor) ** 2))
        assert spread == pytest.approx(1.0, abs=0.01), name  # 200,000 dependent values: 1σ is 0.3 %


def test_detection_of_a_step() -> None:
    monitor = ClockDriftMonitor(p_fa=1e-3)
    n = 100_000
    limit = monitor.statistics(_measured(np.arange(2.0), 1)).innovation_threshold[1]
    rng = stream(4, "step")
    for pull in (0.3, 0.5):
        change = pull + limit / monitor.factor * rng.standard_normal(n)
        expected = float(monitor.probability_of_detection(np.array([pull]), 1.0, SIGMA_DRIFT_MPS)[0])
        assert binomial_test(int(np.count_nonzero(np.abs(change) > limit)), n, expected) > LEVEL


def _results(
    monitor: ClockDriftMonitor, values: list[tuple[float, float, float]], *, sigma_bias_m: float = 1.0
) -> list[tuple[CheckResult, ...]]:
    """Return the three checks of each epoch, the whole run as one block."""
    times, bias, drift = np.array(values).T
    n = times.size
    fix = Fix(
        position_m=np.zeros((n, 3)),
        clock_m=bias,
        covariance_m2=np.zeros((n, 4, 4)),
        residual_m=np.zeros((n, 1)),
        geometry=np.zeros((n, 1, 4)),
        weight=np.ones((n, 1)),
        n_used=np.full(n, 4),
    )
    found = fix_block(
        fix,
        drift_mps=drift,
        sigma_drift_mps=np.full(n, SIGMA_DRIFT_MPS),
        own_sigma_clock_m=np.full(n, sigma_bias_m),
    )
    given = evidence((n, 1), fix=found, time_s=times)
    series = [ClockCheck(name=name, monitor=monitor).series(given) for name in NAMES]
    return [tuple(one.result(epoch, 0) for one in series) for epoch in range(n)]


def test_each_part_sees_its_attack() -> None:
    monitor = ClockDriftMonitor(window=5)
    still = [(float(t), 0.0, 0.0) for t in range(10)]
    jump = _results(monitor, [*still, (10.0, 1.0, 2.0)])[-1]
    assert jump[0].outcome is Outcome.FAIL
    push = _results(monitor, [*still, (10.0, 30.0, 0.0)])[-1]
    assert [check.outcome for check in push] == [Outcome.PASS, Outcome.FAIL, Outcome.PASS]
    assert "bias differs from its prediction by +30" in push[1].reason
    pulled = _results(monitor, [(float(t), 0.15 * t**2, 0.3 * t) for t in range(10)])[-1]
    assert [check.outcome for check in pulled] == [Outcome.PASS, Outcome.PASS, Outcome.FAIL]
    hidden = _results(monitor, [(float(t), 0.015 * t**2, 0.03 * t) for t in range(10)])[-1]
    assert all(check.outcome is Outcome.PASS for check in hidden), "0.03 m/s² is below the oscillator's own walk"


def test_gaps_and_missing_fixes() -> None:
    monitor = ClockDriftMonitor(window=3, max_gap_s=60.0)
    values = [(0.0, 0.0, 0.0), (30.0, 0.0, 0.0), (200.0, 1e6, 500.0), (230.0, 1e6 + 15_000, 500.0)]
    results = _results(monitor, values, sigma_bias_m=3.0)
    assert all(check.outcome is Outcome.NOT_RUN for check in (*results[0], *results[2]))
    assert results[2][0].reason == "no position fix shortly before"
    assert results[3][0].outcome is Outcome.PASS
    assert results[3][2].reason == "fewer than 3 position fixes in a row"
    for name in NAMES:
        assert outcome(ClockCheck(name=name, monitor=monitor), evidence()).reason.startswith("no position fix")
    with pytest.raises(ValueError, match="three epochs"):
        ClockDriftMonitor(window=2)
