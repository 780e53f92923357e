"""Both fidelities draw correlators of one distribution, with and without a front end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from simulated_banks import Banks
from simulated_banks import banks as banks_of
from vestige.receiver.simulation import Simulation
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


def _simulation(*settings: str) -> Simulation:
    scenario = load_scenario(SCENARIOS / "quick.toml", settings)
    assert isinstance(scenario, CampaignScenario)
    return scenario.simulation()


@pytest.mark.judged(
    by="vestige at the other fidelity",
    what="correlators and samples",
    figure="Kolmogorov-Smirnov test of every correlator",
)
@pytest.mark.parametrize("cn0_dbhz", [35.0, 40.0])  # 29, 31 and 33 dBHz: `tests/paper/test_harsh_conditions.py`
def test_both_fidelities_have_the_same_distribution(cn0_dbhz: float) -> None:
    """Two-sample KS of every tap's magnitude in σ, 500 epochs of samples against 20,000: p > 0.001/11 family-wise."""
    settings = (f"receiver.cn0_dbhz={cn0_dbhz}", "epochs=20000")
    simulation = _simulation(*settings)
    truth = simulation.truth()
    sampled = banks_of(simulation, "samples", 0, truth.advance(0, 500))
    drawn = _simulation(*settings, "seed=77")
    _assert_same_distribution(sampled, banks_of(drawn, "correlators", 0, drawn.truth().advance(0, 20_000)))


def _assert_same_distribution(sampled: Banks, drawn: Banks) -> None:
    """Two-sample KS of every tap's magnitude in σ: p > 0.001 for the family of taps."""
    a, b = (np.abs(banks.taps) / np.sqrt(banks.noise_power / 2)[:, None] for banks in (sampled, drawn))
    for tap in range(a.shape[1]):
        assert stats.ks_2samp(a[:, tap], b[:, tap]).pvalue > 0.001 / a.shape[1], tap


FRONT_ENDS = (
    "{bandwidth_hz=10e6, oversampling=2, bits=2}",
    "{bandwidth_hz=6e6}",
    "{bits=1}",
)


@pytest.mark.parametrize("front_end", FRONT_ENDS)
def test_both_fidelities_behind_a_front_end(front_end: str) -> None:
    """At 42 dBHz, so that a peak too high by 2 % or a flank too wide by 1 m would show."""
    settings = (f"receiver.front_end={front_end}", "receiver.cn0_dbhz=42", "epochs=10000")
    simulation, drawn = _simulation(*settings), _simulation(*settings, "seed=78")
    sampled = banks_of(simulation, "samples", 0, simulation.truth().advance(0, 200))
    _assert_same_distribution(sampled, banks_of(drawn, "correlators", 0, drawn.truth().advance(0, 10_000)))
