from __future__ import annotations

from dataclasses import replace

import pytest

from vestige.acas_processor.position.error_budget import ErrorBudget


def test_published_columns() -> None:
    assert ErrorBudget.uncorrected().sigma_m == pytest.approx(8.85, abs=0.005)
    assert ErrorBudget.uncorrected().limit_m() == pytest.approx(26.6, abs=0.05)
    assert ErrorBudget.corrected().sigma_m == pytest.approx(4.37, abs=0.005)
    assert ErrorBudget.corrected().limit_m() == pytest.approx(13.1, abs=0.05)


def test_snapshot_receiver_on_e1() -> None:
    budget = replace(ErrorBudget.corrected(), noise_e1_m=3.0)
    assert (budget.sigma_m, budget.limit_m()) == pytest.approx((5.28, 15.8), abs=0.05)


def test_only_the_difference_of_the_ionosphere_counts() -> None:
    alone = ErrorBudget(
        hardware_m=0,
        group_delay_m=0,
        ionosphere_e1_m=10,
        multipath_e1_m=0,
        multipath_e6_m=0,
        noise_e1_m=0,
        noise_e6_m=0,
    )
    assert alone.sigma_m == pytest.approx(5.17824)  # (154/125)² − 1
    assert replace(alone, hardware_m=12.0).sigma_m == pytest.approx((5.17824**2 + 144) ** 0.5)
    assert alone.limit_m(kappa=4) == pytest.approx(4 * 5.17824)
