from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import bdtr, bdtrc

from evidence_builder import evidence, outcome
from vestige.acas_processor.checks.power.e6_cn0 import E6StrengthMonitor
from vestige.acas_processor.monitoring.baseline import Quantity
from vestige.records import CheckResult, Outcome

N = 200_000
T_S = 0.016


def magnitudes(cn0_dbhz: float, change_db: float = 0.0, n: int = N) -> np.ndarray:
    s = math.sqrt(2 * 10 ** (cn0_dbhz / 10) * T_S) * 10 ** (change_db / 20)
    rng = np.random.default_rng(4)
    return np.abs(s + rng.standard_normal(n) + 1j * rng.standard_normal(n))


@pytest.mark.parametrize("cn0_dbhz", [33.0, 35.0, 45.0])
def test_false_alarms_of_thermal_noise_alone_meet_the_budget(cn0_dbhz: float) -> None:
    """|c| is Rician, as good as normal about √(s² + 1); two-sided at 1e-4 about ± 3 % of 1e-2."""
    monitor = E6StrengthMonitor(sigma_model_db=0.0, p_fa=1e-2)
    expected = np.full(N, cn0_dbhz)
    statistic = monitor.statistic(magnitudes(cn0_dbhz), expected, T_S)
    failed = int(np.count_nonzero(np.abs(statistic) > monitor.threshold(expected, T_S)))
    assert bdtr(failed, N, 0.97e-2) > 5e-5
    assert bdtrc(failed - 1, N, 1.03e-2) > 5e-5


def test_what_changes_it_and_what_does_not() -> None:
    """s = 10 at 35 dBHz: 1.5 dB of slack and noise are 2.1 σ, K at 1e-6 is 4.9: no fade is so deep, a sum may be."""
    monitor, expected = E6StrengthMonitor(), np.full(1000, 35.0)
    limit = monitor.threshold(expected, T_S)
    assert limit[0] == pytest.approx(4.89 * math.hypot(1.0, 10.06 * (10 ** (1.5 / 20) - 1)), rel=2e-3)
    for change_db, low, high in ((8.6, 0.95, 1.0), (2.4, 0.0, 0.01), (-3.3, 0.0, 0.01), (-40.0, 0.0, 0.0)):
        failed = np.abs(monitor.statistic(magnitudes(35.0, change_db, 1000), expected, T_S)) > limit
        assert low <= np.mean(failed) <= high, change_db


def test_the_check_of_one_bank() -> None:
    def of(tap: float | None, expected: float | None) -> CheckResult:
        given = evidence(
            usual={Quantity.E6_CN0_DBHZ: expected},
            taps=None if tap is None else [[[tap]]],
            noise_power=None if tap is None else 2.0,
            integration_s=T_S,
        )
        return outcome(E6StrengthMonitor(), given)

    assert of(10.0, 35.0).outcome is Outcome.PASS
    failed = of(30.0, 35.0)
    assert failed.outcome is Outcome.FAIL
    assert failed.statistic == pytest.approx(30.0 - math.sqrt(2 * 10**3.5 * T_S + 1))
    assert "expected strength" in failed.reason
    assert of(None, 35.0).reason == "nothing was correlated on E6"
    assert of(10.0, None).outcome is Outcome.NOT_RUN
