from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from scipy.stats import f as f_distribution
from scipy.stats import rice, t

from vestige.theory.scer.partial_correlations import (
    ReferenceMetric,
    metric_threshold,
    metric_value,
    replay_detection_probability,
)

METRICS = get_args(ReferenceMetric)


@pytest.mark.parametrize("p_fa", [0.3, 1e-3, 1e-8])
def test_exact_thresholds(p_fa: float) -> None:
    """Student's t and F(2, ν), of another library."""
    assert metric_threshold(40, 62, p_fa, 0.3, "real") == pytest.approx(t.isf(p_fa, 100))
    assert metric_threshold(40, 62, p_fa, 0.3, "distance") == pytest.approx(f_distribution.isf(p_fa, 2, 100))


@pytest.mark.parametrize(("n_u", "n_p"), [(60, 600), (400, 100)])
def test_thresholds_of_magnitudes(n_u: int, n_p: int) -> None:
    """A million drawn pairs of Rice variables for a noise that is nearly known; 4.5 standard deviations."""
    n_u, n_p = 100 * n_u, 100 * n_p  # ν so large that Student's t is normal
    amplitude, draws, p_fa = 0.03, 1_000_000, 0.01
    rng = np.random.default_rng(3)
    u, p = (rice.rvs(amplitude * np.sqrt(n), scale=1 / np.sqrt(n), size=draws, random_state=rng) for n in (n_u, n_p))
    above = {
        "magnitudes": (p - u) / np.sqrt(1 / n_u + 1 / n_p) > metric_threshold(n_u, n_p, p_fa, amplitude, "magnitudes"),
        "ratio": p / u > metric_threshold(n_u, n_p, p_fa, amplitude, "ratio"),
    }
    for found in above.values():
        assert abs(np.mean(found) - p_fa) < 4.5 * np.sqrt(p_fa / draws)


@pytest.mark.parametrize("metric", METRICS)
def test_an_attacker_who_knows_the_symbols_is_found_by_chance_only(metric: ReferenceMetric) -> None:
    """A head start of 0.1 ms at 60 dBHz: nothing is wrong any more."""
    found = replay_detection_probability(60.0, 10.0, 480, 1e-3, metric=metric, head_start_s=1e-4)
    assert found == pytest.approx(1e-3, rel=0.01)


def test_metrics_do_not_depend_on_the_unit_and_three_do_not_on_the_phase() -> None:
    turned = np.exp(0.7j)
    for metric in METRICS:
        one = metric_value(0.6 + 0.1j, 1.0, 2.0, 48, 700, metric)
        assert metric_value(6 + 1j, 10.0, 20.0, 48, 700, metric) == pytest.approx(one)
        same = metric_value((0.6 + 0.1j) * turned, turned, 2.0, 48, 700, metric) == pytest.approx(one)
        assert same == (metric != "real")


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match=r"between 0 and 0\.5, found 0\.5"):
        metric_threshold(48, 48, 0.5, 0.3, "real")
    with pytest.raises(ValueError, match="no metric 'R1': expected one of real, distance, magnitudes, ratio"):
        metric_value(1.0, 1.0, 1.0, 48, 48, "R1")  # type: ignore[arg-type]
