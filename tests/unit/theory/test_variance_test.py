from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, chi2

from vestige.theory.variance_test import variance_threshold


def one(freedom: int, wide: int, ratio: float, p_fa: float) -> float:
    return float(variance_threshold(freedom, np.array([wide]), np.array([ratio]), p_fa)[0])


@pytest.mark.parametrize("p_fa", [1e-2, 1e-6])
@pytest.mark.parametrize("freedom", [8, 98])
def test_with_one_variance_it_is_chi_square(freedom: int, p_fa: float) -> None:
    assert one(freedom, freedom, 1.0, p_fa) == pytest.approx(chi2.isf(p_fa, freedom))
    assert one(freedom, 2, 1.0, p_fa) == pytest.approx(chi2.isf(p_fa, freedom))
    wide = one(freedom, freedom, 3.0, p_fa) / chi2.isf(p_fa, freedom)
    assert 3.0 <= wide < 3.0 * 1.021  # the ratio is rounded up


@pytest.mark.parametrize(("wide", "ratio"), [(2, 15.0), (2, 1.5), (10, 4.0)])
def test_the_mixture_is_exceeded_as_often_as_it_says(wide: int, ratio: float) -> None:
    """A million draws at 1e-3; the ratio is a step of the table, so the threshold is exact. Two-sided at 1e-4."""
    n, freedom, p_fa, rng = 1_000_000, 28, 1e-3, np.random.default_rng(3)
    ratio = np.exp(0.02 * np.ceil(np.log(ratio) / 0.02))
    total = rng.chisquare(freedom - wide, n) + ratio * rng.chisquare(wide, n)
    count = int(np.count_nonzero(total > one(freedom, wide, ratio * (1 - 1e-12), p_fa)))
    assert binom.ppf(5e-5, n, p_fa) <= count <= binom.isf(5e-5, n, p_fa)


def test_a_far_tail_is_that_of_the_wide_part() -> None:
    """Two degrees of freedom of variance k: P(T > t) falls as e^{−t/2k}, so a thousandth is 2k ln 1000 farther."""
    near, far = (one(28, 2, 20.0, p_fa) for p_fa in (1e-6, 1e-9))
    assert far - near == pytest.approx(2 * 20.0 * np.log(1000), rel=0.03)


def test_what_is_not_known_stays_so() -> None:
    found = variance_threshold(8, np.array([2, 2]), np.array([np.nan, 2.0]), 1e-3)
    assert np.isnan(found[0])
    assert found[1] > 0
