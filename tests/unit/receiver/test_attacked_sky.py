"""Spoofing signals in a recording: what a delay line makes of the true signal, and what a run makes of an epoch."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from simulated_banks import OFFSETS_M, banks, handover_of
from sky_builder import CLEAN, sky_scenario
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.draws import rows_of
from vestige.records import Band
from vestige.sample_processor.correlator import CorrelatableSamples
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.signals.definitions import CARRIER_HZ
from vestige.simulated.exported_case import AcasTestCase, with_default_range
from vestige.simulated.exported_case_folder import simulated
from vestige.simulated.sky_parts import WholeSky

VESTIGIAL = Path(__file__).resolve().parents[3] / "scenarios" / "vestigial.toml"
RATE_HZ = 6.2e6
DELAY_S = 125_000 / RATE_HZ  # a whole number of samples
LIFT_OFF = """
kind = "campaign"
seed = 3
start = "2026-11-21T12:00:00 GST"
epochs = 8
[line_of_sight]
s0_m = 2.4e7
v_mps = 200.0
[recs]
duration_ms = 4
[receiver]
cn0_dbhz = 80.0
cn0_e1_dbhz = 80.0
sample_rate_hz = 6.2e6
[[attack]]
kind = "lift-off"
bands = ["E6"]
delay_m = {kind = "ramp", first = 20.0, last = 60.0, start_s = 0.0, stop_s = 8.0}
power_db = -3.0
reception_gain_db = 90.0
"""


def _case(path: Path, first: int, end: int, *settings: str) -> AcasTestCase:
    scenario = load_scenario(path, settings)
    assert isinstance(scenario, CampaignScenario)
    return AcasTestCase(scenario=with_default_range(scenario), first=first, end=end)


@pytest.mark.parametrize("band", list(Band))
def test_a_meaconer_is_a_delay_line(band: Band) -> None:
    """x(t) + g e^{−j2π f τ} x(t − τ), Doppler and all, sample by sample."""
    settings = (f"receiver.sample_rate_hz={RATE_HZ}", f"attack.0.delay_s={DELAY_S!r}")
    both = simulated(_case(VESTIGIAL, 0, 1, *settings))
    alone = simulated(_case(VESTIGIAL, 0, 1, settings[0], "attack=none"))
    shift, count = round(DELAY_S * RATE_HZ), 300_000
    x, y = (
        np.concatenate([batch.samples for batch in one.record(band, at_most=count, noise=False)])
        for one in (alone, both)
    )
    turns = CARRIER_HZ[band] * DELAY_S
    expected = 10 ** (6 / 20) * np.exp(-2j * np.pi * (turns - np.floor(turns))) * x[:-shift]
    error = y[shift:] - x[shift:] - expected
    differ = np.abs(error) > 2e-3 * np.max(np.abs(x))  # a sample on the edge of a chip may go either way
    assert np.mean(differ) < 2e-3
    assert len(both.samples) - len(alone.samples) == pytest.approx(shift, abs=1)


def test_the_meaconer_repeats_noise() -> None:
    """η/G = 6 − 0 dB on top of the receiver's own: a variance of 4.98."""
    case = simulated(_case(VESTIGIAL, 0, 1, f"receiver.sample_rate_hz={RATE_HZ}", "attack.0.reception_gain_db=0"))
    for band in Band:
        samples = case.window(band, 0.2, 0.3).samples
        assert np.mean(np.abs(samples) ** 2) == pytest.approx(1 + 10**0.6, rel=0.01)


