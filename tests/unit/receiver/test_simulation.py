from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from simulated_banks import OFFSETS_M, PROCESSOR, banks, receiver_of, snapshots
from vestige.acas_processor.measurement import Availability
from vestige.receiver.draws import rows_of
from vestige.receiver.front_end.front_end_correlation import range_offset_scale
from vestige.receiver.samples.sampled_epoch import arrival, received_signal
from vestige.receiver.simulation import Fidelity, Simulation
from vestige.receiver.snapshots.e6 import SimulatedE6Samples
from vestige.records import Band, Status
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.signal_generator.keystream import encrypted_chips, encryption_key
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.synthesis import amplitude, synthesize
from vestige.theory.range_offset import range_offset_m

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"


NO_ERRORS = tuple(f"receiver.{model}=none" for model in ("clock", "multipath", "ionosphere", "e1_tracking"))


def _simulation(*settings: str) -> Simulation:
    scenario = load_scenario(SCENARIOS / "quick.toml", settings)
    assert isinstance(scenario, CampaignScenario)
    return scenario.simulation()


@pytest.mark.parametrize("fidelity", ["samples", "correlators"])
def test_a_bank_does_not_depend_on_the_cut(fidelity) -> None:  # type: ignore[no-untyped-def]
    n = 12 if fidelity == "samples" else 1200
    simulation = _simulation(f"epochs={n}")
    whole = banks(simulation, fidelity, 0, simulation.truth().advance(0, n))
    process, first, parts = simulation.truth(), 0, []
    for count in (1, n // 3, n - 1 - n // 3):
        parts.append(banks(simulation, fidelity, first, process.advance(first, count)))
        first += count
    assert np.concatenate([part.taps for part in parts]).tobytes() == whole.taps.tobytes()
    assert np.concatenate([part.noise_power for part in parts]).tobytes() == whole.noise_power.tobytes()


def test_an_epoch_goes_through_the_real_door() -> None:
    """Encrypted chips, a validated key, an ordinary block: the processor's own verdict is AUTHENTIC."""
    simulation = _simulation("receiver.cn0_dbhz=45", "receiver.cn0_e1_dbhz=45", "epochs=40")
    truth, receiver = simulation.truth().advance(0, 40), receiver_of(simulation, "samples")
    for row in (0, 17, 39):
        block = receiver.snapshots(row, (rows_of(truth, slice(row, row + 1)),))
        (verdict,) = PROCESSOR.step(None, block, receiver.assistance).verdicts
        _, key = receiver.assistance.recs_of(block).segment(0, 0)
        assert verdict.status is Status.AUTHENTIC
        assert block.received_at.at(0, 0) + 1.0 < key.disclosed_at
        late_m = truth.iono_diff_m[row] - truth.e1_noise_m[row]
        assert verdict.range_offset_m == pytest.approx(late_m, abs=8.0)


def test_without_error_models_and_noise_the_line_of_sight_is_where_e1_says() -> None:
    """At 80 dBHz the punctual tap is 1 up to the code's own noise, the others lie on the triangle."""
    simulation = _simulation(*NO_ERRORS, "receiver.cn0_dbhz=80", "epochs=3")
    truth = simulation.truth().advance(0, 3)
    triangle = np.maximum(0, 1 - np.abs(OFFSETS_M) / 58.6105)
    for fidelity in ("samples", "correlators"):
        taps = banks(simulation, fidelity, 0, truth).taps  # type: ignore[arg-type]
        shape = np.abs(taps) / np.abs(taps[:, 5:6])
        assert shape == pytest.approx(np.tile(triangle, (3, 1)), abs=6 / np.sqrt(81_840) + 2e-3)


def test_without_a_front_end_samples_are_signal_and_noise_alone() -> None:
    """To the last bit what `synthesize` makes, with or without the empty table."""
    simulation = _simulation("epochs=5")
    assert simulation.front_end.transparent
    truth = simulation.truth().advance(0, 5)
    block = snapshots(simulation, "samples", 3, rows_of(truth, slice(3, 4)))
    assert isinstance(block.e6, SimulatedE6Samples)
    batch = block.e6.samples(0, 0)
    chips = encrypted_chips(encryption_key(simulation.seed), 11, block.time.at(0), simulation.n_chips)
    strength = amplitude(simulation.cn0_dbhz, 12.5e6)
    arrived = arrival(simulation.line_of_sight, truth)
    signal = received_signal(chips, arrived, truth, 3, amplitude=strength)
    expected = synthesize(
        (replace(signal, start_s=signal.start_s - batch.first_sample / 12.5e6),),
        sample_rate_hz=12.5e6,
        n_samples=batch.samples.size,
        noise_key=noise_key(simulation.seed, 3, 6),
    )
    assert batch.samples.tobytes() == expected.tobytes()
    front_end = block.front_end[Band.E6]
    assert (front_end.agc_gain_db[0], front_end.saturated[0]) == (0.0, False)
    assert front_end.total_power_db[0] == pytest.approx(10 * np.log10(np.mean(np.abs(expected) ** 2)), abs=1e-4)


def test_a_snapshot_says_what_its_front_end_did() -> None:
    """80 dBHz at 12.5 MHz are 8 times the noise: the gain goes down by 9.5 dB, or a fixed one saturates."""
    for agc, gain_db, saturated in (("true", -9.54, False), ("false", 0.0, True)):
        front_end = f"receiver.front_end={{bits=2, agc={agc}}}"
        simulation = _simulation("epochs=2", "receiver.cn0_dbhz=80", front_end, *NO_ERRORS, 'fidelity="samples"')
        found = banks(simulation, "samples", 0, simulation.truth().advance(0, 2)).front_end
        assert found.total_power_db == pytest.approx(np.full(2, 10 * np.log10(1 + 1e8 / 12.5e6)), abs=0.05)
        assert found.agc_gain_db == pytest.approx(np.full(2, gain_db), abs=0.05)
        assert found.saturated.tolist() == [saturated] * 2


def test_a_filter_does_not_move_the_signal() -> None:
    """At 75 dBHz, without errors: the punctual tap is the largest, and both sides are alike within the self-noise."""
    for front_end in ("{bandwidth_hz=10e6, oversampling=2}", "{bandwidth_hz=5e6}"):
        settings = (*NO_ERRORS, "receiver.cn0_dbhz=75", "epochs=4", f"receiver.front_end={front_end}")
        simulation = _simulation(*settings)
        taps = np.abs(banks(simulation, "samples", 0, simulation.truth().advance(0, 4)).taps)
        assert np.all(np.argmax(taps, axis=1) == 5)
        assert np.abs(taps[:, 4] - taps[:, 6]) / taps[:, 5] == pytest.approx(
            np.zeros(4), abs=6 / np.sqrt(81_840) + 2e-3
        )


@pytest.mark.parametrize(("fidelity", "n"), [("samples", 100), ("correlators", 2000)])
def test_range_offsets_grow_behind_a_filter_as_computed(fidelity: Fidelity, n: int) -> None:
    """Delays up to a quarter of the spacing at 80 dBHz: slope within 4.4 standard errors."""
    filtered = "receiver.front_end={bandwidth_hz=10.23e6, oversampling=2}"
    simulation = _simulation(*NO_ERRORS, filtered, "receiver.cn0_dbhz=80", 'fidelity="samples"', f"epochs={n}")
    truth = replace(simulation.truth().advance(0, n), e1_noise_m=np.linspace(-15 / 4, 15 / 4, n))
    taps = np.abs(banks(simulation, fidelity, 0, truth).taps)
    found_m = range_offset_m(taps, np.full(n, 5), 1, OFFSETS_M)
    fit = stats.linregress(-truth.e1_noise_m, found_m)
    assert fit.stderr < 0.05
    assert fit.slope == pytest.approx(range_offset_scale(simulation.front_end, 15.0), abs=4.4 * fit.stderr + 0.01)


def test_a_week_ends_within_the_run() -> None:
    """RECS before and after midnight on Saturday, keys of both weeks: every epoch is AUTHENTIC."""
    settings = ('start="2026-11-21T23:59:20 GST"', "receiver.cn0_dbhz=45", "receiver.cn0_e1_dbhz=45", "epochs=80")
    simulation = _simulation(*settings)
    truth, receiver = simulation.truth().advance(0, 80), receiver_of(simulation, "samples")
    for row in (0, 9, 10, 39, 40, 41, 79):
        block = receiver.snapshots(row, (rows_of(truth, slice(row, row + 1)),))
        (verdict,) = PROCESSOR.step(None, block, receiver.assistance).verdicts
        assert verdict.status is Status.AUTHENTIC
        assert verdict.time.week == (1421 if row < 40 else 1422)


def test_errors_beyond_the_samples_leave_nothing_to_correlate() -> None:
    simulation = _simulation('receiver.bias={kind="bias", bgd_sigma_m=1e6}', "epochs=2", 'fidelity="samples"')
    receiver = receiver_of(simulation, "samples")
    block = receiver.snapshots(0, (simulation.truth().advance(0, 2),))
    measured = PROCESSOR.measure(block, receiver.assistance)
    assert np.all(measured.availability == Availability.OUTSIDE)
    assert np.all(np.isnan(measured.banks.noise_power))


TERMS = {
    "ionosphere": 'receiver.ionosphere={kind="heavy-tailed", core_sigma_m=3.0, tail_start_m=6.0, tail_scale_m=3.0}',
    "bias": 'receiver.bias={kind="bias", bgd_sigma_m=5.0, hardware_sigma_m=5.0}',
    "e1_noise": 'receiver.e1_tracking={kind="betz", loop_bandwidth_hz=20.0}',
    "e1_multipath": "receiver.e1_multipath=true",
    "clock": 'receiver.clock={kind="two-state"}',
}


@pytest.mark.parametrize("fidelity", ["samples", "correlators"])
@pytest.mark.parametrize("term", [*TERMS, "all"])
def test_truth_explains_the_residual(fidelity: Fidelity, term: str) -> None:
    """range offset = ionosphere + bias − E1 noise − E1 multipath, at 80 dBHz without rays on E6.

    Taps on an exact triangle leave nothing; noise (5.6e-4 a dimension) and the code's own noise (1/√81840) in the three
    taps leave at most 0.25 m.
    """
    on = TERMS.values() if term == "all" else [TERMS[term]]
    simulation = _simulation(*NO_ERRORS, *on, "receiver.cn0_dbhz=80", 'fidelity="samples"', "epochs=40")
    n = 12 if fidelity == "samples" else 40
    truth = simulation.truth().advance(0, n)
    if term in {"e1_multipath", "all"}:  # rays that E1 sees and E6 does not, so that no other term comes in
        delay_m = np.full((n, 1), 20.0)
        rays = replace(truth.rays, delay_m=delay_m, amplitude_e1=0.3 * np.exp(1j * np.arange(n))[:, None])
        truth = replace(truth, rays=rays)
    e1_multipath_m = simulation.e1_multipath_m(truth)
    expected_m = truth.iono_diff_m + truth.bias_m - truth.e1_noise_m - e1_multipath_m
    assert np.ptp(truth.clock_m if term == "clock" else expected_m) > 0 or term == "bias"
    taps = np.abs(banks(simulation, fidelity, 0, truth).taps)
    found_m = range_offset_m(taps, np.argmax(taps, axis=1), 1, OFFSETS_M)
    assert found_m == pytest.approx(expected_m, abs=0.25)
    shown = {
        "ionosphere": truth.iono_diff_m,
        "bias": truth.bias_m,
        "e1_noise": truth.e1_noise_m,
        "e1_multipath": e1_multipath_m,
        "clock": truth.clock_m,
    }
    for name, values_m in shown.items():
        assert np.any(values_m != 0) == (term in {name, "all"})
