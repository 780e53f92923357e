"""What an attacker injects is in the samples to a thousandth of a dB, a millimetre and a ten-thousandth of a radian."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vestige.constants import E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.samples.sampled_attack import add_jammers, spoofing_signals, true_signal
from vestige.receiver.samples.sampled_epoch import arrival, e6_samples, window
from vestige.receiver.simulation import SVID, Simulation
from vestige.records import Band, Handover, SampleBatch
from vestige.sample_processor.correlator import correlate
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.signal_generator.keystream import encrypted_chips, encryption_key
from vestige.signal_generator.synthesis import amplitude
from vestige.spoofer.interference import Jam
from vestige.spoofer.jammers import ContinuousWave, Pulsed
from vestige.spoofer.phase import Coherent, Locked, Phase, Slipping
from vestige.spoofer.profiles import Ramp
from vestige.spoofer.repeaters import Forgery, LiftOff, Meaconing
from vestige.spoofer.spoofer import Spoofer

HARSH = Path(__file__).resolve().parents[3] / "scenarios" / "harsh.toml"
CHIP_M = SPEED_OF_LIGHT_MPS / 5.115e6
EPOCH = 3
E6 = (Band.E6,)


def _simulation(*attacks: object) -> Simulation:
    scenario = load_scenario(HARSH, ["epochs=8"])
    assert isinstance(scenario, CampaignScenario)
    return replace(scenario.simulation(), spoofer=Spoofer(attacks=attacks))  # type: ignore[arg-type]


def _injected(simulation: Simulation) -> tuple[SampleBatch, Handover, complex]:
    """Return noise-free samples of the spoofing signals alone, the line of sight's time and its amplitude."""
    truth, sent = simulation.truth().advance(0, 8), simulation.start + EPOCH
    key, strength = encryption_key(simulation.seed), amplitude(simulation.cn0_dbhz, 12.5e6)
    direct = arrival(simulation.line_of_sight, truth, slice(EPOCH, EPOCH + 1))
    taken = window(float(direct.dt_s[0]), simulation.n_chips, simulation.front_end)
    signals = spoofing_signals(
        (key, b"other"), SVID, sent, simulation.line_of_sight, truth, EPOCH, taken, amplitude=strength
    )
    batch, _ = e6_samples(signals, sent, taken, front_end=simulation.front_end, noise_key=None)
    handover = Handover(
        svid=SVID,
        chips=encrypted_chips(key, SVID, sent, simulation.n_chips),
        start_time=sent + float(direct.dt_s[0]),
        doppler_hz=-E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS * float(direct.rate_mps[0]),
        doppler_rate_hz_per_s=-E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS * float(direct.acceleration_mps2[0]),
    )
    return batch, handover, strength * complex(direct.carrier[0])


def _recovered(
    batch: SampleBatch, handover: Handover, line_of_sight: complex, near_m: float, rate_mps: float, doppler_hz: float
) -> tuple[float, float, float]:
    """Return delay in m, power in dB and phase in rad of the one signal near a place, against the line of sight.

    The correlation is largest where every sample meets its own chip. Some 40,000 edges of chips lie anywhere between
    two samples 24 m apart, so the peak is sharp to a millimetre: where |c| is at its largest, in the middle.
    """
    moving = replace(handover, doppler_hz=handover.doppler_hz - E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS * rate_mps)
    delay_m = near_m
    for step_m in (0.1, 1e-3, 1e-4):
        start = handover.start_time + delay_m / SPEED_OF_LIGHT_MPS
        offsets_m = step_m * np.arange(-60, 61)
        bank = correlate(batch, replace(moving, start_time=start), offsets_m)
        assert bank is not None
        height = np.abs(bank.taps)
        delay_m += float(np.mean(offsets_m[height > np.max(height) * (1 - 1e-7)]))
    turns = (doppler_hz + E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS * rate_mps) * bank.integration_s  # beyond the code's
    prompt = bank.taps[np.argmax(height)] / line_of_sight / (np.exp(1j * np.pi * turns) * np.sinc(turns))
    return delay_m, float(20 * np.log10(np.abs(prompt))), float(np.angle(prompt))


@pytest.mark.parametrize("delay_m", [0.0, 13.7, 74.321])
@pytest.mark.parametrize("phase", [Locked(phase_rad=0.7), Slipping(slip_hz=1.3, phase_rad=-0.4), Coherent()])
def test_power_delay_and_phase_are_those_that_were_asked_for(delay_m: float, phase: Phase) -> None:
    attack = LiftOff(delay_m=delay_m, power_db=-3.3, phase=phase, bands=E6)
    expected_rad = {"locked": 0.7, "slipping": -0.4 + 2 * np.pi * 1.3 * EPOCH}.get(
        phase.kind, -2 * np.pi * delay_m * 1278.75e6 / 299_792_458
    )
    slip_hz = 1.3 if phase.kind == "slipping" else 0.0
    found = _recovered(*_injected(_simulation(attack)), near_m=delay_m + 2.0, rate_mps=0.0, doppler_hz=slip_hz)
    assert found[0] == pytest.approx(delay_m, abs=1e-3)
    assert found[1] == pytest.approx(-3.3, abs=1e-3)
    assert np.angle(np.exp(1j * (found[2] - expected_rad))) == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("phase", [Locked(phase_rad=0.7), Coherent()])