@pytest.mark.parametrize("phase", ['{kind = "coherent"}', '{kind = "locked", phase_rad = 1.0}'])
def test_a_lift_off_is_that_of_a_run(tmp_path: Path, phase: str) -> None:
    """The bank of every epoch is, but for one phase, what `vestige run` correlates: codes, powers, relative phase.

    Without E6-B, which a run has not, and whose correlation with 4 ms of E6-C is up to 2 %.
    """
    path = tmp_path / "lift-off.toml"
    path.write_text(f"{LIFT_OFF}phase = {phase}\n")
    case = _case(path, 2, 5)
    whole = simulated(case)
    encrypted = {band: tuple(replace(one, components=one.components[-1:]) for one in case.sky(band)) for band in Band}
    recorded = replace(whole, sky=WholeSky(signals=encrypted))
    for row, epoch in enumerate(range(2, 5)):
        taps = banks(case.simulation, "samples", epoch, rows_of(case.satellites[0].truth, slice(row, row + 1))).taps[0]
        handover = handover_of(case.simulation, epoch, row, case.satellites[0].truth)
        t_s = float(case.satellites[0].truth.time_s[row])
        window = recorded.window(Band.E6, t_s + 0.07, t_s + 0.1)
        again = CorrelatableSamples(window).correlate(handover, OFFSETS_M)
        assert again is not None
        one, other = taps, again.taps
        turned = other * np.vdot(other, one) / abs(np.vdot(other, one))
        assert np.max(np.abs(turned - one)) < 0.03 * np.max(np.abs(one))


def test_forged_chips_in_a_recording_match_nothing(tmp_path: Path) -> None:
    """10 dB over the true signal: self-noise of 2.2 % of it behind 20,460 chips; the true chips would quadruple it."""
    forgery = 'kind = "forgery"\npower_db = 10.0\n'
    path = tmp_path / "forgery.toml"
    path.write_text(LIFT_OFF.split("[[attack]]", maxsplit=1)[0] + "[[attack]]\n" + forgery)
    forged, alone = _case(path, 2, 3), _case(path, 2, 3, "attack=none")
    handover = handover_of(alone.simulation, 2, 0, alone.satellites[0].truth)
    t_s = float(alone.satellites[0].truth.time_s[0])
    windows = [simulated(case).window(Band.E6, t_s + 0.07, t_s + 0.1) for case in (forged, alone)]
    found, expected = (
        CorrelatableSamples(window).correlate(handover, np.linspace(-60.0, 60.0, 9)) for window in windows
    )
    assert found is not None
    assert expected is not None
    strength = np.max(np.abs(expected.taps))
    assert np.max(np.abs(found.taps - expected.taps)) < 5 * 0.022 * strength
    power, usual = (np.mean(np.abs(window.samples) ** 2) for window in windows)
    assert power > 3 * usual


def test_the_rate_of_a_spoofing_signal_is_that_of_its_range(tmp_path: Path) -> None:
    """dP'/dt by differences: 3 km/s, 30 m/s² and a pull of 5 km/s from 0.1 s on: each term is 0.05 m/s or more."""
    path = tmp_path / "fast.toml"
    motion = "v_mps = 3000.0\na_mps2 = 30.0"
    pull = "first = 3e7, last = 3.004e7, start_s = 0.0, stop_s = 8.0"
    text = LIFT_OFF.replace("v_mps = 200.0", motion).replace(
        "first = 20.0, last = 60.0, start_s = 0.0, stop_s = 8.0", pull
    )
    path.write_text(text, encoding="utf-8")
    case = _case(path, 2, 5)
    true, spoofing_signal = case.sky(Band.E6)
    t_s, step_s = case.satellites[0].truth.time_s + 0.05, 1e-3
    around = [spoofing_signal.pseudorange.range_m(t_s + one * step_s) for one in (-1, 1)]
    assert spoofing_signal.pseudorange.rate_mps(t_s) == pytest.approx((around[1] - around[0]) / 2 / step_s, abs=1e-3)
    rates = [spoofing_signal.pseudorange.rate_mps(t_s + one * step_s) for one in (-1, 1)]
    bend = (rates[1] - rates[0]) / 2 / step_s
    assert spoofing_signal.pseudorange.acceleration_mps2(t_s) == pytest.approx(bend, abs=0.01)
    late_s = (spoofing_signal.pseudorange.range_m(t_s) - true.pseudorange.range_m(t_s)) / SPEED_OF_LIGHT_MPS
    assert np.all(late_s > 0.09)


