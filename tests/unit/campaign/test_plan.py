"""What a plan promises about its columns is checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from toy_plan import ToyPlan
from vestige.campaign.plan import Column, Coord, Plan, Preparation, check_results, shape_of

PLAN = ToyPlan(n_epochs=10)


def results(count: int) -> dict[str, np.ndarray]:
    return PLAN.measure(0, PLAN.prepare().advance(0, count))


def test_the_toy_is_a_plan() -> None:
    assert isinstance(PLAN, Plan)
    assert isinstance(PLAN.prepare(), Preparation)


def test_shapes() -> None:
    assert shape_of(PLAN, PLAN.columns["time_s"], 7) == (7,)
    assert shape_of(PLAN, PLAN.columns["taps"], 7) == (7, 2, 5)
    assert shape_of(PLAN, PLAN.columns["tap_index"], 7) == (2, 7, 2)


@pytest.mark.parametrize("dims", [("tap",), ("epoch", "epoch"), ("epoch", "ray")])
def test_dims_that_have_no_length(dims: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="dim"):
        shape_of(PLAN, Column(dims=dims, dtype="int8", units="1", long_name="none"), 7)


def test_coordinates_of_one_dim_that_differ_in_length() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Wrong(ToyPlan):
        @property
        def coords(self) -> Mapping[str, Coord]:
            return {**super().coords, "prn": Coord(dim="satellite", values=np.arange(3), units="1", long_name="PRN")}

    with pytest.raises(ValueError, match="satellite"):
        shape_of(Wrong(n_epochs=10), PLAN.columns["taps"], 7)


def test_results_as_promised() -> None:
    check_results(PLAN, results(4), 4)


@pytest.mark.parametrize(
    "change",
    [
        {"taps": results(4)["taps"].astype(np.complex128)},
        {"taps": results(3)["taps"]},
        {"more": np.zeros(4)},
        {"tap_index": results(4)["tap_index"].transpose(1, 0, 2)[:1]},
    ],
    ids=["dtype", "length", "unknown", "order of axes"],
)
def test_results_unlike_the_promise(change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="measure returned"):
        check_results(PLAN, results(4) | change, 4)


def test_a_column_that_is_missing() -> None:
    with pytest.raises(ValueError, match="time_s"):
        check_results(PLAN, {name: values for name, values in results(4).items() if name != "time_s"}, 4)