def test_a_spoofing_signal_that_moves(phase: Phase) -> None:
    """5 m/s: code and carrier where the profile puts them at the start of the RECS, and on the move in it."""
    moving = Ramp(first=0.0, last=500.0, start_s=0.0, stop_s=100.0)
    attack = LiftOff(delay_m=moving, power_db=2.0, phase=phase, bands=E6)
    doppler_hz = -5.0 * 1278.75e6 / 299_792_458 if phase.kind == "coherent" else 0.0
    found = _recovered(*_injected(_simulation(attack)), near_m=14.0, rate_mps=5.0, doppler_hz=doppler_hz)
    assert found[0] == pytest.approx(5.0 * EPOCH, abs=1e-3)
    assert found[1] == pytest.approx(2.0, abs=1e-3)
    expected_rad = 0.7 if phase.kind == "locked" else -2 * np.pi * 15.0 * 1278.75e6 / 299_792_458
    assert np.angle(np.exp(1j * (found[2] - expected_rad))) == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("delay_s", [3e-7, 4e-3, 17.3e-3, 0.5])
def test_what_a_meaconer_repeats_was_sent_before(delay_s: float) -> None:
    """In the window of the line of sight it has the chips that were sent a delay before, and no others."""
    simulation = _simulation(Meaconing(delay_s=delay_s, power_db=0.0, acquired=False))
    batch, handover, _ = _injected(simulation)
    sent, later_s = handover.chips.transmit_time, -round(delay_s * 5.115e6) / 5.115e6
    direct = arrival(simulation.line_of_sight, simulation.truth().advance(0, 8), slice(EPOCH, EPOCH + 1), later_s)
    before = replace(
        handover,
        chips=encrypted_chips(encryption_key(simulation.seed), SVID, sent + later_s, 80_000),
        start_time=sent + (later_s + delay_s + float(direct.dt_s[0])),
        doppler_hz=-1278.75e6 / 299_792_458 * float(direct.rate_mps[0]),
    )
    strength = amplitude(simulation.cn0_dbhz, 12.5e6)
    bank, present = correlate(batch, before, np.zeros(1)), correlate(batch, handover, np.zeros(1))
    assert bank is not None
    assert present is not None
    assert abs(bank.taps[0]) == pytest.approx(strength, rel=1e-3)
    if delay_s > 1e-6:
        assert abs(present.taps[0]) < strength * 5 / np.sqrt(81_840)


def test_forged_chips_match_nothing() -> None:
    batch, handover, _ = _injected(_simulation(Forgery(power_db=0.0)))
    bank = correlate(batch, handover, np.arange(-75.0, 76.0, 15.0))
    assert bank is not None
    assert np.max(np.abs(bank.taps)) < amplitude(35.0, 12.5e6) * 5 / np.sqrt(81_840)
    assert np.mean(np.abs(batch.samples) ** 2) == pytest.approx(amplitude(35.0, 12.5e6) ** 2, rel=1e-3)


def test_a_window_that_the_attacker_moved_holds_the_true_signal_of_its_time() -> None:
    simulation = _simulation(Meaconing(delay_s=2e-3, power_db=10.0))
    truth = simulation.truth().advance(0, 8)
    assert truth.e1.error_m[EPOCH] == pytest.approx(2e-3 * 299_792_458)
    sent, key = simulation.start + EPOCH, encryption_key(simulation.seed)
    taken = window(float(arrival(simulation.line_of_sight, truth).dt_s[EPOCH]) + 2e-3, 81_840, simulation.front_end)
    signal = true_signal(key, SVID, sent, simulation.line_of_sight, truth, EPOCH, taken, amplitude=1.0)
    assert signal is not None
    batch, _ = e6_samples((signal,), sent, taken, front_end=simulation.front_end, noise_key=None)
    rays = 1 + np.sum(np.abs(truth.rays.amplitude[EPOCH]) ** 2)
    assert np.mean(np.abs(batch.samples[:200]) ** 2) > 0.2 * rays  # it is there from the first sample
    assert np.mean(np.abs(batch.samples[-200:]) ** 2) > 0.2 * rays  # to the last


def test_power_of_a_jammer_in_the_samples() -> None:
    """A line of J/N = 7 dB in 20.46 MHz, against noise of variance 1 in 12.5 MHz."""
    simulation = _simulation(Jam(j_over_n_db=7.0, waveform=ContinuousWave(offset_hz=1e6), bands=E6))
    truth = simulation.truth().advance(0, 8)
    x = np.zeros(100_000, np.complex64)
    add_jammers(x, truth.e6.jammers, EPOCH, rate_hz=12.5e6, seed=1, epoch=EPOCH, first_stream=0)
    assert np.mean(np.abs(x) ** 2) == pytest.approx(10**0.7 * 20.46 / 12.5, rel=1e-4)
    spectrum = np.abs(np.fft.fft(x))
    assert np.fft.fftfreq(x.size, 1 / 12.5e6)[np.argmax(spectrum)] == pytest.approx(1e6, abs=130.0)


def test_two_jammers_are_not_one() -> None:
    """Each has noise of its own, and another one in another epoch."""
    pulses = Jam(j_over_n_db=7.0, waveform=Pulsed(), bands=E6)
    truth = _simulation(pulses, pulses).truth().advance(0, 8)
    found = set()
    for epoch in (3, 4):
        for number in (0, 1):
            alone = tuple(replace(one, j_over_n=one.j_over_n * (k == number)) for k, one in enumerate(truth.e6.jammers))
            x = np.zeros(100_000, np.complex64)
            add_jammers(x, alone, epoch, rate_hz=1e7, seed=1, epoch=epoch, first_stream=0)
            found.add(x.tobytes())
    assert len(found) == 4
