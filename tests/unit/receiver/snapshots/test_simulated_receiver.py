"""What a simulated receiver hands over: by any cut the same bits, and nothing that it cannot know."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sky_builder import CLEAN, sky_scenario
from vestige.acas_processor.detectors import MaximumDetector
from vestige.acas_processor.processor import AcasProcessor
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.samples.recorder import BandRecorder
from vestige.receiver.snapshots.e6 import SimulatedE6Samples
from vestige.receiver.snapshots.receiver_truth import ReceiverTruth
from vestige.receiver.snapshots.sky_samples import SkySamples
from vestige.records import Band
from vestige.records.snapshot_block import SearchRequest, SnapshotBlock
from vestige.records.time_uncertainty import TimeUncertainty
from vestige.records.times import GalileoTimes
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import simulated
from vestige.simulated.sky_parts import WholeSky

QUICK = Path(__file__).resolve().parents[4] / "scenarios" / "quick.toml"
ATTACKS = (
    'attack=[{kind="meaconing", start_s=30, delay_s=2.1013, power_db=3.0, bands=["E1", "E6"]},'
    '{kind="osnma-denial", start_s=10, j_over_n_db=25.0}]'
)


def _quick(*settings: str) -> CampaignScenario:
    scenario = load_scenario(QUICK, settings)
    assert isinstance(scenario, CampaignScenario)
    return scenario


def _blocks(scenario: CampaignScenario, *cuts: int) -> list[SnapshotBlock]:
    receiver, ends = scenario.simulated_receiver, [*cuts, scenario.epochs]
    processes = receiver.truth()
    return [
        receiver.snapshots(low, tuple(one.advance(low, high - low) for one in processes))
        for low, high in zip([0, *ends[:-1]], ends, strict=True)
    ]


def _request(block: SnapshotBlock) -> SearchRequest:
    rows = np.flatnonzero(block.recs)
    return SearchRequest(
        epoch=rows,
        uncertainty=(TimeUncertainty(initial_s=1.0),) * rows.size,
        p_fa=1e-6,
        expected_s=np.full((rows.size, len(block.svids)), np.nan),
    )


def _said(scenario: CampaignScenario, block: SnapshotBlock) -> dict[str, np.ndarray]:
    """Return all arrays that can be asked of a block; epochs along the first axis."""
    assistance = scenario.simulated_receiver.assistance
    assert block.searches is not None
    records = {
        "e1": block.e1,
        "E1": block.front_end[Band.E1],
        "E6": block.front_end[Band.E6],
        "banks": AcasProcessor().measure(block, assistance).banks,
        "recs": assistance.recs_of(block).block,
        "search": block.searches.e1(_request(block)),
        "exhaustive": block.searches.exhaustive(_request(block)),
        "osnma": block.osnma,
        "increments": block.increments,
        "block": block,
    }
    found = {}
    for name, record in records.items():
        if record is not None:
            found |= {f"{name}.{field}": values for field, values in _arrays(record).items()}
    found.pop("banks.offsets_m")
    for name in ("osnma.epoch", "increments.epoch"):
        if name in found:
            found[name] = found[name] + int(block.index[0])
    return found


def _arrays(record: Any) -> dict[str, np.ndarray]:
    found = {}
    for one in fields(record):
        value = getattr(record, one.name)
        if isinstance(value, GalileoTimes):
            found |= {f"{one.name}.second": value.second, f"{one.name}.fraction": value.fraction}
        elif isinstance(value, np.ndarray):
            found[one.name] = value
    return found


@pytest.mark.parametrize(
    ("scenario", "cuts"),
    [
        (sky_scenario("epochs=50", "recs.every=20", "constellation.svids=[6, 24]", ATTACKS), (1, 17, 41)),
        (_quick("epochs=1100", "processor.level=3", "receiver.front_end={bandwidth_hz=8e6}"), (1, 499, 502)),
        (sky_scenario("epochs=4", "recs.every=2", 'fidelity="samples"', "constellation.svids=[6]"), (1, 3)),
    ],
    ids=["sky", "line of sight", "samples"],
)
def test_a_block_does_not_depend_on_the_cut(scenario: CampaignScenario, cuts: tuple[int, ...]) -> None:
    whole = _said(scenario, *_blocks(scenario))
    parts = [_said(scenario, block) for block in _blocks(scenario, *cuts)]
    assert len(whole) > 30
    for name, values in whole.items():
        joined = np.concatenate([part[name] for part in parts])
        assert joined.tobytes() == values.tobytes(), name


def test_arrays_have_one_shape() -> None:
    (block,) = _blocks(sky_scenario("epochs=31"))
    for record in (block, block.e1):
        assert is_dataclass(record)
        for name, values in _arrays(record).items():
            assert values.shape[0] == 31, name
            assert values.ndim == 1 or values.shape[1] == len(block.svids), name


def test_pseudoranges_are_geometry_clock_and_errors() -> None:
    """Under a sky with the ionosphere's residual e/(γ − 1), on one line of sight without; the rate is the Doppler's."""
    sky = sky_scenario("epochs=40", "constellation.svids=[6, 24]")
    for scenario, share in ((sky, 1 / ((154 / 125) ** 2 - 1)), (_quick("epochs=40"), 0.0)):
        receiver = scenario.simulated_receiver
        truth = tuple(one.advance(0, 40) for one in receiver.truth())
        block = receiver.snapshots(0, truth)
        for column, (simulation, one) in enumerate(zip(receiver.simulations, truth, strict=True)):
            error_m = one.e1_noise_m + simulation.e1_multipath_m(one) + share * one.iono_diff_m
            expected_m = one.range_m + one.clock_m + error_m
            assert block.e1.pseudorange_m[:, column] == pytest.approx(expected_m, abs=1e-6, rel=0)
            rate_mps = one.rate_mps + one.clock_drift_mps + one.e1_rate_noise_mps
            doppler_hz = -rate_mps * 1575.42e6 / SPEED_OF_LIGHT_MPS
            assert block.e1.doppler_hz[:, column] == pytest.approx(doppler_hz, abs=1e-6, rel=0)


def test_the_cn0_is_an_estimate() -> None:
    (block,) = _blocks(_quick("epochs=400"))
    assert np.unique(block.e1.cn0_dbhz).size > 395  # in single precision two of 400 may be equal by chance
    assert np.mean(block.e1.cn0_dbhz) == pytest.approx(35.0, abs=0.05)


@pytest.mark.parametrize(("power_db", "tracked"), [(10.0, True), (30.0, False)])
def test_what_the_loop_cannot_hold_is_not_there(power_db: float, tracked: bool) -> None:
    """35 dBHz less 10 or 30 dB of noise, on one line of sight as under a sky: below 20 dBHz there is no lock."""
    jam = (
        f'attack=[{{kind="jamming", bands=["E1"], start_s=2.0, waveform={{kind="wideband"}}, j_over_n_db={power_db}}}]'
    )
    for scenario in (
        _quick("epochs=4", jam, "processor.level=2"),
        sky_scenario("epochs=4", jam, "receiver.cn0_e1_dbhz=35"),
    ):
        (block,) = _blocks(scenario)
        assert np.all(block.e1.seen[:2])
        if len(block.svids) == 1 or not tracked:
            assert np.all(block.e1.seen[2:] == tracked)
        assert np.array_equal(np.isnan(block.e1.taps).all(axis=2), ~block.e1.seen)
        assert np.array_equal(np.isnan(block.e1.cn0_dbhz), ~block.e1.seen)


def test_satellites_out_of_view_are_not_there() -> None:
    scenario = sky_scenario("epochs=4", "interval_s=3600.0", "recs.every=1", "constellation.svids=[6, 8]")
    (block,) = _blocks(scenario)
    in_view = np.stack([one.advance(0, 4).geometry.in_view for one in scenario.simulated_receiver.truth()], axis=1)
    assert 0 < np.count_nonzero(in_view) < in_view.size
    assert np.array_equal(block.e1.seen, in_view)


def test_samples_are_made_only_where_they_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = sky_scenario(
        "epochs=3", "recs.every=1", 'fidelity="samples"', "constellation.svids=[6, 24]", "processor.level=1"
    )
    made: list[int] = []
    real = BandRecorder.stretch

    def counted(recorder: BandRecorder, number: int) -> Any:
        if recorder.band is Band.E6:
            made.append(number)
        return real(recorder, number)

    monkeypatch.setattr(BandRecorder, "stretch", counted)
    (block,) = _blocks(scenario)
    assert isinstance(block.e6, SimulatedE6Samples)
    assert not made

    class Late:
        def at(self, epoch: int, satellite: int) -> None:
            del epoch, satellite

    asked = np.ones((3, 2), np.bool_)
    offsets_m = AcasProcessor().offsets_m
    assert np.all(np.isnan(block.e6.correlate(asked, Late(), offsets_m).noise_power))
    assert not made  # no hand-over, no samples
    lookup = scenario.simulated_receiver.assistance.recs_of(block)
    chips = lookup.segment(1, 0)
    assert chips[0].svid == 6
    AcasProcessor().measure(block, scenario.simulated_receiver.assistance)
    once = list(made)
    assert len(set(once)) == len(once)  # both satellites share the stretches
    assert 3 * 2 <= len(once) <= 3 * 5  # 16 ms each, at travel times that differ by less than 20 ms
    assert np.all(np.isfinite(block.front_end[Band.E6].total_power_db))
    assert made == once  # what the front end said is remembered


ATMOSPHERE = 'atmosphere={troposphere={kind="saastamoinen"}, ionosphere={kind="ntcm-g", ai0_sfu=150.0}}'
ATTACK_ON_BOTH = (
    '[{kind="lift-off", start_s=1.0, delay_m=75, power_db=4.5}, {kind="jamming", start_s=1.5, j_over_n_db=5, '
    'bands=["E6"], waveform={kind="chirp", bandwidth_hz=4e6}}]'
)


@pytest.mark.parametrize(
    ("attack", "front_end"),
    [
        ("[]", "{}"),
        (ATTACK_ON_BOTH, "{bandwidth_hz=5.2e6, bits=2}"),
        ('[{kind="meaconing", start_s=1.0, delay_s=2.1013, power_db=3.0}]', "{}"),
    ],
    ids=["honest", "two attacks and two bits", "2 s late"],
)
def test_the_samples_of_a_sky_are_those_of_its_recording(attack: str, front_end: str) -> None:
    """Bit by bit, around the RECS of each satellite, with a filter and a quantiser or without, however it is cut."""
    scenario = sky_scenario(
        "epochs=5", "recs.every=4", 'fidelity="samples"', "receiver.sample_rate_hz=6.2e6", f"attack={attack}",
        ATMOSPHERE, "constellation.svids=[6, 24]", f"receiver.front_end={front_end}",
    )  # fmt: skip
    recording = simulated(AcasTestCase(scenario=scenario, first=0, end=5))
    first, second = _blocks(scenario, 2)
    for block, epoch in ((first, 0), (second, 2)):
        assert isinstance(block.e6, SimulatedE6Samples)
        for column in (0, 1):
            taken = block.e6.samples(epoch, column)
            begin, n = taken.first_sample, taken.samples.size
            batch = recording.window(Band.E6, begin / 6.2e6, (begin + n) / 6.2e6)
            assert batch.first_sample == begin
            assert n > 16e-3 * 6.2e6
            assert taken.samples.tobytes() == batch.samples.tobytes()


def test_e1_of_a_sky_comes_from_the_samples_of_its_recording() -> None:
    """Bit by bit, but for the message on E1-B, around an epoch of each block."""
    scenario = sky_scenario(
        "epochs=5", 'fidelity="samples"', "receiver.sample_rate_hz=6.2e6", "constellation.svids=[6, 24]",
        ATMOSPHERE,
        f"attack={ATTACK_ON_BOTH}",
    )  # fmt: skip
    case = AcasTestCase(scenario=scenario, first=0, end=5)
    on_air = tuple(signal for one in case.satellites for signal in replace(one, symbols=None).received(Band.E1))
    recording = replace(simulated(case), sky=WholeSky(signals={Band.E1: on_air}))
    receiver, processes = scenario.simulated_receiver, scenario.simulated_receiver.truth()
    for first, count in ((0, 2), (2, 3)):
        truth = tuple(one.advance(first, count) for one in processes)
        of = ReceiverTruth(simulations=receiver.simulations, truth=truth, first=first, every=receiver.every)
        taken = SkySamples(of=of, band=Band.E1).between(first + 1.07, first + 1.1)
        begin, n = taken.first_sample, taken.samples.size
        assert n >= 0.03 * 6.2e6
        batch = recording.window(Band.E1, begin / 6.2e6, (begin + n) / 6.2e6)
        assert batch.first_sample == begin
        assert taken.samples.tobytes() == batch.samples.tobytes()


@pytest.mark.parametrize("delay_s", [0.05, 2.1013, 35.0013])
def test_e6_of_a_sky_meets_the_hand_over_at_both_fidelities(delay_s: float) -> None:
    """Without noise to speak of: P6 − P1 is e + bias less E1's error, be the pseudorange 35 s too long or not.

    It is the same offset for banks that are drawn and for samples, to 0.5 m; the residual of the ionosphere of 20 m on
    E1, what the satellite moves in 50 ms (24 m) and a clock that gains 3 m/s from second to second would show.
    """
    settings = (
        *CLEAN[:2],
        "epochs=13",
        "recs.every=4",
        "receiver.cn0_dbhz=75",
        "receiver.e1_tracking=none",
        'receiver.clock={kind="two-state", h_minus_2_hz=5e-18}',
        "constellation.svids=[6, 24]",
        'receiver.ionosphere={kind="heavy-tailed", core_sigma_m=10.0, tail_start_m=20.0, tail_scale_m=5.0}',
        f'attack=[{{kind="meaconing", start_s=6.0, delay_s={delay_s}, power_db=3.0, reception_gain_db=30.0}}]',
    )
    processor = AcasProcessor(detector=MaximumDetector())  # at 75 dBHz every correlator is above the threshold
    offsets = []
    for fidelity in ("samples", "correlators"):
        scenario = sky_scenario(*settings, f'fidelity="{fidelity}"')
        receiver = replace(scenario.simulated_receiver, with_taps=False)
        block = receiver.snapshots(0, tuple(one.advance(0, 13) for one in receiver.truth()))
        measured = processor.measure(block, receiver.assistance)
        offsets.append(measured.detected.range_offset_m[::4])
        late = np.max(np.ptp(block.e1.pseudorange_m[[5, 7]], axis=0))  # at 6 s E1 is acquired
        assert late == pytest.approx(delay_s * SPEED_OF_LIGHT_MPS, rel=1e-4)
    truth = [one.advance(0, 13) for one in scenario.simulated_receiver.truth()]
    expected_m = np.stack([one.iono_diff_m + one.bias_m for one in truth], axis=1)[::4]
    assert np.max(np.abs(expected_m)) > 1.0
    assert offsets[0] == pytest.approx(expected_m, abs=0.5)
    assert offsets[1] == pytest.approx(expected_m, abs=0.5)


def test_on_one_line_of_sight_the_clock_follows_a_meaconer_of_seconds() -> None:
    attack = 'attack=[{kind="meaconing", start_s=0.0, delay_s=2.1013, power_db=6.0, bands=["E1", "E6"]}]'
    alone, attacked = _quick("epochs=3", attack + "", "attack=[]"), _quick("epochs=3", attack)
    (quiet,), (late,) = _blocks(alone), _blocks(attacked)
    assert late.e1.pseudorange_m == pytest.approx(quiet.e1.pseudorange_m, abs=100.0, rel=0)
    assert late.received_at - quiet.received_at == pytest.approx(np.full((3, 1), 2.1013), abs=1e-6)


def test_searches_say_nothing_of_e6_without_a_key_or_after_its_disclosure() -> None:
    """E1 alone counts then; a clock that may be wrong by a minute proves nothing."""
    attack = 'attack=[{kind="meaconing", start_s=0.0, delay_s=2.1013, power_db=6.0, bands=["E1", "E6"]}]'
    (block,) = _blocks(_quick("epochs=20", attack, "receiver.cn0_e1_dbhz=45", "receiver.cn0_dbhz=45"))
    assert block.searches is not None
    request = _request(block)
    found = block.searches.e1(request)
    assert np.mean(found.signals == 2) > 0.8
    assert np.nanmean(found.earliest_m) == pytest.approx(-2.1013 * SPEED_OF_LIGHT_MPS, rel=1e-6)
    rows = np.flatnonzero(block.recs)
    unsure = SearchRequest(
        epoch=rows,
        uncertainty=(TimeUncertainty(initial_s=60.0),) * rows.size,
        p_fa=1e-6,
        expected_s=request.expected_s,
    )
    alone = block.searches.e1(unsure)
    assert np.all(np.isnan(alone.earliest_m))
    assert np.all(alone.carrying == 0)
    assert np.all(np.isnan(block.searches.exhaustive(unsure).signals))


def test_the_arrival_of_recs_is_that_of_their_epochs_to_the_bit() -> None:
    scenario = sky_scenario("epochs=90", "fidelity='correlators'", ATTACKS)
    receiver = scenario.simulated_receiver
    truth = tuple(one.advance(5, 70) for one in receiver.truth())
    of = ReceiverTruth(simulations=receiver.simulations, truth=truth, first=5, every=30)
    for recs, epochs in zip(of.arrived, of.arrived_at_epochs, strict=True):
        assert recs.dt_s.size == 2
        for name in ("dt_s", "carrier_range_m", "rate_mps", "acceleration_mps2"):
            np.testing.assert_array_equal(getattr(recs, name), getattr(epochs, name)[of.rows])
