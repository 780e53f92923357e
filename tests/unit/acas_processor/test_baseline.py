from __future__ import annotations

import math

import numpy as np
import pytest

from builders import START
from vestige.acas_processor.learned_checks import LEARNED, WINDOW, LearnedReferences, Usual
from vestige.measurement import Measurement, SatelliteMeasurement
from vestige.records import Band, CheckResult, CorrelatorBank, E1Observation, FrontEndStatus, Outcome, Snapshot

P_FA = dict.fromkeys(("E1 received power", "E6 received power", "C/N0", "E6 C/N0", "wrong-code floor"), 1e-6)


def _observed(
    *,
    power_db: float = 3.0,
    cn0_dbhz: float = 40.0,
    tap: float = 25.0,
    floor: float = 2.0,
    saturated: bool = False,
    gain_db: float = -1.0,
) -> tuple[Snapshot, Measurement]:
    status = FrontEndStatus(agc_gain_db=gain_db, total_power_db=power_db, saturated=saturated)
    seen = E1Observation(
        svid=7,
        pseudorange_m=2.4e7,
        carrier_phase_cycles=math.nan,
        doppler_hz=0.0,
        doppler_rate_hz_per_s=0.0,
        cn0_dbhz=cn0_dbhz,
    )
    snapshot = Snapshot(
        index=0,
        time=START,
        received_at=START,
        time_uncertainty_s=1.0,
        observations={7: seen},
        e6=None,
        front_end=dict.fromkeys(Band, status),
    )
    bank = CorrelatorBank(offsets_m=np.zeros(1), taps=np.full(1, tap + 0j), noise_power=floor, integration_s=0.016)
    satellite = SatelliteMeasurement(svid=7, bank=bank)
    return snapshot, Measurement(
        index=0, time=START, satellites=(satellite,), observations={7: seen}, front_end=snapshot.front_end
    )


def _checks(usual: LearnedReferences, snapshot: Snapshot, measurement: Measurement) -> dict[str, CheckResult]:
    found = (*usual.of_receiver(snapshot, P_FA), *usual.of_satellite(snapshot, measurement.satellites[0], P_FA))
    return {check.name: check for check in found}


@pytest.fixture(scope="module")
def learned() -> LearnedReferences:
    usual = LearnedReferences()
    for _ in range(LEARNED):
        usual = usual.learn(*_observed())
    return usual


def test_nothing_is_said_while_it_learns() -> None:
    usual = LearnedReferences()
    for n in range(LEARNED):
        checks = _checks(usual, *_observed())
        assert {check.outcome for check in checks.values()} == {Outcome.NOT_RUN}
        assert all(f"{n} of {LEARNED} quiet" in check.reason for check in checks.values())
        usual = usual.learn(*_observed())
    assert {check.outcome for check in _checks(usual, *_observed()).values()} == {Outcome.PASS}


@pytest.mark.parametrize(
    ("change", "failing", "by"),
    [
        ({"power_db": 6.0}, {"E1 received power", "E6 received power"}, 3.0),
        ({"power_db": 0.0}, {"E1 received power", "E6 received power"}, -3.0),
        ({"cn0_dbhz": 30.0}, {"C/N0"}, -10.0),
        ({"tap": 60.0}, {"E6 C/N0"}, 60.0 - math.sqrt(25.0**2 - 1)),  # (60² − …)/(2/2) σ², s² = 25² − 2
        ({"floor": 4.0, "tap": 35.0}, {"wrong-code floor"}, 10 * math.log10(2)),
        ({"gain_db": -4.0}, {"wrong-code floor"}, 3.0),  # the same floor behind less gain
        ({"power_db": 3.2, "cn0_dbhz": 41.0, "floor": 2.05}, set(), 0.0),
    ],
)
def test_a_change_fails(learned: LearnedReferences, change: dict[str, float], failing: set[str], by: float) -> None:
    checks = _checks(learned, *_observed(**change))  # type: ignore[arg-type]
    assert {name for name, check in checks.items() if check.outcome is Outcome.FAIL} == failing
    for name in failing:
        assert checks[name].statistic == pytest.approx(by)


def test_saturation_fails_before_anything_is_learned() -> None:
    checks = _checks(LearnedReferences(), *_observed(saturated=True))
    assert checks["E1 received power"].outcome is Outcome.FAIL
    assert "saturated" in checks["E1 received power"].reason


def test_a_gain_stands_for_an_unknown_power(learned: LearnedReferences) -> None:
    usual = LearnedReferences()
    for _ in range(LEARNED):
        usual = usual.learn(*_observed(power_db=math.nan, gain_db=-20.0))
    louder = _checks(usual, *_observed(power_db=math.nan, gain_db=-23.0))["E1 received power"]
    assert (louder.outcome, louder.statistic) == (Outcome.FAIL, pytest.approx(3.0))


def test_what_is_not_known_is_said(learned: LearnedReferences) -> None:
    snapshot, _ = _observed(gain_db=math.nan)
    unknown = SatelliteMeasurement(svid=7)
    bare = Snapshot(
        index=0, time=START, received_at=START, time_uncertainty_s=1.0, observations={}, e6=None, front_end={}
    )
    found = (*learned.of_receiver(bare, P_FA), *learned.of_satellite(bare, unknown, P_FA))
    assert [check.reason for check in found] == [
        "no status of the E1 front end",
        "no status of the E6 front end",
        "C/N0 on E1 is not known",
        "nothing was correlated on E6",
        "nothing was correlated on E6",
    ]
    floor = _checks(learned, snapshot, _observed()[1])["wrong-code floor"]
    assert floor.reason == "the gain of the E6 front end is not known"


def test_a_reference_is_the_median_of_the_last() -> None:
    usual = Usual()
    for value in (*range(100), math.nan):
        usual = usual.learn(float(value))
    assert usual.values == tuple(float(value) for value in range(100 - WINDOW, 100))
    assert usual.value == pytest.approx(89.5)
