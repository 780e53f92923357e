"""Section VI-B of the paper: early against maximum detector under a zero-delay E6 meaconing with lift-off.

Twenty runs at each fidelity, each with its own clock, ionosphere, multipath and noise. The text of the paper is quoted
where a test is of it; the tolerances stand beside the assertions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from vestige.campaign.outcomes import DetectedSignal, classify
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

LIFTOFF = Path(__file__).resolve().parents[2] / "scenarios" / "liftoff.toml"
SEEDS = range(20)
EARLY, MAXIMUM = 0, 1
FIDELITIES = ("correlators", "samples")
NO_ATTACK = "attack.0.power_db=-inf"
FLANK_M = (-30.0, -15.0)  # a detection on the tap at -30 m or -15 m, one to the left of which the signal is


@dataclass(frozen=True)
class Run:
    """One run: columns of its results, without the axis of the one satellite; detectors first."""

    time_s: np.ndarray
    offset_m: np.ndarray
    phase_rad: np.ndarray  # against the line of sight
    magnitude_sigma: np.ndarray
    outcome: np.ndarray

    @classmethod
    def of(cls, *settings: str, first: int = 0, stop: int = 1500) -> Run:
        """Return these epochs of the run of a scenario with some other settings."""
        scenario = load_scenario(LIFTOFF, settings)
        assert isinstance(scenario, CampaignScenario)
        plan = ScenarioPlan(scenario=scenario)
        truth = plan.prepare()
        if first:
            truth.advance(0, first)
        results: Mapping[str, np.ndarray] = plan.measure(first, truth.advance(first, stop - first))
        offset_m = results["range_offset_m"][:, :, 0].astype(float)
        truth = (results["truth_prediction_error_m"][:, 0], results["truth_spoofer_offset_m"][:, 0])
        power_db = results["truth_spoofer_power_db"][:, 0].astype(float)
        phase_rad = results["phase_rad"][:, :, 0] - results["truth_phase_rad"][:, 0]
        return cls(
            results["time_s"],
            offset_m,
            phase_rad,
            results["magnitude_sigma"][:, :, 0],
            np.array([classify(one, *truth, power_db, resolution_m=0.0) for one in offset_m]),
        )

    def within(self, first_s: float, last_s: float) -> np.ndarray:
        """Return which epochs lie in a time span."""
        return (self.time_s >= first_s) & (self.time_s < last_s)

    def turning(self, detector: int, first_s: float, last_s: float) -> float:
        """Return the circular standard deviation of the phase in a time span, in rad."""
        phase_rad = self.phase_rad[detector, self.within(first_s, last_s)]
        return float(np.sqrt(-2 * np.log(np.abs(np.nanmean(np.exp(1j * phase_rad))))))

    def returned_s(self) -> float:
        """Return the last time at which less than 80 % of the early offsets around it, ±20 s, are within ±20 m."""
        detected = np.isfinite(self.offset_m[EARLY])
        near = np.abs(self.offset_m[EARLY]) <= 20.0
        around = [detected & self.within(t_s - 20, t_s + 20.5) for t_s in self.time_s]
        away = np.array([bool(one.any()) and np.mean(near[one]) < 0.8 for one in around])
        return float(self.time_s[away].max(initial=0.0))

    def on_the_flank_s(self) -> np.ndarray:
        """Return when the early detector was on the left flank."""
        offset_m = self.offset_m[EARLY]
        return self.time_s[(offset_m > FLANK_M[0]) & (offset_m < FLANK_M[1])]


@cache
def runs(fidelity: str) -> list[Run]:
    """Return the runs: whole ones as correlators; with samples, a hundred times slower, from the departure on."""
    measured = {"first": 765, "stop": 1230} if fidelity == "samples" else {}
    return [Run.of(f'fidelity="{fidelity}"', f"seed={seed}", **measured) for seed in SEEDS]


@cache
def honest_runs() -> list[Run]:
    """Return the same noise, rays and errors without the attack."""
    return [Run.of('fidelity="correlators"', f"seed={seed}", NO_ATTACK) for seed in SEEDS]


def rise_m(detector: int, first_s: float, last_s: float) -> np.ndarray:
    """Return how much the attack moves the mean range offset in a time span, of every run."""
    pairs = zip(runs("correlators"), honest_runs(), strict=True)
    return np.array(
        [
            np.nanmean(one.offset_m[detector, one.within(first_s, last_s)])
            - np.nanmean(honest.offset_m[detector, honest.within(first_s, last_s)])
            for one, honest in pairs
        ]
    )


@pytest.mark.parametrize("detector", [EARLY, MAXIMUM])
def test_a_small_upward_curve_as_it_approaches(detector: int) -> None:
    """The paper: "At the beginning when the spoofer sets in [...] we notice a small upward curve [...] in both cases."

    At −10 dB the approaching spoofing signal pulls by 0.4 m between 300 and 500 s, ±0.02 m in the mean of 20 runs, each
    beside the same run without an attack.
    """
    approach = rise_m(detector, 300, 500)
    assert 0.2 < np.mean(approach) < 1.0
    assert np.mean(approach) > 5 * np.std(approach) / np.sqrt(len(SEEDS))
    assert np.mean(rise_m(detector, 0, 100)) < 0.5 * np.mean(approach)


@cache
def approaching(*settings: str) -> list[Run]:
    """Return 30 s of the approach of every run with samples."""
    return [Run.of('fidelity="samples"', f"seed={seed}", *settings, first=385, stop=415) for seed in SEEDS]


@pytest.mark.parametrize("detector", [EARLY, MAXIMUM])
def test_the_upward_curve_is_there_with_samples(detector: int) -> None:
    """Half a minute in place of 200 s, because samples take a hundred times as long: 0.6 ± 0.06 m over 20 runs."""
    pairs = zip(approaching(), approaching(NO_ATTACK), strict=True)
    rise = [np.nanmean(one.offset_m[detector]) - np.nanmean(honest.offset_m[detector]) for one, honest in pairs]
    assert 0.2 < np.mean(rise) < 1.0
    assert np.mean(rise) > 5 * np.std(rise) / np.sqrt(len(SEEDS))


@pytest.mark.parametrize("detector", [EARLY, MAXIMUM])
def test_nothing_pulls_where_it_turns(detector: int) -> None:
    """On top of the true signal it is no later than that: less than 0.2 m between 590 and 640 s."""
    assert abs(np.mean(rise_m(detector, 590, 640))) < 0.2


@pytest.mark.parametrize("detector", [EARLY, MAXIMUM])
def test_the_range_is_captured_as_the_power_rises(detector: int) -> None:
    """The paper: "when the spoofer turns up the power, it captures the range estimate at the beginning in both cases".

    At 750 s it is 11 m late and at +2.3 dB, at 800 s 18 m: offsets follow by 1.5 to 5.5 m before that and by 8 to 15 m
    after it.
    """
    assert np.all((rise_m(detector, 700, 750) > 1.5) & (rise_m(detector, 700, 750) < 5.5))
    assert np.all((rise_m(detector, 750, 800) > 8.0) & (rise_m(detector, 750, 800) < 15.0))


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_most_detections_are_nearer_to_the_spoofer_at_first(fidelity: str) -> None:
    for run in runs(fidelity):
        for detector in (EARLY, MAXIMUM):
            assert np.mean(run.outcome[detector, run.within(770, 820)] == DetectedSignal.SPOOFER) > 0.5


@pytest.mark.judged(
    by="the paper",
    what="lift-off (Section VI-B): early detector",
    figure="on the true signal again at 1050 s ± 30 s; delay and powers of the attack are our choice, not the paper's",
)
@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_the_early_detector_goes_back_to_the_baseline(fidelity: str) -> None:
    """The paper: "the range estimate goes back to the baseline after about T = 1050 seconds, after some fluctuations".

    The median run is back at 1050 s ± 30 s, all within 80 s; from 1080 s on 95 % of the offsets are within ±12 m.
    """
    returned_s = [run.returned_s() for run in runs(fidelity)]
    assert np.median(returned_s) == pytest.approx(1050, abs=30)
    assert np.ptp(returned_s) < 80
    for run in runs(fidelity):
        fluctuates = run.outcome[EARLY, run.within(850, 1040)]
        assert np.count_nonzero(np.diff(fluctuates[fluctuates != DetectedSignal.NONE])) >= 10
        after = run.within(1080, 1500)
        assert np.mean(np.abs(run.offset_m[EARLY, after]) <= 12.0) >= 0.95


@pytest.mark.judged(
    by="the paper",
    what="lift-off: maximum detector",
    figure="stays 71.5 m ± 1.5 m late, the delay that was chosen so that it follows the spoofing signal",
)
@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_the_maximum_detector_follows_the_spoofer_and_toggles(fidelity: str) -> None:
    """The paper: "it follows the spoofer quite well. Note the toggling between the spoofer and the baseline."

    More than 90 % of its detections after 1050 s are nearer to the spoofer, and every minute a few are of the true
    signal. It reads where the spoofer is, 71.5 m late,
    and not the edge of the bank.
    """
    toggles = []
    for run in runs(fidelity):
        after = run.within(1050, 1500)
        outcome = run.outcome[MAXIMUM, after]
        outcome = outcome[outcome != DetectedSignal.NONE]
        assert np.mean(outcome == DetectedSignal.SPOOFER) > 0.9
        toggles.append(np.count_nonzero(np.diff(outcome)))
        stays_m = run.offset_m[MAXIMUM, run.within(1200, 1500)]
        stays_m = stays_m[stays_m > 40]
        assert np.median(stays_m) == pytest.approx(71.5, abs=1.5)
        assert np.std(stays_m) > 1.0
    assert np.median(toggles) >= 10


def test_it_toggles_more_between_two_correlators() -> None:
    """The paper's third reason: a signal on a correlator has its full magnitude, one between two correlators less.

    The spoofer stays on a correlator, at 75 m, or half-way between two, at 67.5 m,
    where both correlators beside it have 12 % less of it than its peak.
    """
    found = {}
    for last_m in (67.5, 75.0):
        moved = (f"attack.0.delay_m.first={last_m}", f"attack.0.delay_m.last={last_m}")
        outcome = [
            run.outcome[MAXIMUM, run.within(1200, 1500)]
            for run in (Run.of('fidelity="correlators"', f"seed={seed}", *moved) for seed in range(8))
        ]
        found[last_m] = np.mean(np.concatenate(outcome) == DetectedSignal.TRUE)
    assert found[67.5] > 3 * found[75.0]
    assert found[67.5] > 0.01


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_outliers_on_the_left_flank_as_it_departs(fidelity: str) -> None:
    """The paper: "Note the one outlier at around T = 800 seconds", where "the signal is detected on the flank".

    From 840 to 960 s there are about four a run, near −22.5 m. Before 800 s they are less than a tenth as frequent.
    "Near" is within 2.5 m: a third of a uniform spread from −30 to −15 m is as near. The test asks for more than that
    by two standard deviations of a binomial count, which a uniform spread exceeds by chance in 1 of 44 tests. Measured
    are 59 of 110 at correlators and 46 of 103 with samples, 4.5 and 2.4 standard deviations.
    """
    times_s = np.concatenate([run.on_the_flank_s() for run in runs(fidelity)])
    departing = np.count_nonzero((times_s >= 840) & (times_s < 960))
    assert 2 * len(SEEDS) < departing < 8 * len(SEEDS)
    begin_s = min(run.time_s[0] for run in runs(fidelity))
    assert np.count_nonzero(times_s < 800) / (800 - begin_s) < 0.1 * departing / 120
    offsets_m = np.concatenate(
        [run.offset_m[EARLY, np.isin(run.time_s, run.on_the_flank_s())] for run in runs(fidelity)]
    )
    assert np.mean(offsets_m) == pytest.approx(-22.5, abs=2.0)
    uniform = offsets_m.size / 3
    assert np.count_nonzero(np.abs(offsets_m + 22.5) < 2.5) > uniform + 2 * np.sqrt(uniform * 2 / 3)


def test_the_phase_rotates_as_the_paper_describes() -> None:
    """It starts when the spoofer comes in, calms down where it turns, and goes on for the maximum detector only.

    Means over the runs; the phase is that against the true signal.
    """
    spans = ((0, 60), (300, 500), (500, 570), (590, 610), (620, 650), (770, 900), (1060, 1190))
    for detector in (EARLY, MAXIMUM):
        begins, coming, near, turn, leaving, captured, left = (
            np.mean([run.turning(detector, *span) for run in runs("correlators")]) for span in spans
        )
        assert coming > 1.4 * begins
        assert near > 1.7 * begins
        assert turn < 0.6 * near
        assert leaving > 1.7 * turn
        assert captured > 1.0
        assert left > 1.5 if detector == MAXIMUM else left < 1.5 * begins


def test_amplitude_fades_while_both_are_in_one_correlator() -> None:
    """From 700 to 850 s the two signals meet with about equal power and any phase."""
    spread = [np.nanstd(run.magnitude_sigma[EARLY, run.within(700, 850)]) for run in runs("correlators")]
    usual = [np.nanstd(run.magnitude_sigma[EARLY, run.within(700, 850)]) for run in honest_runs()]
    assert np.mean(spread) > 2.5 * np.mean(usual)
