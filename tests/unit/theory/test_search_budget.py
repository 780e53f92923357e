from __future__ import annotations

import numpy as np
import pytest

from vestige.theory.search_budget import grid_probability_of_detection, roc, search_budget
from vestige.theory.thresholds import overall_pfa, probability_of_detection


def test_budget_of_the_papers_exhaustive_search() -> None:
    budget = search_budget(2.4e10, 4e-3)
    assert budget.pfa == pytest.approx(4.1688e-14, rel=1e-4)
    assert budget.threshold == pytest.approx(7.8497, abs=1e-4)
    assert budget.required_cn0_dbhz == pytest.approx(40.123, abs=1e-3)
    assert budget.grid_loss_db == pytest.approx(1.13 + 0.29, abs=0.01)
    assert budget.independent == budget.hypotheses


def test_budget_of_the_papers_handover_search() -> None:
    budget = search_budget(7500, 4e-3, doppler_step_hz=0.0)
    assert budget.pfa == pytest.approx(1.334e-7, rel=1e-4)
    assert budget.required_cn0_dbhz == pytest.approx(37.654, abs=1e-3)
    assert budget.grid_loss_db == pytest.approx(1.13, abs=0.01)


def test_correlated_neighbours_lower_the_threshold_a_little() -> None:
    for hypotheses, at_least in ((1e4, 0.8), (2.4e10, 0.999)):
        plain = search_budget(hypotheses, 4e-3)
        fewer = search_budget(hypotheses, 4e-3, correlated_neighbours=True)
        assert at_least < fewer.independent / hypotheses < 1
        assert fewer.threshold < plain.threshold
        assert overall_pfa(fewer.pfa, fewer.independent) == pytest.approx(1e-3)


def test_between_the_cells_less_is_found() -> None:
    on_grid = float(probability_of_detection(40.12, 4e-3, 4.17e-14))
    both = grid_probability_of_detection(40.12, 4e-3, 4.17e-14)
    code = grid_probability_of_detection(40.12, 4e-3, 4.17e-14, bins=False)
    assert both < code < on_grid
    fine = grid_probability_of_detection(40.12, 4e-3, 4.17e-14, bins=False, half_step_chips=1e-6)
    assert fine == pytest.approx(on_grid, abs=1e-4)


@pytest.mark.slow
def test_average_over_the_grid_against_random_places() -> None:
    rng = np.random.default_rng(3)
    loss_db = -20 * np.log10((1 - 0.25 * rng.random(200_000)) * np.sinc(0.25 * rng.random(200_000)))
    expected = np.mean(probability_of_detection(40.12 - loss_db, 4e-3, 4.17e-14))
    assert grid_probability_of_detection(40.12, 4e-3, 4.17e-14) == pytest.approx(expected, abs=3e-3)


def test_roc_rises_and_the_shorter_list_is_better() -> None:
    rates = (1e-6, 1e-4, 1e-2, 0.5)
    exhaustive = roc(39.0, 4e-3, 2.4e10, rates)
    handover = roc(39.0, 4e-3, 7500, rates, bins=False)
    assert [one.overall_pfa for one in exhaustive] == list(rates)
    assert np.all(np.diff([one.probability_of_detection for one in exhaustive]) > 0)
    for one, other in zip(exhaustive, handover, strict=True):
        assert one.probability_of_detection < other.probability_of_detection
