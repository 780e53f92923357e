"""Section VI-A of the paper: 100,000 measurements in harsh conditions, at the fast fidelity.

`vestige run scenarios/harsh.toml -j 2` does the same with samples, in minutes; the last test, and
`tests/unit/receiver/test_simulation.py`, hold both fidelities together at a length that is quick.

Rates are compared through exact binomial intervals of confidence 1 − 1e-4, on four runs of the paper's length with
seeds of their own: what is to be seen must lie in its band with the whole interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import xarray
from scipy import stats

from simulated_banks import banks as banks_of
from vestige.acas_processor.detectors import EarlyDetector
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.statistics import CLUSTER_M, binomial_interval, binomial_test, summarise
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.theory.thresholds import probability_of_detection, threshold

HARSH = Path(__file__).resolve().parents[2] / "scenarios" / "harsh.toml"
SURE = 1 - 1e-4
CHUNK = 10_000


def _plan(*settings: str) -> ScenarioPlan:
    scenario = load_scenario(HARSH, ('fidelity="correlators"', *settings))
    assert isinstance(scenario, CampaignScenario)
    return ScenarioPlan(scenario=scenario)


def _run(folder: Path, *settings: str) -> xarray.Dataset:
    return run(_plan(*settings), folder, chunk_epochs=CHUNK)


@dataclass
class Counts:
    """Of both detectors, early first."""

    epochs: int
    misses: np.ndarray
    cluster: np.ndarray


@pytest.fixture(scope="module")
def counts() -> Counts:
    """Four times 100,000 epochs, without a store."""
    found = Counts(0, np.zeros(2, int), np.zeros(2, int))
    for seed in range(1, 5):
        plan = _plan(f"seed={seed}")
        preparation = plan.prepare()
        for first in range(0, plan.n_epochs, CHUNK):
            results = plan.measure(first, preparation.advance(first, CHUNK))
            offset_m = results["range_offset_m"]
            found.misses += np.count_nonzero(results["tap_index"] < 0, axis=(1, 2))
            found.cluster += np.count_nonzero((offset_m >= CLUSTER_M[0]) & (offset_m <= CLUSTER_M[1]), axis=(1, 2))
            found.epochs += CHUNK
    return found


@pytest.fixture(scope="module")
def harsh(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    return _run(tmp_path_factory.mktemp("harsh") / "results")


@pytest.mark.judged(
    by="the paper",
    what="misses in harsh conditions (Section VI-A)",
    figure="25 to 88 in 100,000 where the paper has 52; calibrated: an earlier scenario was fitted to this number",
)
def test_about_52_misses(harsh: xarray.Dataset, counts: Counts) -> None:
    """The paper has 52 in one run; the rate lies within 20 to 110 in 100,000, and is compatible with the paper's."""
    assert 25 <= summarise(harsh, "early").misses <= 88  # Poisson limits at 1e-5 around 52
    for misses in counts.misses:
        low, high = binomial_interval(int(misses), counts.epochs, confidence=SURE)
        assert low > 20e-5
        assert high < 110e-5
        assert binomial_interval(52, 100_000, confidence=SURE)[0] < misses / counts.epochs
        assert misses / counts.epochs < binomial_interval(52, 100_000, confidence=SURE)[1]


def _theory_of_a_tap(plan: ScenarioPlan) -> float:
    """Return the probability that the punctual tap stays below the threshold, without rays and ionosphere.

    Marcum Q over the errors of E1: the code's move the tap down the triangle of ±58.61 m, the Doppler's cost
    sinc(Δf T_I).
    """
    (simulation,) = plan.simulations
    tracking = simulation.models.e1_tracking
    assert tracking is not None
    error_m, of_error = np.polynomial.hermite_e.hermegauss(60)
    error_hz, of_doppler = np.polynomial.hermite_e.hermegauss(20)
    error_m = error_m * tracking.code_sigma_m(35.0)
    error_hz = error_hz * tracking.doppler_sigma_hz(35.0) * 125 / 154
    amplitude = np.outer(1 - np.abs(error_m) / 58.6105, np.sinc(0.016 * error_hz))
    detected = probability_of_detection(simulation.cn0_dbhz + 20 * np.log10(amplitude), 0.016, 1e-7)
    return float(np.sum(np.outer(of_error, of_doppler) / (2 * np.pi) * (1 - detected)))


@pytest.mark.judged(
    by="theory",
    what="misses with E1 noise only",
    figure="Marcum Q within 1 %, two-sided binomial test at 1e-4",
)
@pytest.mark.parametrize(
    ("cn0_dbhz", "epochs", "expected"), [(31.0, 50_000, 12_361), (33.0, 50_000, 543), (35.0, 100_000, 0.77)]
)
def test_without_multipath_and_ionosphere_theory_says_how_many(cn0_dbhz: float, epochs: int, expected: float) -> None:
    """The misses of the punctual correlator follow Marcum Q over the errors of E1; the others find about 2 % of them.

    At the paper's 35 dBHz 0.8 are expected in 100,000, half of them by the offset of 0.8 m (1σ) on the grid.
    """
    plan = _plan("receiver.multipath=none", "receiver.ionosphere=none", f"receiver.cn0_dbhz={cn0_dbhz}")
    probability, limit = _theory_of_a_tap(plan), float(threshold(1e-7))
    assert probability * epochs == pytest.approx(expected, rel=0.01)
    (simulation,) = plan.simulations
    taps, noise_power, _ = banks_of(simulation, "correlators", 0, simulation.truth().advance(0, epochs))
    magnitudes = np.abs(taps) / np.sqrt(noise_power / 2)[:, None]
    below = int(np.count_nonzero(magnitudes[:, 5] <= limit))
    assert binomial_test(below, epochs, probability) > 1 - SURE
    misses = np.count_nonzero(EarlyDetector().detect(magnitudes, limit) < 0)
    assert 0.95 * below <= misses <= below


