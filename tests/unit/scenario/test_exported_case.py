from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vestige.crypto.recs.recs_segment import decrypt
from vestige.errors import VestigeError
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.signal_generator.keystream import encrypted_chips, encryption_key
from vestige.simulated.exported_case import DEFAULT_RANGE_M, AcasTestCase, with_default_range
from vestige.simulated.exported_case_folder import simulated

QUICK = Path(__file__).resolve().parents[3] / "scenarios" / "quick.toml"
NIGHT = QUICK.with_name("night.toml")
SETTINGS = ("receiver.sample_rate_hz=6.2e6", "interval_s=0.1", "epochs=500", "recs.duration_ms=4")


def case(first: int, end: int, *settings: str) -> AcasTestCase:
    scenario = load_scenario(QUICK, (*SETTINGS, *settings))
    assert isinstance(scenario, CampaignScenario)
    return AcasTestCase(scenario=with_default_range(scenario), first=first, end=end)


def test_the_recs_are_those_of_a_run() -> None:
    """Key delay 0 and 1, over the end of a subframe: with their keys they decrypt to what the satellite sends."""
    for key_delay in (0, 1):
        one = case(298, 303, f"recs.key_delay={key_delay}")
        simulation, assistance = one.simulation, one.assistance()
        assert len(assistance.segments) == 5
        keys = {key.time: key for key in assistance.keys}
        for row, segment in enumerate(assistance.segments):
            assert (segment, keys[segment.key_time]) == simulation.segment(298 + row)
            sent = encrypted_chips(encryption_key(simulation.seed), 11, segment.transmit_time, simulation.n_chips)
            assert np.array_equal(decrypt(segment, keys[segment.key_time]).chips, sent.chips)


def test_the_truth_is_that_of_the_campaign() -> None:
    whole, part = case(0, 30), case(20, 25)
    for name in ("clock_m", "iono_diff_m", "e1_noise_m", "range_m"):
        assert np.array_equal(getattr(part.satellites[0].truth, name), getattr(whole.satellites[0].truth, name)[20:25])
    (some,), (every,) = part.truth_tables(), whole.truth_tables()
    assert some["range_offset_m"] == every["range_offset_m"][20:25]


def test_recordings_of_one_scenario_overlap_bit_for_bit() -> None:
    whole, part = (simulated(case(*epochs)) for epochs in ((0, 12), (3, 5)))
    for band in Band:
        a, b = (np.concatenate([x.samples for x in one.record(band)]) for one in (whole, part))
        skip = part.samples.start - whole.samples.start
        assert skip == round(0.3 * 6.2e6)
        assert np.array_equal(b, a[skip : skip + b.size])


def test_observations_are_the_truth_with_its_errors() -> None:
    """What geometry and clock say 86 ms after each epoch, with the noise of the epoch."""
    one = case(3, 6)
    path = one.simulation.line_of_sight
    for row, epoch in enumerate(one.observations()):
        t = np.array([one.satellites[0].truth.time_s[row] + 0.086])
        assert epoch.time - one.simulation.start == pytest.approx(t[0], abs=1e-9)
        clock_m = one.satellites[0].truth.clock_m[row] + 0.086 * one.satellites[0].truth.clock_drift_mps[row]
        expected = path.range_m(t)[0] + clock_m + one.satellites[0].truth.e1_noise_m[row]
        assert epoch.observations[11].pseudorange_m == pytest.approx(expected, abs=5e-3)  # the clock's walk in 0.1 s
        doppler_hz = (
            -(
                path.rate_mps(t)[0]
                + one.satellites[0].truth.clock_drift_mps[row]
                + one.satellites[0].truth.e1_rate_noise_mps[row]
            )
            / 0.1902937
        )
        assert epoch.observations[11].doppler_hz == pytest.approx(doppler_hz, abs=0.5)  # 1.8 mm in 0.1 s


def test_the_group_delay_delays_e6_alone() -> None:
    """A plausible value of either sign that the file holds, and what the bands of the samples differ by."""
    bgd_s = {seed: case(0, 1, f"seed={seed}").satellites[0].bgd_s for seed in range(20)}
    assert all(1e-9 < abs(value) < 5e-9 and (value * 2**32).is_integer() for value in bgd_s.values())
    assert {np.sign(value) for value in bgd_s.values()} == {-1, 1}
    one = case(3, 5)
    left_m = (
        one.satellites[0].truth.iono_diff_m[0]
        + one.satellites[0].truth.bias_m[0]
        + 0.5178 * 299_792_458 * one.satellites[0].bgd_s
    )
    when = float(one.satellites[0].received_s[0]) + one.simulation.integration_s / 2  # the middle of the RECS
    assert one.satellites[0].received(Band.E6)[0].propagation(when).delay_m == pytest.approx(left_m, abs=1e-3)
    assert one.satellites[0].received(Band.E1)[0].propagation(when).delay_m == 0


def test_the_carrier_phase_is_the_integral_of_the_doppler() -> None:
    """It grows as the range does: its differences are −Doppler times 0.1 s within the noise of both, 5σ.

    Without the phase noise it is the pseudorange without noise and multipath, whole cycles apart.
    """
    one = case(3, 103)
    wavelength_m, tracking = 0.19029367, one.simulation.models.e1_tracking
    assert tracking is not None
    observed = [epoch.observations[11] for epoch in one.observations()]
    phase, doppler_hz, code_m = np.array([(x.carrier_phase_cycles, x.doppler_hz, x.pseudorange_m) for x in observed]).T
    left = np.diff(phase) + 0.1 * (doppler_hz[1:] + doppler_hz[:-1]) / 2
    noise = 2 * (tracking.carrier_sigma_m(35.0) / wavelength_m) ** 2 + 0.01 * tracking.doppler_sigma_hz(35.0) ** 2 / 2
    assert np.abs(left).max() < 5 * np.sqrt(noise) + 0.02  # a parabola in 0.1 s, and the clock's walk
    assert np.std(left) > 0.5 * np.sqrt(noise)
    cycles = phase - (code_m - one.satellites[0].e1_error_m + one.satellites[0].truth.e1_phase_noise_m) / wavelength_m
    assert np.ptp(cycles) < 0.01
    assert abs(cycles[0]) > 1


