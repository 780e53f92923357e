"""The test of replayed E1-B symbols on drawn correlations: its false alarms and detections are those of the theory."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binomtest

from vestige.sample_processor.tracking.partial_correlation import (
    FIRST_CHIPS,
    replay_detection_probability,
    symbol_replay_test,
)
from vestige.signals.definitions import E1B

TESTS, CHIPS = 1000, 24
LATER_CHIPS = E1B.code_length - FIRST_CHIPS


def alarms(cn0_dbhz: float, gain_db: float, n: int, p_fa: float, *, head_chips: float, decision: str, seed: int) -> int:
    """Return the alarms in `TESTS` tests; gain +inf for an authentic signal.

    What the attacker sends is drawn from what it receives; later than `CHIPS` the estimate is taken as right.
    """
    rng, found = np.random.default_rng(seed), 0
    one_chip = np.sqrt(E1B.chip_rate_hz / (2 * 10 ** (cn0_dbhz / 10)))
    for _ in range(TESTS):
        symbols = rng.choice([-1.0, 1.0], n)
        sent = np.ones((n, CHIPS))
        if np.isfinite(gain_db):
            step = np.diff(np.maximum(np.arange(CHIPS) + head_chips, 0.0), prepend=0.0) / E1B.chip_rate_hz
            step *= 10 ** ((cn0_dbhz + gain_db) / 10)
            total = np.cumsum(2 * step + np.sqrt(2 * step) * rng.standard_normal((n, CHIPS)), axis=1)
            guess = rng.choice([-1.0, 1.0], (n, CHIPS))
            sent = np.tanh(total) if decision == "soft" else np.sign(np.where(total == 0, guess, total))
        first = symbols * sent[:, :FIRST_CHIPS].mean(axis=1)
        later = symbols * (1 - (CHIPS - FIRST_CHIPS - sent[:, FIRST_CHIPS:].sum(axis=1)) / LATER_CHIPS)
        first += one_chip / np.sqrt(FIRST_CHIPS) * rng.standard_normal(n)
        later += one_chip / np.sqrt(LATER_CHIPS) * rng.standard_normal(n)
        found += symbol_replay_test(first + 0j, later + 0j, symbols, p_fa=p_fa).failed
    return found


@pytest.mark.parametrize(("n", "p_fa"), [(10, 0.01), (100, 0.05), (480, 0.01)])
def test_false_alarms(n: int, p_fa: float) -> None:
    found = alarms(40.0, np.inf, n, p_fa, head_chips=0.0, decision="hard", seed=n)
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
def test_detections(cn0_dbhz: float, gain_db: float, n: int, head_chips: float, decision: str) -> None:
    p_d = replay_detection_probability(
        cn0_dbhz,
        gain_db,
        n,
        0.01,
        head_start_s=head_chips / E1B.chip_rate_hz,
        decision=decision,  # type: ignore[arg-type]
    )
    assert 0.03 < p_d < 0.97
    found = alarms(cn0_dbhz, gain_db, n, 0.01, head_chips=head_chips, decision=decision, seed=7)
    assert binomtest(found, TESTS, p_d).pvalue > 1e-4
