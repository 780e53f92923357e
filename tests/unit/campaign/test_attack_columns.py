"""What the results say of an attack is what was asked for, and signs are those of their texts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vestige.campaign.columns.attack_columns import ATTACK_COLUMNS, attack_columns, phase_columns
from vestige.receiver.simulation import Simulation
from vestige.receiver.snapshots.e1 import tracked_cn0_dbhz
from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.spoofer.interference import Jam, OsnmaDenial
from vestige.spoofer.jammers import ContinuousWave
from vestige.spoofer.phase import Locked
from vestige.spoofer.profiles import Ramp
from vestige.spoofer.repeaters import LiftOff
from vestige.spoofer.spoofer import Attacks, Spoofer

QUICK = Path(__file__).resolve().parents[3] / "scenarios" / "quick.toml"
PULL = Ramp(first=0.0, last=600.0, start_s=5.0, stop_s=25.0)


def _columns(*attacks: Attacks) -> tuple[dict[str, np.ndarray], TruthBlock, Simulation]:
    scenario = load_scenario(QUICK, ["epochs=30"])
    assert isinstance(scenario, CampaignScenario)
    simulation = replace(scenario.simulation(), spoofer=Spoofer(attacks=attacks))
    truth = simulation.truth().advance(0, 30)
    found = phase_columns(simulation.arrival(truth)) | attack_columns(truth, simulation.e1_multipath_m(truth))
    return found, truth, simulation


def test_each_band_has_its_own_spoofing_signal() -> None:
    e1 = LiftOff(delay_m=PULL, power_db=6.0, phase=Locked(phase_rad=4.0), bands=(Band.E1,), start_s=2.0)
    e6 = LiftOff(delay_m=20.0, power_db=-3.0, phase=Locked(phase_rad=0.7), bands=(Band.E6,), start_s=8.0)
    found, _, _ = _columns(e1, e6)
    assert set(found) == set(ATTACK_COLUMNS)
    time_s = np.arange(30.0)
    assert found["truth_spoofed"].tolist() == (time_s >= 2).tolist()
    assert found["truth_e1_spoofer_offset_m"][:, 0] == pytest.approx(np.clip(30 * (time_s - 5), 0, 600))
    assert found["truth_e1_spoofer_power_db"].tolist() == [[6.0 if t >= 2 else -np.inf, -np.inf] for t in time_s]
    assert found["truth_spoofer_power_db"].tolist() == [[-np.inf, -3.0 if t >= 8 else -np.inf] for t in time_s]
    assert found["truth_spoofer_offset_m"][8:, 1] == pytest.approx(np.full(22, 20.0))
    assert found["truth_spoofer_phase_rad"][8:, 1] == pytest.approx(np.full(22, 0.7))


def test_a_phase_lies_within_half_a_turn() -> None:
    found, _, _ = _columns(LiftOff(delay_m=0.0, power_db=0.0, phase=Locked(phase_rad=4.0), bands=(Band.E6,)))
    assert found["truth_spoofer_phase_rad"] == pytest.approx(np.full((30, 1), 4.0 - 2 * np.pi))


def test_e1_that_goes_along_moves_the_prediction() -> None:
    """600 m late on E1 and nothing on E6: the line of sight is 600 m earlier than predicted."""
    found, truth, _ = _columns(LiftOff(delay_m=PULL, power_db=6.0, phase=Locked(), bands=(Band.E1,)))
    quiet, undisturbed, simulation = _columns()
    moved_m = found["truth_prediction_error_m"] - quiet["truth_prediction_error_m"]
    assert found["truth_e1_error_m"][25:] == pytest.approx(np.full(5, 600.0), abs=1e-3)
    quieter_m = truth.e1_noise_m - undisturbed.e1_noise_m  # the stronger signal has less noise
    assert moved_m == pytest.approx(-found["truth_e1_error_m"] - quieter_m, abs=1e-6)
    assert found["truth_e1_captured"][25:].all()
    assert 10 * np.log10(truth.e1.gain[-1]) == pytest.approx(6.0, abs=1e-6)
    above_db = tracked_cn0_dbhz(simulation, truth) - simulation.cn0_e1_dbhz
    assert above_db == pytest.approx(10 * np.log10(truth.e1.gain))


def test_noise_of_each_band() -> None:
    """10 dB of noise on E1: 10 log10(1 + 10). A line on the carrier of E6, J/N = 1: 10 log10(1 + 4), none on BOC."""
    line = Jam(j_over_n_db=0.0, waveform=ContinuousWave(), start_s=10.0)
    found, truth, simulation = _columns(OsnmaDenial(j_over_n_db=10.0), line)
    assert found["truth_e1_noise_rise_db"] == pytest.approx(np.full(30, 10.4139), abs=1e-3)
    tracked_dbhz = tracked_cn0_dbhz(simulation, truth)
    assert tracked_dbhz == pytest.approx(np.full(30, simulation.cn0_e1_dbhz - 10.4139), abs=1e-3)
    assert found["truth_noise_rise_db"] == pytest.approx([0.0] * 10 + [6.9897] * 20, abs=1e-3)
    assert not found["truth_spoofed"].any()
