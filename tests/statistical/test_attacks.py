"""Both fidelities have the same distribution under attack, and in noise that is not white.

Two-sample KS of every tap's magnitude in σ, 200 epochs of samples against 3,000; eleven taps share an error of 1e-3 a
case. The epochs of a case are statistically alike, so that both may have different ones.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from simulated_banks import Banks
from simulated_banks import banks as banks_of
from vestige.receiver.simulation import Fidelity
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.spoofer.interference import Jam
from vestige.spoofer.jammers import Chirp, ContinuousWave, Pulsed
from vestige.spoofer.phase import Slipping
from vestige.spoofer.repeaters import Forgery, LiftOff, Meaconing
from vestige.spoofer.spoofer import Attacks, Spoofer

HARSH = Path(__file__).resolve().parents[2] / "scenarios" / "harsh.toml"
E6 = (Band.E6,)
TURNING = Slipping(slip_hz=0.37)  # all phases, one epoch a second

CASES: dict[str, tuple[Attacks, ...]] = {
    "close by": (LiftOff(delay_m=20.0, power_db=-3.0, phase=TURNING, bands=E6, reception_gain_db=0.0),),
    "stronger, on E1 too": (LiftOff(delay_m=50.0, power_db=3.0, phase=TURNING),),
    "repeated 1 ms later": (Meaconing(delay_s=1e-3, power_db=25.0, acquired=False, reception_gain_db=60.0),),
    "captured 3 s later": (Meaconing(delay_s=3.0, power_db=10.0, reception_gain_db=10.0),),
    "forged chips": (Forgery(power_db=25.0, delay_m=17.0),),
    "wideband": (Jam(j_over_n_db=3.0, bands=E6),),
    "line": (Jam(j_over_n_db=0.0, waveform=ContinuousWave(offset_hz=3e5), bands=E6),),
    "chirp": (Jam(j_over_n_db=2.0, waveform=Chirp(), bands=E6),),
    "pulses": (Jam(j_over_n_db=3.0, waveform=Pulsed(), bands=E6),),
    "two at once": (
        LiftOff(delay_m=70.0, power_db=4.0, phase=TURNING, bands=E6),
        Jam(j_over_n_db=-3.0, bands=E6),
    ),
}


def _banks(fidelity: Fidelity, attacks: tuple[Attacks, ...], seed: int, n: int) -> Banks:
    scenario = load_scenario(HARSH, ["epochs=5000", f"seed={seed}"])
    assert isinstance(scenario, CampaignScenario)
    simulation = replace(scenario.simulation(), spoofer=Spoofer(attacks=attacks))
    return banks_of(simulation, fidelity, 0, simulation.truth().advance(0, n))


@pytest.mark.judged(
    by="vestige at the other fidelity",
    what="attacks as correlators and as samples",
    figure="p > 0.001 for all correlators together",
)
@pytest.mark.parametrize("attacks", CASES.values(), ids=CASES)
def test_both_fidelities_have_the_same_distribution(attacks: tuple[Attacks, ...]) -> None:
    sampled, drawn = _banks("samples", attacks, 11, 200), _banks("correlators", attacks, 12, 3000)
    a, b = (np.abs(banks.taps) / np.sqrt(banks.noise_power / 2)[:, None] for banks in (sampled, drawn))
    for tap in range(11):
        assert stats.ks_2samp(a[:, tap], b[:, tap]).pvalue > 1e-3 / 11, tap
    rise = [np.mean(banks.noise_power) / quiet for banks, quiet in zip((sampled, drawn), _quiet(), strict=True)]
    assert rise[0] == pytest.approx(rise[1], rel=0.07)  # 5 % are the folded side lobes of the chips


@cache
def _quiet() -> tuple[float, float]:
    """Return the noise floor of both fidelities without an attack."""
    sampled, drawn = _banks("samples", (), 11, 50), _banks("correlators", (), 12, 50)
    return float(np.mean(sampled.noise_power)), float(np.mean(drawn.noise_power))


def test_epochs_that_cannot_be_decrypted_are_the_same() -> None:
    """A meaconer of 25 s: the receiver trusts no signal that arrives after the disclosure of the key by its clock."""
    attacks = (Meaconing(delay_s=25.0, power_db=10.0),)
    sampled, drawn = _banks("samples", attacks, 11, 60), _banks("correlators", attacks, 12, 60)
    lost = np.isnan(sampled.noise_power)
    assert 0 < np.count_nonzero(lost) < 60
    assert np.array_equal(lost, np.isnan(drawn.noise_power))
    assert np.array_equal(lost, np.isnan(drawn.taps).all(axis=1))
