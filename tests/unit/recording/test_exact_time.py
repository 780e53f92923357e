from __future__ import annotations

from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from vestige.recording.exact_time import exact_gst, exact_second, later, samples_later
from vestige.time import GalileoTime

times = st.builds(
    GalileoTime, st.integers(0, 9000), st.integers(0, 604_799), st.floats(0, 1, exclude_max=True, allow_subnormal=False)
)


@given(times)
def test_text_reads_back_as_the_same_time(time: GalileoTime) -> None:
    assert GalileoTime.parse(exact_gst(time)) == time


def test_text_is_short() -> None:
    assert exact_second(GalileoTime(1, 5)) == "5"
    assert exact_second(GalileoTime(1, 5, 0.25)) == "5.25"
    assert exact_gst(GalileoTime(1161, 348018, 1e-9)) == "1161:348018.000000001"


@given(times, st.integers(0, 10**13), st.sampled_from([12.5e6, 10.3e6, 12e6, 4.092e6 / 3]))
def test_samples_later_is_exact_but_for_one_rounding(time: GalileoTime, count: int, rate: float) -> None:
    after = samples_later(time, count, rate)
    exact = Fraction(count) / Fraction(rate)
    whole = (after.week - time.week) * 604_800 + after.second - time.second
    error = whole + Fraction(after.fraction) - Fraction(time.fraction) - exact
    assert abs(error) <= Fraction(1, 2**53)


@given(st.integers(0, 10**12), st.integers(0, 10**12))
def test_pieces_add_up(first: int, second: int) -> None:
    start = GalileoTime(1161, 348018)
    together = samples_later(start, first + second, 12.5e6)  # an exact multiple of 80 ns: few bits
    assert abs(samples_later(samples_later(start, first, 12.5e6), second, 12.5e6) - together) < 3e-16


def test_before_and_a_fraction_that_rounds_up() -> None:
    assert later(GalileoTime(2, 0), Fraction(-1, 4)) == GalileoTime(1, 604_799, 0.75)
    assert later(GalileoTime(2, 0), Fraction(-1, 2**80)) == GalileoTime(2, 0)
