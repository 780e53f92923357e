"""The tests of replayed E1-B symbols on drawn correlations: false alarms and detections are those of the theory."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from jaxtyping import Complex128, Float
from scipy.stats import binomtest

from vestige.sample_processor.tracking.partial_correlation import predictable_reference_test, symbol_replay_test
from vestige.signals.definitions import E1B
from vestige.theory.scer.code_estimation import Decision
from vestige.theory.scer.partial_correlations import FIRST_CHIPS, Metric, ReferenceMetric, replay_detection_probability

TESTS, CHIPS = 1000, 24
LATER_CHIPS = E1B.code_length - FIRST_CHIPS
METRICS = get_args(ReferenceMetric)


def drawn(
    rng: np.random.Generator, cn0_dbhz: float, gain_db: float, n: int, *, head_chips: float, decision: str
) -> tuple[Complex128[np.ndarray, " n"], Complex128[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return first parts, later parts and symbols; gain +inf for symbols that are authentic or predictable.

    What the attacker sends is drawn from what it receives; later than `CHIPS` the estimate is taken as right.
    """
    one_chip = np.sqrt(E1B.chip_rate_hz / (2 * 10 ** (cn0_dbhz / 10)))
    symbols = rng.choice([-1.0, 1.0], n)
    sent = np.ones((n, CHIPS))
    if np.isfinite(gain_db):
        step = np.diff(np.maximum(np.arange(CHIPS) + head_chips, 0.0), prepend=0.0) / E1B.chip_rate_hz
        step *= 10 ** ((cn0_dbhz + gain_db) / 10)
        total = np.cumsum(2 * step + np.sqrt(2 * step) * rng.standard_normal((n, CHIPS)), axis=1)
        guess = rng.choice([-1.0, 1.0], (n, CHIPS))
        sent = np.tanh(total) if decision == "soft" else np.sign(np.where(total == 0, guess, total))
    noise = one_chip * (rng.standard_normal((2, n)) + 1j * rng.standard_normal((2, n)))
    first = symbols * sent[:, :FIRST_CHIPS].mean(axis=1) + noise[0] / np.sqrt(FIRST_CHIPS)
    later = symbols * (1 - (CHIPS - FIRST_CHIPS - sent[:, FIRST_CHIPS:].sum(axis=1)) / LATER_CHIPS)
    return first, later + noise[1] / np.sqrt(LATER_CHIPS), symbols


def alarms(
    cn0_dbhz: float,
    gain_db: float,
    n: int,
    p_fa: float,
    *,
    metric: Metric = "paired",
    n_predictable: int = 0,
    head_chips: float,
    decision: str,
    seed: int,
) -> int:
    """Return the alarms in `TESTS` tests; gain +inf for an authentic signal."""
    rng, found = np.random.default_rng(seed), 0
    for _ in range(TESTS):
        first, later, symbols = drawn(rng, cn0_dbhz, gain_db, n, head_chips=head_chips, decision=decision)
        if metric == "paired":
            found += symbol_replay_test(first, later, symbols, p_fa=p_fa).failed
            continue
        known = drawn(rng, cn0_dbhz, np.inf, n_predictable, head_chips=0.0, decision=decision)
        first, later, symbols = (np.concatenate(pair) for pair in zip((first, later, symbols), known, strict=True))
        unpredictable = np.arange(first.size) < n
        found += predictable_reference_test(first, later, unpredictable, symbols, metric=metric, p_fa=p_fa).failed
    return found


@pytest.mark.parametrize(("n", "p_fa"), [(10, 0.01), (100, 0.05), (480, 0.01)])
def test_false_alarms(n: int, p_fa: float) -> None:
    found = alarms(40.0, np.inf, n, p_fa, head_chips=0.0, decision="hard", seed=n)
    assert binomtest(found, TESTS, p_fa).pvalue > 1e-4


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize(("n", "n_predictable", "p_fa"), [(48, 48, 0.05), (48, 700, 0.01), (300, 100, 0.05)])
def test_false_alarms_with_predictable_symbols(
    n: int, n_predictable: int, p_fa: float, metric: ReferenceMetric
) -> None:
    """1000 tests at 42 dBHz, two-sided at 1e-4: 2.3 to 8.1 % of alarms for 5 %."""
    found = alarms(
        42.0, np.inf, n, p_fa, metric=metric, n_predictable=n_predictable, head_chips=0.0, decision="hard", seed=n
    )
    assert binomtest(found, TESTS, p_fa).pvalue > 1e-4


@pytest.mark.judged(by="theory", what="check for replayed E1-B symbols", figure="1000 tests, binomial test at 1e-4")
@pytest.mark.parametrize(
    ("cn0_dbhz", "gain_db", "n", "head_chips", "decision"),
    [
        (42.0, 10.0, 200, 0.0, "hard"),
        (42.0, 10.0, 200, 0.0, "soft"),
        (45.0, 3.0, 40, 0.0, "hard"),
        (55.0, 0.0, 12, 0.0, "hard"),  # the spread of the estimates is a third of the scatter
        (42.0, 20.0, 100, -2.3, "hard"),
        (45.0, 10.0, 480, 1.5, "hard"),
    ],
)
def test_detections(cn0_dbhz: float, gain_db: float, n: int, head_chips: float, decision: Decision) -> None:
    p_d = replay_detection_probability(
        cn0_dbhz, gain_db, n, 0.01, head_start_s=head_chips / E1B.chip_rate_hz, decision=decision
    )
    assert 0.03 < p_d < 0.97
    found = alarms(cn0_dbhz, gain_db, n, 0.01, head_chips=head_chips, decision=decision, seed=7)
    assert binomtest(found, TESTS, p_d).pvalue > 1e-4


@pytest.mark.judged(
    by="theory", what="partial correlations over predictable symbols", figure="1000 tests, binomial test at 1e-4"
)
@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize(
    ("cn0_dbhz", "gain_db", "n", "n_predictable", "head_chips", "decision"),
    [
        (42.0, 10.0, 200, 600, 0.0, "hard"),
        (42.0, 10.0, 200, 600, 0.0, "soft"),
        (45.0, 3.0, 60, 60, 0.0, "hard"),
    ],
)
def test_detections_with_predictable_symbols(
    cn0_dbhz: float,
    gain_db: float,
    n: int,
    n_predictable: int,
    head_chips: float,
    decision: Decision,
    metric: ReferenceMetric,
) -> None:
    """Two-sided at 1e-4: ± 0.06 about a P_d of 0.5."""
    p_d = replay_detection_probability(
        cn0_dbhz,
        gain_db,
        n,
        0.01,
        metric=metric,
        n_predictable=n_predictable,
        head_start_s=head_chips / E1B.chip_rate_hz,
        decision=decision,
    )
    assert 0.03 < p_d < 0.97
    found = alarms(
        cn0_dbhz,
        gain_db,
        n,
        0.01,
        metric=metric,
        n_predictable=n_predictable,
        head_chips=head_chips,
        decision=decision,
        seed=7,
    )
    assert binomtest(found, TESTS, p_d).pvalue > 1e-4
