"""E6 misses in a row, where the false alarms a day of a level are set."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.evidence_builder import evidence, outcome

from vestige.acas_processor.checks.power.e6_misses import E6MissesCheck, MissPrediction, expected_miss_rate
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.monitoring.memory import CheckMemory
from vestige.records import Outcome
from vestige.theory.fading import faded_miss_probability

CHECK = E6MissesCheck(p_fa=2e-5)
OUTCOMES = {Outcome.PASS: "p", Outcome.FAIL: "f", Outcome.NOT_RUN: "n"}


def recs(found: str, cn0_dbhz: Any, *, memory: CheckMemory | None = None, predicted_pd: float = 0.95) -> Evidence:
    """Return evidence of one satellite: `d` is a detection, `m` a miss, `x` a RECS that was not correlated."""
    n = len(found)
    letters = np.array(list(found))
    return evidence(
        (n, 1),
        tap=np.where(letters == "d", 3, -1)[:, None],
        noise_power=np.where(letters == "x", np.nan, 1.0)[:, None],
        predicted_pd=predicted_pd,
        e1_cn0_dbhz=np.reshape(np.broadcast_to(cn0_dbhz, n), (n, 1)),
        memory=memory,
    )


def said(given: Evidence, check: E6MissesCheck = CHECK) -> str:
    return "".join(OUTCOMES[outcome(check, given, row).outcome] for row in range(given.shape[0]))


@pytest.mark.parametrize(
    ("cn0_dbhz", "outcomes"),
    [(40.0, "ffff"), (38.0, "ffff"), (35.0, "nfff"), (33.0, "nnnf"), (32.0, "nnnnf")],
)
def test_weak_satellites_are_missed_more_often_before_an_alarm(cn0_dbhz: float, outcomes: str) -> None:
    """⌈ln p_fa / ln q⌉ misses in a row."""
    assert said(recs("m" * len(outcomes), cn0_dbhz)) == outcomes
    needed = np.ceil(np.log(2e-5) / np.log(faded_miss_probability(cn0_dbhz, 16e-3, 1e-7, -15.8)))
    assert outcomes.index("f") + 1 == max(needed, 1)


def test_a_detection_ends_a_run_and_a_recs_without_correlators_does_not() -> None:
    assert said(recs("mmmdmmmm", 33.0)) == "nnnpnnnf"
    assert said(recs("mmxmxm", 33.0)) == "nnnnnf"


def test_misses_of_strong_and_weak_recs_count_by_their_probability() -> None:
    """10⁻¹·⁴⁵ at 33 dBHz and 10⁻²·⁸³ at 35: both orders reach 10⁻⁴·⁷ with three."""
    assert said(recs("mmm", np.array([33.0, 33.0, 35.0]))) == "nnf"
    assert said(recs("mmm", np.array([35.0, 33.0, 33.0]))) == "nnf"
    assert said(recs("mm", np.array([33.0, 35.0]))) == "nn"


def test_a_miss_that_proves_nothing_does_not_count() -> None:
    """Below `min_pd` and without C/N0: not run, and the run goes on behind it."""
    weak = recs("mmmm", 33.0, predicted_pd=0.89)
    assert said(weak) == "nnnn"
    assert "below 0.9" in outcome(CHECK, weak).reason
    assert CHECK.remember(weak) == {}
    assert "not known" in outcome(CHECK, recs("m", np.nan, predicted_pd=np.nan)).reason


def test_reasons_name_the_probability() -> None:
    given = recs("mmmm", 33.0)
    assert "has a probability of 0.04 without an attack: an alarm follows below 2e-05" in outcome(CHECK, given).reason
    assert "so many misses in a row have a probability of 2e-06" in outcome(CHECK, given, 3).reason


@pytest.mark.parametrize("cut", [1, 2, 3, 5])
def test_a_run_goes_on_from_block_to_block(cut: int) -> None:
    found, cn0_dbhz = "dmmmmdmmxmm", np.linspace(32.3, 35.1, 11)
    whole = CHECK.series(recs(found, cn0_dbhz)).statistic
    memory: CheckMemory = {7: (1.5,)}  # of another satellite: it stays
    pieces = []
    for first in range(0, len(found), cut):
        part = recs(found[first : first + cut], cn0_dbhz[first : first + cut], memory=memory)
        pieces.append(CHECK.series(part).statistic)
        memory = CHECK.remember(part)
    assert np.concatenate(pieces).tobytes() == whole.tobytes()
    assert memory == {7: (1.5,), **CHECK.remember(recs(found, cn0_dbhz))}


def test_a_run_of_any_length_stays_a_number() -> None:
    given = recs("m" * 50, 60.0)
    quiet = replace(CHECK, prediction=MissPrediction(ray_power_db=-60.0))
    assert np.all(np.isfinite(quiet.series(given).statistic))


def test_tests_fail_no_more_often_than_their_probability() -> None:
    """Bound: 400,000 RECS of independent misses. P(more than bound + 4σ) < 1e-4 if the bound holds."""
    p_fa, rng = 1e-3, np.random.default_rng(8)
    cn0_dbhz = rng.uniform(31.5, 36.0, (4000, 100))
    rounded_dbhz, place = np.unique(np.round(cn0_dbhz, 2), return_inverse=True)
    q = faded_miss_probability(rounded_dbhz, 16e-3, 1e-7, -15.8)[place].reshape(cn0_dbhz.shape)
    missed = rng.random(cn0_dbhz.shape) < q
    given = evidence(
        cn0_dbhz.shape, tap=np.where(missed, -1, 3), noise_power=1.0, predicted_pd=0.95, e1_cn0_dbhz=cn0_dbhz
    )
    failed = int(np.count_nonzero(E6MissesCheck(p_fa=p_fa).series(given).failed))
    bound = p_fa * cn0_dbhz.size
    assert failed <= bound + 4 * np.sqrt(bound)
    assert failed > 0.1 * bound  # and not because it never fails


def test_the_expected_miss_rate_is_that_of_the_tests_in_which_a_miss_counts() -> None:
    given = recs("dmdd", np.array([33.0, 33.0, 40.0, 40.0]))
    q = faded_miss_probability(np.array([33.0, 40.0]), 16e-3, 1e-7, -15.8)
    assert expected_miss_rate(MissPrediction(), given.measured) == pytest.approx(q.mean())
    assert expected_miss_rate(MissPrediction(e6_over_e1_db=-1.0), given.measured) > 2 * q.mean()
    assert expected_miss_rate(MissPrediction(), recs("ddmm", 33.0, predicted_pd=0.5).measured) == 0.0
