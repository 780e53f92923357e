from __future__ import annotations

import numpy as np
import pytest

from evidence_builder import evidence, outcome
from vestige.acas_processor.checks.power import decision_map
from vestige.acas_processor.checks.power.decision_map import (
    DecisionMap,
    Hypotheses,
    PowerDistortionMonitor,
    SignalClass,
    confusion,
    simulated_decision_map,
)
from vestige.acas_processor.monitoring.baseline import Quantity
from vestige.campaign.statistics import binomial_interval
from vestige.records import CheckResult, Outcome
from vestige.streams import stream

CLEAN, MULTIPATH, SPOOFED, JAMMED = SignalClass
DRAWS = 100_000


@pytest.fixture(scope="module")
def plain() -> DecisionMap:
    return simulated_decision_map(Hypotheses())


def test_the_same_seed_gives_the_same_map(plain: DecisionMap) -> None:
    simulated_decision_map.cache_clear()
    again = simulated_decision_map(Hypotheses())
    assert again is not plain
    np.testing.assert_array_equal(again.classes, plain.classes)


def test_each_draw_is_counted_in_its_cell(plain: DecisionMap) -> None:
    """As numpy counts between the edges of the map; what lies beyond belongs to the outermost cells."""
    rise_db, distortion = Hypotheses().simulate(SPOOFED, stream(6, "cells"), 20_000)
    rise_db[:4], distortion[:4] = [-9.0, 40.0, 25.0, 3.0], [0.0, 2.0, 1e5, 1e4]
    inside = [
        np.clip(v, e[0], e[-1]) for v, e in ((rise_db, plain.power_edges_db), (distortion, plain.distortion_edges))
    ]
    expected, _, _ = np.histogram2d(*inside, bins=(plain.power_edges_db, plain.distortion_edges))
    np.testing.assert_array_equal(decision_map._counts(rise_db, np.log1p(distortion)), expected)


def test_confusion_of_equal_costs(plain: DecisionMap) -> None:
    """The table that a maximum-likelihood classifier of the same hypotheses was found to have.

    Its cells and its draws are not known, so each rate may differ by half a percent.
    """
    expected = [
        [0.898, 0.102, 0.0003, 0.0],
        [0.431, 0.566, 0.0037, 0.0],
        [0.0042, 0.0143, 0.979, 0.0027],
        [0.0003, 0.0, 0.0007, 0.999],
    ]
    counts = confusion(plain, Hypotheses(), seed=1, draws=DRAWS)
    np.testing.assert_array_equal(counts.sum(axis=1), DRAWS)
    np.testing.assert_allclose(counts / DRAWS, expected, atol=5e-3)


@pytest.mark.parametrize("cn0_dbhz", [36.0, 39.0, 42.0, 45.0, 48.0])
def test_false_alarms_stay_below_the_published_rate(cn0_dbhz: float) -> None:
    """Upper ends of 99.9 % intervals, on draws held apart, with the monitor's cost of an alarm."""
    monitor = PowerDistortionMonitor()
    counts = confusion(monitor.map_for(cn0_dbhz), Hypotheses(cn0_dbhz=cn0_dbhz), seed=2, draws=DRAWS)
    for truth in (CLEAN, MULTIPATH):
        alarms = int(counts[truth, SPOOFED] + counts[truth, JAMMED])
        assert binomial_interval(alarms, DRAWS, confidence=0.999)[1] < monitor.p_fa
    for truth in (SPOOFED, JAMMED):
        seen = int(counts[truth, SPOOFED] + counts[truth, JAMMED])
        assert binomial_interval(seen, DRAWS, confidence=0.999)[0] > 0.92


