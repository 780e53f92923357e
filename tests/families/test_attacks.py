"""Laws that hold for every kind of attack."""

from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError, replace
from math import inf
from pathlib import Path

import numpy as np
import pytest

from extend_page import page_part
from simulated_banks import Banks
from simulated_banks import banks as banks_of
from vestige.receiver.simulation import Fidelity, Simulation
from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.spoofer.after_disclosure import ForgeryAfterDisclosure
from vestige.spoofer.attack import Attack
from vestige.spoofer.between_recs import BetweenRecs
from vestige.spoofer.interference import Jam, OsnmaDenial
from vestige.spoofer.jammers import Chirp, ContinuousWave, Pulsed
from vestige.spoofer.profiles import Ramp
from vestige.spoofer.repeaters import (
    E1Asynchronous,
    Forgery,
    LiftOff,
    Meaconing,
    Nulling,
    PositionPush,
    TimePush,
)
from vestige.spoofer.scer import Scer
from vestige.spoofer.spoofer import ALL_ATTACKS, NO_SPOOFER, Spoofer

QUICK = Path(__file__).resolve().parents[2] / "scenarios" / "quick.toml"
PULL = Ramp(first=0.0, last=30.0, start_s=0.0, stop_s=15.0)
OFF = {"power_db": -inf}
SWING = page_part("my_attack:Swing")  # of a user: docs/extend.md

# An attack, and what makes it powerless
CASES: dict[str, tuple[Attack, dict[str, float]]] = {
    "e1-asynchronous": (E1Asynchronous(delay_m=4000.0), OFF),
    "lift-off": (LiftOff(delay_m=PULL, power_db=3.0), OFF),
    "early lift-off": (LiftOff(delay_m=-20.0, power_db=3.0), OFF),
    "position-push": (PositionPush(delay_m=PULL, power_db=3.0, svids=(4, 11)), OFF),
    "time-push": (TimePush(delay_m=PULL, power_db=3.0), OFF),
    "meaconing": (Meaconing(delay_s=3e-7, power_db=6.0), OFF),
    "slow meaconing": (Meaconing(delay_s=2.0, power_db=6.0), OFF),
    "scer": (Scer(delay_m=PULL, power_db=3.0), OFF),
    "scer with estimates": (Scer(delay_m=PULL, power_db=3.0, chips="soft", symbols="hard"), OFF),
    "between-recs": (BetweenRecs(top_m=50.0, power_db=3.0, period_s=1.0, guard_s=0.2), OFF),
    "nulling": (Nulling(), {"gain_db": -inf}),
    "nulling of both": (Nulling(bands=(Band.E1, Band.E6)), {"gain_db": -inf}),
    "forgery": (Forgery(power_db=20.0), OFF),
    "forgery-after-disclosure": (ForgeryAfterDisclosure(delay_s=45.0, power_db=6.0), OFF),
    "jamming": (Jam(j_over_n_db=6.0), {"j_over_n_db": -inf}),
    "cw": (Jam(j_over_n_db=6.0, waveform=ContinuousWave(offset_hz=1e5)), {"j_over_n_db": -inf}),
    "chirp": (Jam(j_over_n_db=6.0, waveform=Chirp()), {"j_over_n_db": -inf}),
    "pulsed": (Jam(j_over_n_db=6.0, waveform=Pulsed()), {"j_over_n_db": -inf}),
    "osnma-denial": (OsnmaDenial(), {"j_over_n_db": -inf}),
    "my_attack:Swing": (SWING(swing_m=40.0, period_s=20.0), OFF),
}
every_attack = pytest.mark.parametrize(("attack", "off"), CASES.values(), ids=CASES)
BOTH: tuple[Fidelity, ...] = ("samples", "correlators")


def _simulation(*attacks: Attack, epochs: int = 20) -> Simulation:
    scenario = load_scenario(QUICK, [f"epochs={epochs}"])
    assert isinstance(scenario, CampaignScenario)
    return replace(scenario.simulation(), spoofer=Spoofer(attacks=attacks))


def _run(fidelity: Fidelity, *attacks: Attack, epochs: int = 20) -> tuple[TruthBlock, Banks]:
    simulation = _simulation(*attacks, epochs=epochs)
    truth = simulation.truth().advance(0, epochs)
    return truth, banks_of(simulation, fidelity, 0, truth)


@pytest.fixture(scope="module")
def undisturbed() -> dict[Fidelity, tuple[TruthBlock, Banks]]:
    return {fidelity: _run(fidelity) for fidelity in BOTH}


def test_every_attack_has_a_case() -> None:
    assert {type(attack) for attack, _ in CASES.values()} == {*ALL_ATTACKS, SWING}
    assert {attack.kind for attack, _ in CASES.values()} <= set(CASES)