@pytest.mark.judged(
    by="the paper",
    what="cluster of range offsets at -22.5 m",
    figure="5e-5 to 4e-4 of the detections of the early detector",
)
def test_the_cluster_belongs_to_the_early_detector(harsh: xarray.Dataset, counts: Counts) -> None:
    """0.5e-4 to 4e-4 of its detections near −22.5 m; of those of the maximum detector no more than 0.3e-4.

    The rare offsets that the maximum detector has there (0.25e-4) are the left flank of its distribution: there are
    about as many on the right. Ten times as many are the cluster.
    """
    early, maximum = (
        binomial_interval(int(k), counts.epochs - int(missed), confidence=SURE)
        for k, missed in zip(counts.cluster, counts.misses, strict=True)
    )
    assert early[0] > 0.5e-4
    assert early[1] < 4e-4
    assert maximum[0] < 0.3e-4
    assert maximum[1] < early[0]
    assert 5 <= summarise(harsh, "early").cluster.successes <= 40


def test_percentiles_of_the_range_offset(harsh: xarray.Dataset, tmp_path: Path) -> None:
    """A reference run, whose ionosphere has both tails: 0.1 % −10 m, 1 % −6.9, 99 % 6.9, 99.9 % 9.7.

    The late tail alone leaves the right percentiles where they are.
    """
    both = _run(tmp_path / "both tails", "receiver.ionosphere={kind='heavy-tailed', preset='2014'}")
    reference = ((0.1, -10.0, 1.0), (1, -6.9, 0.4), (99, 6.9, 0.4), (99.9, 9.7, 1.0))
    for results, percentiles in ((both, reference), (harsh, reference[2:])):
        offset_m = results["range_offset_m"].sel(detector="early").values
        for percent, expected_m, tolerance_m in percentiles:
            assert np.nanpercentile(offset_m, percent) == pytest.approx(expected_m, abs=tolerance_m)


@pytest.mark.parametrize(("beyond_m", "times"), [(8.0, 2.5), (10.0, 1.5)])
def test_the_right_flank_lies_above_the_left_one(harsh: xarray.Dataset, beyond_m: float, times: float) -> None:
    """[WFO, Sec. VI-A]: "the effect of the ionospheric error model is seen on the right side".

    Beyond 8 m about 450 offsets on the right and 130 on the left, the cluster apart; beyond 10 m 100 and 20. The share
    of the right flank lies with its whole interval (99.9 %) above 2.5 to 1, and above 1.5 to 1 where there are fewer.
    """
    offset_m = harsh["range_offset_m"].sel(detector="early").values
    right = np.count_nonzero(offset_m > beyond_m)
    left = np.count_nonzero((offset_m < -beyond_m) & (offset_m > CLUSTER_M[1]))
    assert binomial_interval(int(right), int(right + left), confidence=0.999)[0] > times / (1 + times)


def test_the_right_flank_is_a_straight_line_in_log_scale(harsh: xarray.Dataset) -> None:
    """Beyond 6.5 m the counts fall exponentially over two decades, with the scale of the ionosphere's tail."""
    offset_m = harsh["range_offset_m"].sel(detector="early").values.ravel()
    edges_m = np.arange(6.5, 15.0, 1.0)
    counts = np.array([np.count_nonzero(offset_m > edge) for edge in edges_m])
    assert counts[0] / counts[-1] > 100
    slope, intercept = np.polyfit(edges_m, np.log(counts), 1, w=np.sqrt(counts))
    assert 0.9 < -1 / slope < 1.9  # 1.17 m, wider by the noise
    residual = (np.log(counts) - slope * edges_m - intercept) * np.sqrt(counts)
    assert np.abs(residual).max() < 5


def test_status_of_an_undisturbed_signal(harsh: xarray.Dataset) -> None:
    """Every detection within 26.6 m is AUTHENTIC, so the range check refuses no true signal here."""
    meanings = harsh["status"].attrs["flag_meanings"].split()
    status = harsh["status"].values.ravel()
    authentic = np.count_nonzero(status == meanings.index("AUTHENTIC"))
    assert authentic >= 100_000 - summarise(harsh, "early").misses - 12


@pytest.mark.judged(
    by="vestige at the other fidelity",
    what="correlators against samples in harsh conditions",
    figure="p > 0.001 for misses and every correlator",
)
@pytest.mark.parametrize("cn0_dbhz", [29.0, 31.0, 33.0])
def test_both_fidelities_miss_alike(cn0_dbhz: float) -> None:
    """500 epochs of samples against 50,000 drawn ones, where misses are frequent; KS of every correlator, p > 0.001."""
    settings = (f"receiver.cn0_dbhz={cn0_dbhz}", "epochs=50000")
    magnitudes = {}
    for fidelity, seed, n in (("samples", 11, 500), ("correlators", 12, 50_000)):
        simulation = _plan(*settings, f"seed={seed}").simulations[0]
        taps, noise_power, _ = banks_of(simulation, fidelity, 0, simulation.truth().advance(0, n))  # type: ignore[arg-type]
        magnitudes[fidelity] = np.abs(taps) / np.sqrt(noise_power / 2)[:, None]
    sampled, drawn = magnitudes["samples"], magnitudes["correlators"]
    for tap in range(11):
        assert stats.ks_2samp(sampled[:, tap], drawn[:, tap]).pvalue > 0.001, tap
    limit = float(threshold(1e-7))
    misses, expected = (np.count_nonzero(EarlyDetector().detect(c, limit) < 0) for c in (sampled, drawn))
    assert binomial_test(int(misses), 500, expected / 50_000) > 0.001
