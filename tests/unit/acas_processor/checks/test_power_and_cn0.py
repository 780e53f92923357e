"""The three checks of a normal statistic in dB: received power, C/N0, post-correlation noise floor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from evidence_builder import evidence, outcome
from vestige.acas_processor.checks.power.cn0 import Cn0Monitor
from vestige.acas_processor.checks.power.noise_floor import NoiseFloorMonitor
from vestige.acas_processor.checks.power.received_power import ReceivedPowerMonitor
from vestige.acas_processor.monitoring.baseline import Quantity
from vestige.campaign.statistics import binomial_test
from vestige.records import Band, CheckResult, Outcome
from vestige.records.snapshot_block import FrontEndBlock
from vestige.streams import stream

N = 100_000
P_FA = 0.01
LEVEL = 1e-4  # of each two-sided test of a rate


def _measured_power_db(rng: np.random.Generator, samples: int, sigma_db: float, rise_db: float = 0.0) -> np.ndarray:
    """Mean power of so many complex noise samples, with a gain that drifts."""
    power = rng.standard_gamma(samples, N) / samples
    return 10 * np.log10(power) + rise_db + sigma_db * rng.standard_normal(N)


@pytest.mark.parametrize("rise_db", [0.0, 0.9, -1.0])
def test_received_power(rise_db: float) -> None:
    monitor = ReceivedPowerMonitor(band=Band.E1, bandwidth_hz=1e6, averaging_s=1e-3, p_fa=P_FA)
    power = _measured_power_db(stream(1, "power", str(rise_db)), 1000, 0.3, 1.0 + rise_db)
    alarms = np.abs(power - 1.0) > monitor.threshold_db
    expected = float(monitor.probability_of_detection(np.array([rise_db]))[0])
    assert binomial_test(int(alarms.sum()), N, expected) > LEVEL
    assert (expected == pytest.approx(P_FA)) is (rise_db == 0.0)


def test_scatter_of_a_power_measurement() -> None:
    """W = 2 MHz, T = 10 ms: 0.031 dB; a threshold of 1.5 dB is 5 σ of 0.3 dB."""
    monitor = ReceivedPowerMonitor(band=Band.E1, sigma_system_db=0.0)
    assert monitor.sigma_db == pytest.approx(0.031, abs=5e-4)
    assert ReceivedPowerMonitor(band=Band.E1, p_fa=5.733e-7).threshold_db == pytest.approx(1.5, abs=0.01)


def _front_end(gain_db: float, power_db: float, *, saturated: bool = False) -> dict[Band, FrontEndBlock]:
    return {
        Band.E6: FrontEndBlock(
            agc_gain_db=np.array([gain_db]), total_power_db=np.array([power_db]), saturated=np.array([saturated])
        )
    }


def _of_power(power_db: float | None, usual_db: float | None = 0.0, **given: Any) -> CheckResult:
    observed, usual = {Quantity.E6_POWER_DB: power_db}, {Quantity.E6_POWER_DB: usual_db}
    return outcome(ReceivedPowerMonitor(band=Band.E6), evidence(observed=observed, usual=usual, **given))


def test_check_of_received_power() -> None:
    assert _of_power(0.5).outcome is Outcome.PASS
    loud = _of_power(3.0)
    assert (loud.outcome, loud.statistic, loud.unit) == (Outcome.FAIL, 3.0, "dB")
    assert loud.reason.startswith("E6 power is +3.0 dB")
    assert _front_end(-3.0, math.nan)[Band.E6].power_db[0] == 3.0, "a gain stands for the power"
    saturated = _of_power(None, front_end=_front_end(0.0, 0.0, saturated=True))
    assert (saturated.outcome, saturated.reason) == (Outcome.FAIL, "the E6 front end is saturated")
    assert _of_power(None).reason == "no status of the E6 front end"
    assert (
        _of_power(1.0, None, learned=3).reason == "its usual level is being learned: 3 of 5 snapshots without an alarm"
    )


def test_a_level_learned_from_few_values_allows_for_more() -> None:
    """A median of five has a variance of π/10 of one value, so the threshold grows by 1.146."""
    known, learned = _of_power(0.0), _of_power(0.0, learned=5)
    assert learned.threshold == pytest.approx(known.threshold * math.sqrt(1 + math.pi / 10))


@pytest.mark.parametrize("change_db", [0.0, 3.0, -5.0])
def test_cn0(change_db: float) -> None:
    monitor = Cn0Monitor(p_fa=P_FA)
    rng = stream(2, "cn0", str(change_db))
    expected = 40.0 + 3.0 * rng.standard_normal(N)
    measured = expected + change_db + 1.5 * rng.standard_normal(N) + 0.3 * rng.standard_normal(N)
    alarms = np.abs(monitor.statistic(measured, expected)) > monitor.threshold_db
    probability = float(monitor.probability_of_detection(np.array([change_db]))[0])
    assert binomial_test(int(alarms.sum()), N, probability) > LEVEL
    assert (probability == pytest.approx(P_FA)) is (change_db == 0.0)


def test_check_of_cn0() -> None:
    def of(measured: float | None, expected: float | None, learned: float = math.inf) -> CheckResult:
        observed, usual = {Quantity.E1_CN0_DBHZ: measured}, {Quantity.E1_CN0_DBHZ: expected}
        return outcome(Cn0Monitor(), evidence(observed=observed, usual=usual, learned=learned))

    assert of(41.0, 40.0).outcome is Outcome.PASS
    assert of(30.0, 40.0).reason.startswith("C/N0 is -10.0 dB")
    assert of(None, 40.0).reason == "C/N0 on E1 is not known"
    assert of(40.0, None).reason == "no level is expected: the elevation is not known"
    assert of(40.0, None, 2).reason.startswith("its usual level is being learned: 2 of 5")


@pytest.mark.parametrize("jam_db", [-math.inf, -7.0])
def test_noise_floor(jam_db: float) -> None:
    """The floor is the mean over N_c squared chip sums."""
    chips = 5115
    monitor = NoiseFloorMonitor(n_chips=chips, p_fa=P_FA)
    rng = stream(3, "floor", str(jam_db))
    floor_db = _measured_power_db(rng, chips, 0.3, 10 * np.log10(1 + 10 ** (jam_db / 10)))
    alarms = np.abs(floor_db) > monitor.threshold_db
    probability = float(monitor.probability_of_detection(np.array([jam_db]))[0])
    assert binomial_test(int(alarms.sum()), N, probability) > LEVEL
    assert (probability == pytest.approx(P_FA)) is (jam_db == -math.inf)


def test_check_of_the_noise_floor() -> None:
    def of(floor_db: float | None, usual_db: float | None = 0.0, noise_power: float | None = 1.0) -> CheckResult:
        given = evidence(
            observed={Quantity.FLOOR_DB: floor_db}, usual={Quantity.FLOOR_DB: usual_db}, noise_power=noise_power
        )
        return outcome(NoiseFloorMonitor(), given)

    assert of(0.5).outcome is Outcome.PASS
    assert of(3.0).reason.startswith("the E6 noise floor is +3.0 dB")
    assert of(None, noise_power=None).reason == "nothing was correlated on E6"
    assert of(None).reason == "the gain of the E6 front end is not known"
    assert of(0.0, None).outcome is Outcome.NOT_RUN
