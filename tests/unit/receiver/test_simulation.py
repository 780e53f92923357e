from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from vestige.receiver.simulation import Simulation
from vestige.records import Status
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"


def _simulation(*settings: str) -> Simulation:
    scenario = load_scenario(SCENARIOS / "quick.toml", settings)
    assert isinstance(scenario, CampaignScenario)
    return scenario.simulation()


@pytest.mark.parametrize("fidelity", ["samples", "correlators"])
def test_a_bank_does_not_depend_on_the_cut(fidelity) -> None:  # type: ignore[no-untyped-def]
    n = 12 if fidelity == "samples" else 1200
    simulation = _simulation(f"epochs={n}")
    whole = simulation.banks(fidelity, 0, simulation.truth().advance(0, n))
    process, first, parts = simulation.truth(), 0, []
    for count in (1, n // 3, n - 1 - n // 3):
        parts.append(simulation.banks(fidelity, first, process.advance(first, count)))
        first += count
    assert np.concatenate([taps for taps, _ in parts]).tobytes() == whole[0].tobytes()
    assert np.concatenate([noise_power for _, noise_power in parts]).tobytes() == whole[1].tobytes()


def test_an_epoch_goes_through_the_real_door() -> None:
    """Encrypted chips, a validated key, an ordinary snapshot: the processor's own verdict is AUTHENTIC."""
    simulation = _simulation("receiver.cn0_dbhz=45", "receiver.cn0_e1_dbhz=45", "epochs=40")
    truth = simulation.truth().advance(0, 40)
    for row in (0, 17, 39):
        snapshot, assistance = simulation.snapshot(row, row, truth, 0.0)
        measurement = simulation.processor.measure(snapshot, assistance)
        (verdict,) = simulation.processor.decide(measurement)
        assert verdict.status is Status.AUTHENTIC
        assert snapshot.received_at + 1.0 < assistance.keys[0].disclosed_at
        late_m = truth.iono_diff_m[row] - truth.e1_noise_m[row]
        assert verdict.range_offset_m == pytest.approx(late_m, abs=8.0)


def test_without_error_models_and_noise_the_line_of_sight_is_where_e1_says() -> None:
    """At 80 dBHz the punctual tap is 1 up to the code's own noise, the others lie on the triangle."""
    off = ("receiver.clock.h0_s=0", "receiver.clock.h_minus_2_hz=0", "receiver.multipath.power_db=-inf")
    iono = ("receiver.ionosphere.core_sigma_m=0", "receiver.ionosphere.tail_probability=0")
    simulation = _simulation(
        *off, *iono, "receiver.e1_tracking.loop_bandwidth_hz=1e-12", "receiver.cn0_dbhz=80", "epochs=3"
    )
    truth = simulation.truth().advance(0, 3)
    triangle = np.maximum(0, 1 - np.abs(simulation.processor.offsets_m) / 58.6105)
    for fidelity in ("samples", "correlators"):
        taps, _ = simulation.banks(fidelity, 0, truth)  # type: ignore[arg-type]
        shape = np.abs(taps) / np.abs(taps[:, 5:6])
        assert shape == pytest.approx(np.tile(triangle, (3, 1)), abs=6 / np.sqrt(81_840) + 2e-3)


@pytest.mark.parametrize("cn0_dbhz", [32.0, 35.0, 40.0])
def test_both_fidelities_have_the_same_distribution(cn0_dbhz: float) -> None:
    """Two-sample KS of every tap's magnitude in σ, 500 epochs of samples against 20,000: p > 0.001/11 family-wise."""
    settings = (f"receiver.cn0_dbhz={cn0_dbhz}", "epochs=20000")
    simulation = _simulation(*settings)
    truth = simulation.truth()
    sampled = simulation.banks("samples", 0, truth.advance(0, 500))
    drawn = _simulation(*settings, "seed=77")
    reference = drawn.banks("correlators", 0, drawn.truth().advance(0, 20_000))
    a, b = (np.abs(taps) / np.sqrt(noise_power / 2)[:, None] for taps, noise_power in (sampled, reference))
    for tap in range(11):
        assert stats.ks_2samp(a[:, tap], b[:, tap]).pvalue > 0.001 / 11, tap
