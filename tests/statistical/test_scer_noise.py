"""Noise of an attacker who estimates the chips of several satellites: samples, drawn correlators, decided chips.

Fixed seeds, two-sided. The decisions of this file have an error of at most 1e-5 together (5 standard deviations, 6e-7
each), so correct code with other seeds would fail once in 100,000 runs.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sky_builder import CLEAN, sky_scenario, whole_block
from vestige.acas_processor.detectors import MaximumDetector
from vestige.acas_processor.processor import AcasProcessor
from vestige.receiver.samples.spoofer_interference import SpooferInterference
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario
from vestige.signals.definitions import E6C
from vestige.spoofer.scer import Scer
from vestige.theory.scer.code_estimation import chip_energy_over_n0, estimation_noise, sign_error_probability

SIGMAS = 5.0
SPOOFED = (7, 8, 13)
SVIDS = (*SPOOFED, 14)
GAIN_DB, POWER_DB = 3.0, 1.0
EPOCHS = 12
RATE_HZ, RECS_S = 12.5e6, 0.016
ATTACK = (
    f'attack=[{{kind="scer", svids={list(SPOOFED)}, delay_m=3000.0, power_db={POWER_DB}, chips="hard", '
    f'reception_gain_db={GAIN_DB}, victim_cn0_dbhz="received"}}]'
)


@cache
def scenario(fidelity: str, *attack: str) -> CampaignScenario:
    """Return a sky of four satellites between 36 and 45 dBHz or so."""
    return sky_scenario(
        *CLEAN,
        f"epochs={EPOCHS}",
        "recs.every=1",
        f"constellation.svids={list(SVIDS)}",
        "constellation.cn0_fall_db=12.0",
        "receiver.cn0_dbhz=45",
        "receiver.e1_tracking=none",
        f'fidelity="{fidelity}"',
        *attack,
    )


@cache
def floors(fidelity: str, *attack: str) -> np.ndarray:
    """Return the measured noise floors of the banks over that of the receiver's own noise, epoch by satellite."""
    of = scenario(fidelity, *attack)
    block, _ = whole_block(of)
    banks = AcasProcessor(detector=MaximumDetector()).measure(block, of.simulated_receiver.assistance).banks
    strength_hz = np.array([10 ** (one.cn0_dbhz / 10) for one in of.simulations])
    return banks.noise_power * RECS_S * (RATE_HZ if fidelity == "samples" else strength_hz)


def expected_sum() -> float:
    """Return N/N0 of the three satellites together, from the theory of decisions."""
    received = {one.svid: one.cn0_dbhz for one in scenario("samples", ATTACK).simulations}
    return 10 ** (POWER_DB / 10) * sum(estimation_noise(received[svid], GAIN_DB, "hard") for svid in SPOOFED)


@pytest.mark.parametrize("fidelity", ["samples", "correlators"])
def test_every_satellite_has_the_sum_of_the_noise_of_all_decisions(fidelity: str) -> None:
    """The rise of the floor by the attack is that of theory, also for the satellite that is not attacked.

    A floor scatters by 1/√81840 = 0.35 % of itself. The spoofing signals of +1 dB add 0.01 of N0 as code noise at most
    (36 to 45 dBHz), which is the allowance beside 5 σ. The noise of one satellite alone is 0.48 or 0.52, a third.
    """
    rise = np.mean(floors(fidelity, ATTACK) - floors(fidelity), axis=0)
    sigma = (2 + expected_sum()) / np.sqrt(RECS_S * E6C.chip_rate_hz * EPOCHS)
    allowed = SIGMAS * sigma
    assert np.all(rise > expected_sum() - allowed)
    assert np.all(rise < expected_sum() + 0.025 + allowed)


def test_samples_and_drawn_correlators_have_the_same_noise() -> None:
    """The model of code noise allows 0.5 % beside 5 σ, as in `test_other_signals`."""
    sampled, drawn = (np.mean(floors(fidelity, ATTACK), axis=0) for fidelity in ("samples", "correlators"))
    sigma = np.sqrt(2 / (RECS_S * E6C.chip_rate_hz * EPOCHS))
    assert sampled == pytest.approx(drawn, rel=SIGMAS * sigma + 0.005)


def test_a_recording_has_the_same_noise_from_any_satellite() -> None:
    for band, expected in ((Band.E6, expected_sum()), (Band.E1, 0.0)):
        each = [
            SpooferInterference(simulation=one, band=band).white(5.0) for one in scenario("samples", ATTACK).simulations
        ]
        assert each == pytest.approx([expected] * len(SVIDS), rel=1e-12)


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5])
def test_chips_that_were_decided_have_the_density_of_the_model(share: float) -> None:
    """Decisions of three satellites, summed and correlated with the chips of another code.

    The chips of satellite i begin `i · share` chips after those of the replica, so a term has (1 − f)² + f² of the
    density of the model, 2/3 on average over f, and all of it if the chips begin together. The model is an upper limit.
    """
    rng, n, n0 = np.random.default_rng(16), 400_000, 1.0
    per_chip = 4
    total, expected, model = np.zeros(n * per_chip), 0.0, 0.0
    for number, dbhz in enumerate((45.0, 40.0, 37.0)):
        energy = float(chip_energy_over_n0(dbhz + GAIN_DB))
        true = rng.choice([-1.0, 1.0], n)
        decided = np.sign(true + rng.standard_normal(n) / np.sqrt(2 * energy))
        matching = 1 - 2 * float(sign_error_probability(energy))
        wrong = decided / matching - true  # beside a matching part as strong as the true chips
        moved = (number * share) % 1.0
        amplitude = np.sqrt(float(chip_energy_over_n0(dbhz)) * n0)
        total += amplitude * np.roll(np.repeat(wrong, per_chip), round(moved * per_chip))
        density = estimation_noise(dbhz, GAIN_DB, "hard")
        model += density
        expected += density * ((1 - moved) ** 2 + moved**2)
    found = np.mean(np.square(total.reshape(n, per_chip).mean(axis=1)))
    assert found == pytest.approx(expected, rel=SIGMAS * np.sqrt(2 / n))
    assert 0.5 * model < expected <= model
    assert (share > 0) == (expected < 0.99 * model)


def test_a_repeater_for_all_satellites_has_its_noise_once() -> None:
    repeated = ATTACK.replace('"hard"', '"repeated"')
    for one in scenario("samples", repeated).simulations:
        white = one.spoofer.effects(Band.E6, one.svid, np.zeros(1)).white
        assert white == pytest.approx(10 ** ((POWER_DB - GAIN_DB) / 10))
        (attack,) = one.spoofer.attacks
        assert type(attack) is Scer