def test_a_satellite_at_no_distance_is_placed() -> None:
    assert case(0, 1).simulation.line_of_sight.s0_m == DEFAULT_RANGE_M
    assert case(0, 1, "line_of_sight.s0_m=2.4e7").simulation.line_of_sight.s0_m == 2.4e7


@pytest.mark.parametrize("epochs", [(0, 0), (5, 4), (0, 501), (500, 501)])
def test_epochs_that_there_are_not(epochs: tuple[int, int]) -> None:
    with pytest.raises(VestigeError, match="expected first:end within"):
        case(*epochs)


@pytest.mark.parametrize(
    ("setting", "found"),
    [("s0_m=1.0", "of travel"), ("s0_m=6e7", "of travel"), ("v_mps=2e4", "m/s")],
)
def test_a_satellite_that_cannot_be(setting: str, found: str) -> None:
    with pytest.raises(VestigeError, match=found):
        case(0, 1, f"line_of_sight.{setting}")


def test_the_front_end_of_the_scenario_is_that_of_the_recording() -> None:
    """Both bands, through one filter and one quantiser each."""
    one = simulated(case(0, 1, "receiver.front_end.bits=2", "receiver.front_end.bandwidth_hz=5e6"))
    for band in Band:
        levels = np.unique(next(iter(one.record(band, at_most=10_000))).samples.view(np.float32))
        assert levels.tolist() == [-3.0, -1.0, 1.0, 3.0]


@pytest.mark.parametrize("waveform", ["wideband", "chirp"])
def test_observations_are_missing_where_the_campaign_has_none(waveform: str) -> None:
    """A jammer takes the lock from epoch 5 to 8, then E1 is acquired again, in `vestige run` and in the files."""
    jammer = f'attack=[{{kind="jamming", start_s=5, stop_s=9, waveform={{kind="{waveform}"}}, j_over_n_db=30.0}}]'
    scenario = load_scenario(NIGHT, ("constellation.svids=[7, 8]", "epochs=14", "receiver.reacquisition_s=2.0", jammer))
    assert isinstance(scenario, CampaignScenario)
    truth = tuple(one.advance(0, 14) for one in scenario.simulated_receiver.truth())
    campaign = scenario.simulated_receiver.snapshots(0, truth).e1
    satellites = AcasTestCase(scenario=scenario, first=2, end=14).satellites
    shown = np.array([[found is not None for found in one.observations] for one in satellites]).T
    assert np.array_equal(shown, campaign.seen[2:])
    assert shown[:3].all()
    assert not shown[3:7].any()
    assert not shown[7].any()  # it acquires
    assert shown[-1].all()


@pytest.mark.parametrize(
    ("attack", "end", "settings"),
    [
        ("", 1, ()),
        ('kind="meaconing", delay_s=10', 24, ()),
        ('kind="meaconing", delay_s=40', 1, ()),
        ('kind="meaconing", delay_s=60', 180, ()),
        ('kind="meaconing", delay_s=60', 180, ('start="2026-11-22T22:00:29 GST"',)),
        ('kind="forgery-after-disclosure", delay_s=32', 1, ("recs.key_delay=0",)),
        ('kind="forgery-after-disclosure", delay_s=120, range_offset_m=1e10', 180, ()),
    ],
)
def test_the_message_lasts_as_long_as_the_samples(attack: str, end: int, settings: tuple[str, ...]) -> None:
    """Both ends of the recording have samples, and every page of the message has OSNMA."""
    attacks = f"attack=[{{{attack}, power_db=6}}]" if attack else "attack=[]"
    sky = ("receiver.sample_rate_hz=6.2e6", "constellation.svids=[6, 7]")
    scenario = load_scenario(NIGHT, (*sky, attacks, *settings))
    assert isinstance(scenario, CampaignScenario)
    one = AcasTestCase(scenario=scenario, first=0, end=end)
    recording = simulated(one)
    begin_s, end_s = (at / recording.sample_rate_hz for at in (one.samples.start, one.samples.stop))
    for at_s in (begin_s, end_s - 0.02):
        assert recording.window(Band.E1, at_s, at_s + 0.02).samples.size == 124_000
    assert one.message is not None
    assert all(len(pages) == 15 * one.message.n_subframes for pages in one.message.pages.values())


def test_a_late_part_of_a_sky_has_the_samples_of_the_whole() -> None:
    """The message of the part begins 16 minutes later than that of the whole, after a change of ephemerides."""
    sky = ("receiver.sample_rate_hz=6.2e6", "constellation.svids=[6, 7]", "epochs=1200")
    scenario = load_scenario(NIGHT, sky)
    assert isinstance(scenario, CampaignScenario)
    whole, part = (AcasTestCase(scenario=scenario, first=first, end=1200) for first in (0, 1170))
    assert whole.message is not None
    assert part.message is not None
    assert part.message.first - whole.message.first == 39 * 30
    for band in Band:
        one, other = (simulated(case).window(band, 1180.0, 1180.05).samples for case in (whole, part))
        assert np.array_equal(one, other)
