from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import gammaincc, i0e, ive
from scipy.stats import ncx2

from vestige.theory.marcum_q import marcum_p, marcum_q

amplitudes = st.floats(0, 40)
limits = st.floats(0.01, 40)
orders = st.integers(1, 100)


def by_poisson_counts(a: float, b: float, order: int) -> tuple[Decimal, Decimal]:
    """Q and P in 50 digits: with Poisson counts X of mean b²/2 and Y of mean a²/2, Q_K(a, b) = P(X < K + Y)."""
    with localcontext(prec=50):
        x, y = Decimal(b) ** 2 / 2, Decimal(a) ** 2 / 2
        most = int(max(x, y)) + 40 * int(max(x, y).sqrt()) + 200 + order
        counts, term = [], (-x).exp()
        for i in range(most + order):
            counts.append(term)
            term *= x / (i + 1)
        above = [Decimal(0)] * (most + order + 1)
        for i in reversed(range(most + order)):
            above[i] = above[i + 1] + counts[i]
        q = p = below = Decimal(0)
        below = sum(counts[:order], Decimal(0))
        term = (-y).exp()
        for j in range(most):
            q, p = q + term * below, p + term * above[j + order]
            below += counts[j + order]
            term *= y / (j + 1)
        return q, p


@pytest.mark.parametrize(
    ("a", "b", "order"),
    [
        (13.0, 5.678, 1),  # a miss of 1e-13
        (20.0, 2.0, 1),  # a miss of 1e-73
        (0.5, 8.3, 1),  # a false alarm of 1e-14
        (1e-6, 12.0, 20),  # an amplitude of next to nothing
        (0.0, 5.7, 5),
        (20.0, 40.0, 1),
        (20.0, 5.7, 5),
        (2.0, 40.0, 100),
        (5.0, 5.0, 2),
        (0.01, 5.7, 100),
    ],
)
def test_both_tails_to_12_digits(a: float, b: float, order: int) -> None:
    q, p = by_poisson_counts(a, b, order)
    tolerance = 1e-12 if order < 100 else 1e-11
    assert marcum_q(a, b, order) == pytest.approx(float(q), rel=tolerance, abs=0)
    assert marcum_p(a, b, order) == pytest.approx(float(p), rel=tolerance, abs=0)


@given(amplitudes, limits, orders)
def test_agrees_with_the_noncentral_chi_squared_distribution(a: float, b: float, order: int) -> None:
    expected = ncx2.sf(b**2, 2 * order, a**2)
    assert marcum_q(a, b, order) == pytest.approx(expected, rel=1e-9, abs=1e-15)


@given(limits, orders)
def test_without_signal_it_is_the_false_alarm(b: float, order: int) -> None:
    assert marcum_q(0.0, b, order) == pytest.approx(gammaincc(order, b**2 / 2), rel=1e-11, abs=1e-280)
    assert marcum_q(0.0, b) == pytest.approx(np.exp(-(b**2) / 2), rel=1e-12, abs=1e-300)


@given(amplitudes, orders)
def test_without_threshold_it_is_certain(a: float, order: int) -> None:
    assert marcum_q(a, 0.0, order) == 1.0
    assert marcum_p(a, 0.0, order) == 0.0


@given(amplitudes)
def test_closed_form_on_the_diagonal(a: float) -> None:
    assert marcum_q(a, a) == pytest.approx((1 + i0e(a**2)) / 2, rel=1e-13)


@given(st.floats(0.1, 40), limits, st.integers(1, 50))
def test_one_more_magnitude_adds_one_bessel_term(a: float, b: float, order: int) -> None:
    step = (b / a) ** order * np.exp(-((a - b) ** 2) / 2) * ive(order, a * b)
    assert marcum_q(a, b, order + 1) - marcum_q(a, b, order) == pytest.approx(step, rel=1e-8, abs=1e-13)


@given(amplitudes, limits, orders)
def test_tails_add_to_one(a: float, b: float, order: int) -> None:
    assert marcum_q(a, b, order) + marcum_p(a, b, order) == pytest.approx(1.0, abs=1e-15)


def test_an_array_gives_what_its_numbers_give() -> None:
    a = np.linspace(0, 100, 12).reshape(3, 4)
    q, p = marcum_q(a, 5.7), marcum_p(a, 5.7)
    assert q.shape == p.shape == (3, 4)
    assert isinstance(marcum_q(1.0, 5.7), float)
    np.testing.assert_array_equal(q, [[marcum_q(float(x), 5.7) for x in row] for row in a])
    np.testing.assert_array_equal(p, [[marcum_p(float(x), 5.7) for x in row] for row in a])


def test_any_strength_and_no_number() -> None:
    assert marcum_p(1e9, 5.7, 3) == 0.0
    assert marcum_q(1e9, 5.7, 3) == 1.0
    assert np.isnan(marcum_q(float("nan"), 5.7))


@pytest.mark.parametrize(("a", "b", "order"), [(-1.0, 1.0, 1), (1.0, -1.0, 1), (1.0, 1.0, 0), (1.0, 1.0, 1001)])
def test_refuses(a: float, b: float, order: int) -> None:
    with pytest.raises(ValueError, match="must not be negative"):
        marcum_q(a, b, order)
