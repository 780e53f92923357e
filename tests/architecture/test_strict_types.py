"""Array types are really checked: by the decorator, and by the import hook in the modules of vestige."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import jaxtyping
import numpy as np
import pytest
from beartype.roar import BeartypeCallHintViolation
from jaxtyping import Float, Int64

from strict_types import CALLS, begin_test, check
from vestige.theory.range_offset import range_offset_m

if TYPE_CHECKING:
    from pathlib import Path

Pair = tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]
Reals = TypeVar("Reals", float, Float[np.ndarray, "..."])


@pytest.fixture(autouse=True)
def _checks_are_on() -> Iterator[None]:
    before = jaxtyping.config.jaxtyping_disable
    jaxtyping.config.update("jaxtyping_disable", False)
    yield
    jaxtyping.config.update("jaxtyping_disable", before)


@check
def product(
    a: Float[np.ndarray, " n"], b: Float[np.ndarray, " n"], *, unit: Path | None = None
) -> Int64[np.ndarray, " n"]:
    return (a * b).astype(np.int64 if unit is None else np.int32)


@check
def total(pair: Pair) -> float:
    return float(sum(one.sum() for one in pair))


@check
def same(number: Reals) -> Reals:
    return number


@check
@dataclass
class Record:
    taps: Float[np.ndarray, "n 3"]

    @check
    def scaled(self, factor: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 3"]:
        return self.taps * factor


def test_what_is_right_passes() -> None:
    assert product(np.ones(3), np.ones(3)).tolist() == [1, 1, 1]
    assert total((np.ones(3), np.ones(3))) == 6.0
    assert same(2) == 2
    assert Record(np.ones((1, 3))).scaled(np.ones(1)).shape == (1, 3)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: product(np.ones(3), np.ones(4)),
        lambda: product(np.ones(3), np.ones(3, int)),
        lambda: product(np.ones(3), np.ones((3, 1))),
        lambda: product(np.ones(3), np.ones(3), unit="m"),
        lambda: total((np.ones(3), np.ones(4))),
        lambda: same(np.ones(3, complex)),
        lambda: Record(np.ones(3)),
        lambda: Record(taps=np.ones((2, 3), int)),
        lambda: Record(np.ones((1, 3))).scaled(np.ones((1, 1))),
    ],
    ids=["length", "dtype", "dimensions", "result", "in a tuple", "of a type variable", "field", "named", "method"],
)
def test_what_is_wrong_is_an_error(wrong) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(BeartypeCallHintViolation):
        wrong()


def test_without_arrays_nothing_is_wrapped() -> None:
    def plain(a: float, b: Path) -> str:
        return f"{a} {b}"

    assert check(plain) is plain


def test_the_first_calls_and_ever_fewer_later_ones_are_checked_in_each_test() -> None:
    def refused() -> bool:
        try:
            assert total((np.ones(3), np.ones(4))) == 7.0
        except BeartypeCallHintViolation:
            return True
        return False

    begin_test()
    checked = [number for number in range(1, 301) if refused()]
    assert checked == [*range(1, CALLS + 1), 16, 32, 64, 128, 256]
    begin_test()
    assert refused()


def test_a_function_that_is_made_anew_for_each_call_is_counted_as_one() -> None:
    def made(lengths: tuple[int, int]) -> bool:
        @check
        def inner(a: Float[np.ndarray, " n"], b: Float[np.ndarray, " n"]) -> bool:
            return True

        try:
            return not inner(*map(np.ones, lengths))
        except BeartypeCallHintViolation:
            return True

    begin_test()
    assert [made((3, 4)) for _ in range(CALLS + 1)] == [True] * CALLS + [False]


def test_the_modules_of_vestige_are_checked() -> None:
    with pytest.raises(BeartypeCallHintViolation):
        range_offset_m(np.ones((2, 3)), np.zeros(3, int), 1, np.arange(3.0))