@every_attack
@pytest.mark.parametrize("fidelity", BOTH)
def test_without_power_nothing_changes(
    attack: Attack, off: dict[str, float], fidelity: Fidelity, undisturbed: dict[Fidelity, tuple[TruthBlock, Banks]]
) -> None:
    """Bit for bit, at both fidelities: powerless, over before it began, or not yet begun."""
    truth, banks = undisturbed[fidelity]
    for harmless in (replace(attack, **off), replace(attack, start_s=1e4)):  # type: ignore[arg-type]
        other_truth, other = _run(fidelity, harmless)
        assert other.taps.tobytes() == banks.taps.tobytes()
        assert other.noise_power.tobytes() == banks.noise_power.tobytes()
        for name in ("e1_noise_m", "e1_rate_noise_mps", "clock_m"):
            assert getattr(other_truth, name).tobytes() == getattr(truth, name).tobytes()
        assert not np.any(other_truth.e1.error_m)
        assert np.all(other_truth.e1.gain == 1)


@every_attack
@pytest.mark.parametrize("fidelity", BOTH)
def test_with_power_something_changes(
    attack: Attack, off: dict[str, float], fidelity: Fidelity, undisturbed: dict[Fidelity, tuple[TruthBlock, Banks]]
) -> None:
    """Whatever it is aimed at: the correlators, E1, or the keys."""
    truth, banks = undisturbed[fidelity]
    other_truth, other = _run(fidelity, attack)
    touched = other.taps.tobytes() != banks.taps.tobytes()
    assert touched or np.any(other_truth.e1.worst_error_m != truth.e1.worst_error_m)


@every_attack
@pytest.mark.parametrize("fidelity", BOTH)
def test_results_do_not_depend_on_the_cut(attack: Attack, off: dict[str, float], fidelity: Fidelity) -> None:
    n = 8 if fidelity == "samples" else 1100
    simulation = _simulation(attack, epochs=n)
    whole = banks_of(simulation, fidelity, 0, simulation.truth().advance(0, n))
    process, first, parts = simulation.truth(), 0, []
    for count in (1, n // 3, n - 1 - n // 3):
        parts.append(banks_of(simulation, fidelity, first, process.advance(first, count)))
        first += count
    assert np.concatenate([part.taps for part in parts]).tobytes() == whole.taps.tobytes()
    assert np.concatenate([part.noise_power for part in parts]).tobytes() == whole.noise_power.tobytes()


@every_attack
def test_off_outside_its_time(attack: Attack, off: dict[str, float]) -> None:
    brief = replace(attack, start_s=5.0, stop_s=8.0)
    times_s = np.array([0.0, 4.999, 8.0, 20.0])
    for band in Band:
        effects = Spoofer(attacks=(brief,)).effects(band, 11, times_s)
        assert np.all(effects.power_db == -inf)
        assert np.all(effects.rise(band) == 0)
    assert not brief.withholds_osnma(8.0, 20.0)


@every_attack
def test_spoofing_signals_are_for_its_satellites(attack: Attack, off: dict[str, float]) -> None:
    if attack.kind == "time-push":
        return
    aimed = Spoofer(attacks=(replace(attack, svids=(4, 7)),))
    times_s = np.arange(10.0)
    for band in Band:
        assert np.all(aimed.effects(band, 11, times_s).power_db == -inf)
        assert np.array_equal(aimed.effects(band, 4, times_s).white, aimed.effects(band, 11, times_s).white)


@every_attack
def test_frozen_and_pickled(attack: Attack, off: dict[str, float]) -> None:
    with pytest.raises((FrozenInstanceError, AttributeError)):
        attack.start_s = 3.0  # type: ignore[misc]
    assert pickle.loads(pickle.dumps(attack)) == attack  # noqa: S301


@every_attack
def test_outside_assumption_2(attack: Attack, off: dict[str, float]) -> None:
    """Only what nulls E6, or comes before the true signal on E6, is beyond the paper's attacker."""
    beyond = {CASES["nulling of both"][0], CASES["early lift-off"][0]}
    assert bool(attack.outside_assumption_2) == (attack in beyond)
    assert len(Spoofer(attacks=(attack, attack)).warnings()) == 2 * (attack in beyond)


def test_attacks_combine() -> None:
    """Two at once add what each of them adds."""
    one, two = CASES["lift-off"][0], CASES["jamming"][0]
    times_s = np.arange(20.0)
    both = Spoofer(attacks=(one, two)).effects(Band.E6, 11, times_s)
    alone = [Spoofer(attacks=(attack,)).effects(Band.E6, 11, times_s) for attack in (one, two)]
    assert np.array_equal(both.white, alone[0].white + alone[1].white)
    assert np.array_equal(both.power_db, np.concatenate([alone[0].power_db, alone[1].power_db], axis=1))
    assert NO_SPOOFER.effects(Band.E6, 11, times_s).power_db.shape == (20, 0)
