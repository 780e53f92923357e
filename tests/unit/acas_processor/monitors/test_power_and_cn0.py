"""The three checks of a normal statistic in dB: received power, C/N0, wrong-code floor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vestige.acas_processor.monitors.cn0_expectation import Cn0Monitor
from vestige.acas_processor.monitors.received_power import ReceivedPowerMonitor
from vestige.acas_processor.monitors.wrong_code_floor import WrongCodeFloorMonitor
from vestige.campaign.statistics import binomial_test
from vestige.records import Band, FrontEndStatus, Outcome
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
    monitor = ReceivedPowerMonitor(band=Band.E1, nominal_power_db=1.0, bandwidth_hz=1e6, averaging_s=1e-3, p_fa=P_FA)
    power = _measured_power_db(stream(1, "power", str(rise_db)), 1000, 0.3, 1.0 + rise_db)
    alarms = np.abs(monitor.statistic(power)) > monitor.threshold_db
    expected = float(monitor.probability_of_detection(np.array([rise_db]))[0])
    assert binomial_test(int(alarms.sum()), N, expected) > LEVEL
    assert (expected == pytest.approx(P_FA)) is (rise_db == 0.0)


def test_scatter_of_a_power_measurement() -> None:
    """W = 2 MHz, T = 10 ms: 0.031 dB; a threshold of 1.5 dB is 5 σ of 0.3 dB."""
    monitor = ReceivedPowerMonitor(band=Band.E1, sigma_system_db=0.0)
    assert monitor.sigma_db == pytest.approx(0.031, abs=5e-4)
    assert ReceivedPowerMonitor(band=Band.E1, p_fa=5.733e-7).threshold_db == pytest.approx(1.5, abs=0.01)


def test_check_of_received_power() -> None:
    monitor = ReceivedPowerMonitor(band=Band.E6)
    quiet = FrontEndStatus(agc_gain_db=0.0, total_power_db=0.5, saturated=False)
    assert monitor.check(quiet).outcome is Outcome.PASS
    loud = monitor.check(FrontEndStatus(agc_gain_db=-3.0, total_power_db=3.0, saturated=False))
    assert (loud.outcome, loud.statistic, loud.unit) == (Outcome.FAIL, 3.0, "dB")
    assert loud.reason.startswith("E6 power is +3.0 dB")
    gain_only = monitor.check(FrontEndStatus(agc_gain_db=-3.0, total_power_db=math.nan, saturated=False))
    assert gain_only.statistic == 3.0
    saturated = monitor.check(FrontEndStatus(agc_gain_db=0.0, total_power_db=0.0, saturated=True))
    assert (saturated.outcome, saturated.reason) == (Outcome.FAIL, "the E6 front end is saturated")
    unknown = monitor.check(FrontEndStatus(agc_gain_db=math.nan, total_power_db=math.nan, saturated=False))
    assert unknown.outcome is Outcome.NOT_RUN
    assert monitor.check(None).reason == "no status of the E6 front end"


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
    monitor = Cn0Monitor()
    assert monitor.check(41.0, 40.0).outcome is Outcome.PASS
    assert monitor.check(30.0, 40.0).reason.startswith("C/N0 is -10.0 dB")
    assert monitor.check(None, 40.0).reason == "C/N0 on E1 is not known"
    assert monitor.check(math.nan, 40.0).outcome is Outcome.NOT_RUN
    assert monitor.check(40.0, None).outcome is Outcome.NOT_RUN
    assert monitor.check(40.0, math.nan).reason.startswith("no C/N0 is expected")


@pytest.mark.parametrize("jam_db", [-math.inf, -7.0])
def test_wrong_code_floor(jam_db: float) -> None:
    """The floor is the mean over N_c squared chip sums behind a gain that follows the power."""
    chips = 5115
    monitor = WrongCodeFloorMonitor(nominal_floor_db=-20.0, n_chips=chips, p_fa=P_FA)
    rng = stream(3, "floor", str(jam_db))
    gain_db = rng.normal(0.0, 6.0, N)
    floor_db = -20.0 + _measured_power_db(rng, chips, 0.3, 10 * np.log10(1 + 10 ** (jam_db / 10)))
    alarms = np.abs(monitor.statistic(10 ** ((floor_db + gain_db) / 10), gain_db)) > monitor.threshold_db
    probability = float(monitor.probability_of_detection(np.array([jam_db]))[0])
    assert binomial_test(int(alarms.sum()), N, probability) > LEVEL
    assert (probability == pytest.approx(P_FA)) is (jam_db == -math.inf)


def test_check_of_the_wrong_code_floor() -> None:
    monitor = WrongCodeFloorMonitor(nominal_floor_db=0.0, n_chips=81_840)
    assert monitor.check(1.0, 0.0).outcome is Outcome.PASS
    assert monitor.check(0.1, -10.0).outcome is Outcome.PASS
    assert monitor.check(2.0, 0.0).reason.startswith("the E6 noise floor is +3.0 dB")
    assert monitor.check(1.0, -3.0).outcome is Outcome.FAIL, "a gain that follows the noise does not hide it"
    assert monitor.check(None, 0.0).reason == "nothing was correlated on E6"
    assert monitor.check(0.0, 0.0).outcome is Outcome.NOT_RUN
    assert monitor.check(1.0, None).reason == "the gain of the E6 front end is not known"
    assert np.isnan(monitor.statistic(np.zeros(1), np.zeros(1)))[0]