def test_e1_says_what_it_followed() -> None:
    """Observations of a captured receiver hold the error; of one whose clock went with a meaconer there are none."""
    pushed = _case(VESTIGIAL, 0, 1, "attack.0.delay_s=1e-4")
    (epoch,) = pushed.observations()
    travel_m = epoch.observations[11].pseudorange_m - pushed.satellites[0].path.range_m(np.array([0.086]))[0]
    assert travel_m == pytest.approx(1e-4 * SPEED_OF_LIGHT_MPS, abs=1e-3)
    assert epoch.observations[11].cn0_dbhz == pytest.approx(46 - 0.2, abs=0.2)
    assert not list(_case(VESTIGIAL, 0, 1).observations())


def test_a_window_is_a_part_of_the_recording() -> None:
    one = simulated(_case(VESTIGIAL, 0, 1, f"receiver.sample_rate_hz={RATE_HZ}", "attack=none"))
    whole = np.concatenate([batch.samples for batch in one.record(Band.E6, at_most=200_000)])
    window = one.window(Band.E6, 0.01, 0.02)
    assert window.first_sample == 62_000
    assert np.array_equal(window.samples, whole[62_000:124_000])
    assert replace(window, samples=window.samples[:0]).start == one.reference + 0.01


@pytest.mark.parametrize(("symbols", "right"), [("known", 1.0), ("hard", 0.5)])
def test_scer_replays_what_it_estimates(tmp_path: Path, symbols: str, right: float) -> None:
    """Half of the first chips of E1-B symbols are wrong, as they are guesses; E1-C is the true one."""
    path = tmp_path / "scer.toml"
    path.write_text(LIFT_OFF, encoding="utf-8")
    attack = f'attack=[{{kind="scer", delay_m=0.0, power_db=0.0, symbols="{symbols}"}}]'
    true, spoofing = _case(path, 0, 1, attack).sky(Band.E1)
    (data, pilot), (replayed, same_pilot) = true.components, spoofing.components
    assert same_pilot is pilot
    assert data.symbol is not None
    period = np.arange(1000)
    sent = replayed.chip(4092 * period) * (1 if replayed.symbol is None else replayed.symbol(period))
    assert np.mean(sent == data.chip(4092 * period) * data.symbol(period)) == pytest.approx(right, abs=0.07)


def test_a_growing_delay_is_that_of_the_time_at_which_a_signal_was_sent() -> None:
    """Samples, truth and observations agree to 2 mm while the delay grows by 90 m/s, 1 m in the 11 ms to the tag.

    The truth has the delay at the transmission of the epoch, so the spoofing signal that arrives with the RECS has it.
    """
    ramp = '{kind="ramp", first=0, last=900, start_s=0, stop_s=10}'
    attack = f'attack=[{{kind="lift-off", bands=["E1"], power_db=9, delay_m={ramp}}}]'
    sky = ("epochs=8", "recs.every=4", "constellation.svids=[7, 13, 19]", "receiver.e1_tracking=none", attack)
    case = AcasTestCase(scenario=sky_scenario(*CLEAN, *sky), first=0, end=8)
    signals, parted_s = case.sky(Band.E1), []
    for one, true, spoofing in zip(case.satellites, signals[::2], signals[1::2], strict=True):
        row = slice(5, 8)  # more than a chip from the true signal, which no longer pulls the loop
        arrival_s, tag_s = one.received_s[row], one.tag_s[row]
        late_m = spoofing.pseudorange.range_m(arrival_s) - true.pseudorange.range_m(arrival_s)
        assert late_m == pytest.approx(one.truth.e1.error_m[row], abs=2e-3)
        observed_m = [seen.pseudorange_m for seen in one.observations[row] if seen is not None]
        assert observed_m == pytest.approx(spoofing.pseudorange.range_m(tag_s), abs=2e-3)
        parted_s += np.abs(arrival_s - tag_s).tolist()
    assert max(parted_s) > 5e-3
