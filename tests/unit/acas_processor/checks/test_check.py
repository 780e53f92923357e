from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import bdtrc

from vestige.acas_processor.checks.check import (
    Check,
    count_threshold,
    two_sided_detection,
    two_sided_factor,
)
from vestige.acas_processor.checks.clock import ClockDriftMonitor
from vestige.acas_processor.checks.inertial import InertialMonitor
from vestige.acas_processor.checks.osnma import OsnmaAvailabilityMonitor, OsnmaReceptionMonitor
from vestige.acas_processor.checks.power.cn0 import Cn0Monitor
from vestige.acas_processor.checks.power.decision_map import PowerDistortionMonitor
from vestige.acas_processor.checks.power.noise_floor import NoiseFloorMonitor
from vestige.acas_processor.checks.power.received_power import ReceivedPowerMonitor
from vestige.acas_processor.checks.raim import RaimMonitor
from vestige.acas_processor.checks.solution_separation import SolutionSeparationMonitor
from vestige.records import Band

MONITORS: list[Check] = [
    ReceivedPowerMonitor(band=Band.E1),
    ReceivedPowerMonitor(band=Band.E6),
    Cn0Monitor(),
    NoiseFloorMonitor(),
    RaimMonitor(),
    SolutionSeparationMonitor(),
    OsnmaAvailabilityMonitor(),
    OsnmaReceptionMonitor(),
    InertialMonitor(),
    PowerDistortionMonitor(),
]


def test_every_check_says_what_it_is() -> None:
    assert all(isinstance(monitor, Check) for monitor in MONITORS)
    assert len({monitor.name for monitor in MONITORS}) == len(MONITORS)
    assert all(0 < monitor.p_fa < 0.01 and monitor.unit for monitor in MONITORS)


@pytest.mark.parametrize(
    "make",
    [
        lambda p: ReceivedPowerMonitor(band=Band.E1, p_fa=p),
        lambda p: Cn0Monitor(p_fa=p),
        lambda p: NoiseFloorMonitor(p_fa=p),
        lambda p: RaimMonitor(p_fa=p),
        lambda p: OsnmaAvailabilityMonitor(p_fa=p),
        lambda p: OsnmaReceptionMonitor(p_fa=p),
        lambda p: InertialMonitor(p_fa=p),
        lambda p: ClockDriftMonitor(p_fa=p),
    ],
)
@pytest.mark.parametrize("p_fa", [0.0, 1.0, -1.0, math.nan])
def test_a_budget_is_a_probability(make: object, p_fa: float) -> None:
    with pytest.raises(ValueError, match="false-alarm"):
        make(p_fa)  # type: ignore[operator]


@given(p_fa=st.floats(1e-12, 0.5))
def test_a_test_without_a_shift_has_its_budget(p_fa: float) -> None:
    assert two_sided_detection(np.zeros(1), p_fa)[0] == pytest.approx(p_fa, rel=1e-9)
    assert two_sided_detection(np.array([two_sided_factor(p_fa)]), p_fa)[0] == pytest.approx(0.5, abs=p_fa)


@given(trials=st.integers(1, 500), probability=st.floats(1e-4, 0.5), p_fa=st.floats(1e-9, 0.1))
def test_count_threshold_is_the_smallest_that_keeps_the_budget(trials: int, probability: float, p_fa: float) -> None:
    limit = count_threshold(trials, probability, p_fa)
    assert bdtrc(float(limit), trials, probability) <= p_fa
    if limit:
        assert bdtrc(limit - 1.0, trials, probability) > p_fa