def test_what_is_simulated_has_the_closed_forms() -> None:
    """Mean power and mean D² of every hypothesis at one strength; 100,000 draws, 5 σ of an exponential's mean."""
    still = Hypotheses(spoofer_advantage_db=(6.0, 6.0), jam_to_noise_db=(20.0, 20.0), ray_mean_excess_m=1e-9)
    v, r = 2 * 0.3, 10 * 10**4.5 / 2e6
    rises = {CLEAN: 1.0, MULTIPATH: 1.0, SPOOFED: (1 + r * (1 + 10**0.6)) / (1 + r), JAMMED: (101 + r) / (1 + r)}
    # |R(τ_d + Δ) − R(τ_d − Δ)| = 2 min(|Δ|, τ_d) until one of them leaves the triangle at |Δ| = 1 − τ_d
    x = np.linspace(-1, 1, 100_001)
    shape = np.maximum(1 - np.abs(0.15 + x), 0) - np.maximum(1 - np.abs(0.15 - x), 0)
    spoofer = 2 * 10**4.5 * 0.1 * 10**0.6 * np.mean(shape**2)
    squares = {CLEAN: 2 * v, MULTIPATH: 2 * v, SPOOFED: 2 * v + spoofer, JAMMED: 2 * v * 101}
    for truth, rise in rises.items():
        measured_db, distortion = still.simulate(truth, stream(5, "moments", truth.name), DRAWS)
        assert measured_db.mean() == pytest.approx(10 * np.log10(rise), abs=5 * 0.4 / np.sqrt(DRAWS))
        assert np.mean(distortion**2) == pytest.approx(squares[truth] / rise, rel=5 / np.sqrt(DRAWS))


def test_a_costly_alarm_is_rarer() -> None:
    rates = []
    for cost in (1.0, 3.0, 30.0):
        counts = confusion(simulated_decision_map(Hypotheses(), alarm_cost=cost), Hypotheses(), seed=3, draws=DRAWS)
        rates.append((counts[MULTIPATH, SPOOFED], counts[SPOOFED, SPOOFED]))
    assert rates[0][0] > rates[1][0] > rates[2][0]
    assert rates[0][1] > rates[2][1]


def test_detection_against_the_strength_of_the_spoofer() -> None:
    """Stronger is easier to see, and a hopeless one is called multipath or clean."""
    eta_db = np.array([-10.0, -3.0, 0.0, 3.0, 10.0])
    seen = PowerDistortionMonitor().probability_of_detection(eta_db, 45.0).tolist()
    assert seen == sorted(seen)
    assert seen[0] < 0.9
    assert seen[-1] > 0.99


def test_beyond_the_hypotheses_the_end_of_the_map_holds(plain: DecisionMap) -> None:
    rise = np.array([24.0, 60.0, 11.7, 0.0, -10.0])
    distortion = np.array([2.0, 2.0, 60.0, 0.5, 0.5])  # a spoofer of +20 dB, where the map's end at +10
    assert plain.classify(rise, distortion).tolist() == [JAMMED, JAMMED, SPOOFED, CLEAN, CLEAN]


def test_check() -> None:
    def of(power_db: float | None, distortion: float, expected: float | None) -> CheckResult:
        given = evidence(
            observed={Quantity.E1_POWER_DB: power_db},
            usual={Quantity.E1_POWER_DB: 0.0, Quantity.E1_CN0_DBHZ: expected},
            e1_taps=np.array([[[50.0 + distortion, 50.0 + 0j]]]),
            tap_chips=(-0.15, 0.15),
        )
        return outcome(PowerDistortionMonitor(), given)

    quiet = of(0.1, 1.0, 45.0)
    assert (quiet.outcome, quiet.statistic, quiet.threshold, quiet.unit) == (Outcome.PASS, CLEAN, MULTIPATH, "class")
    assert of(0.1, 8.0, 45.0).statistic == MULTIPATH
    spoofed = of(2.0, 30.0, 44.6)
    assert (spoofed.outcome, spoofed.reason) == (Outcome.FAIL, "power +2.0 dB, distortion 30.0 sigma: spoofed")
    assert of(15.0, 1.5, 45.0).reason.endswith("jammed")
    assert of(None, 1.0, 45.0).reason == "received power, E1 correlators or expected C/N0 are not known"
    assert of(0.1, 1.0, None).outcome is Outcome.NOT_RUN
    assert outcome(PowerDistortionMonitor(), evidence()).reason == "E1 was not tracked between the last two RECS"
