"""Define the plan of a campaign: its epochs, and the sequential and parallel parts of its work.

Epoch i of a plan is one snapshot of a simulated receiver. The state of the simulation (clock, multipath, ionosphere)
has memory and is cheap to compute. The computation of signals, noise, correlators and detection is expensive, but needs
no results of other epochs. A plan therefore has two parts, and may have a third part:

* `prepare()` returns an object that runs through the epochs in order. The method `advance(first, count)` of this object
  returns the inputs of the next `count` epochs and keeps the state. Only the coordinating process calls `advance`.
* `measure(first, inputs)` turns inputs into columns. Any thread, process or machine may call `measure`, in any order.
* `judge(state, first, columns)` is optional. The method adds the columns that depend on the order of time, such as a
  receiver's verdicts. The coordinating process calls `judge` chunk after chunk; the first `state` is None.

The following rules make it possible to resume a campaign and to run a campaign in parallel:

1. `advance` is called with the epochs in order, from 0, without a gap: `advance(0, a)`, `advance(a, b)`, … The bits of
   the inputs of an epoch must not depend on how the epochs are divided into calls. A resumed campaign calls `prepare()`
   again and runs through all epochs before the last missing epoch. `advance` should therefore cost much less than
   `measure`.
2. `measure` depends only on the plan, `first` and `inputs`. The columns of an epoch must not depend on how the epochs
   are divided into calls. Random numbers come from streams that are named by the epoch, never from a generator that
   keeps its state between epochs. Several threads may call `measure` at once, and `measure` may be called twice for the
   same epochs.
3. `measure` returns every column of the plan except the columns of `judge`. The columns include the truth from the
   inputs. Each column has exactly the dtype of the plan, and the shape that follows from the column's dims. Any
   difference raises `ValueError`.
4. `judge` returns the same state and columns whether `columns` has only the columns of `measure`, or all columns. A
   resumed campaign calls `judge` again for stored chunks to get the state for later chunks. The result must not depend
   on how the epochs are divided into calls.
5. The plan, the inputs and the results can be pickled. The pickle of the plan is small, because the plan is sent with
   every chunk. Data that can be derived from the plan (replicas, tables) are derived and cached in the worker.
6. Two plans with equal `attrs` give equal results. A store compares `attrs` to decide whether it may be resumed. The
   `attrs` of a `ScenarioPlan` contain the scenario, its digest and the seed. The store adds version and source of
   vestige. If the bits depend on the kind of CPU, `attrs` contain the kind of CPU as `processor`.

    @dataclass(frozen=True, kw_only=True)
    class Coins:
        n_epochs: int
        seed: int
        columns = {"heads": Column(dims=("epoch", "coin"), dtype="bool", units="1", long_name="heads up")}
        coords = {"coin": Coord(dim="coin", values=np.arange(3), units="1", long_name="number of the coin")}

        @property
        def attrs(self):
            return {"seed": self.seed}

        def prepare(self):
            return self                                    # no memory

        def advance(self, first, count):
            return {"epoch": np.arange(first, first + count)}

        def measure(self, first, inputs):
            draws = [stream(self.seed, "coin", int(epoch)).random(3) for epoch in inputs["epoch"]]
            return {"heads": np.array(draws) < 0.5}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np

EPOCH = "epoch"  # the dimension along which a campaign is divided into chunks
CHUNK_EPOCHS = 2000  # number of epochs in a chunk; large, because each chunk makes about 40 small files


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """Variable of the results: axes, type, unit and description."""

    # names of the axes in order; `epoch` may be at any position, and every other axis is the dim of a `Coord`
    dims: tuple[str, ...]
    dtype: str  # name of a numpy dtype, e.g. `float32`, `complex64`, `int8`
    units: str  # UDUNITS spelling: `m`, `m s-1`, `Hz`, `rad`, `1`
    long_name: str  # description for the axis of a plot
    # further attributes, e.g. `flag_values` and `flag_meanings`
    attrs: Mapping[str, Any] = field(default_factory=dict)


def column_table(
    *rows: tuple[str, tuple[str, ...], str, str, str], attrs: Mapping[str, Mapping[str, Any]] | None = None
) -> dict[str, Column]:
    """Return columns from rows of name, dims, dtype, units and meaning; `attrs` has more attributes by column name."""
    more = attrs or {}
    return {
        name: Column(dims=dims, dtype=dtype, units=units, long_name=text, attrs=more.get(name, {}))
        for name, dims, dtype, units, text in rows
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Coord:
    """Coordinates of an axis other than `epoch`; a coordinate with the name of its dim is the index of the axis."""

    dim: str  # name of the axis
    values: np.ndarray  # one number or text for each position on the axis
    long_name: str
    units: str = "1"


@runtime_checkable
class Preparation(Protocol):
    """Sequential part of a plan: the state of the simulation, epoch after epoch."""

    def advance(self, first: int, count: int) -> Mapping[str, Any]:
        """Return the inputs of the next epochs, from `first` to `first + count − 1`, by name."""


@runtime_checkable
class Plan(Protocol):
    """Protocol of a plan: the work of a campaign. Each plan must follow the rules in the docstring of this module."""

    @property
    def n_epochs(self) -> int:
        """Number of epochs; at least 1."""

    @property
    def columns(self) -> Mapping[str, Column]:
        """Variables of the results, by name."""

    @property
    def coords(self) -> Mapping[str, Coord]:
        """Coordinates by name; each axis other than `epoch` needs at least one coordinate."""

    @property
    def attrs(self) -> Mapping[str, Any]:
        """Attributes that identify the work; values are texts, booleans, finite numbers, or lists of such values."""

    def prepare(self) -> Preparation:
        """Return the sequential part of the plan before its first epoch."""

    def measure(self, first: int, inputs: Mapping[str, Any]) -> Mapping[str, np.ndarray]:
        """Return all columns except the columns of `judge` for the epochs of `inputs`, which begin at `first`."""


@runtime_checkable
class JudgedPlan(Plan, Protocol):
    """Protocol of a plan with verdicts that depend on earlier epochs."""

    def judge(self, state: Any, first: int, columns: Mapping[str, np.ndarray]) -> tuple[Any, Mapping[str, np.ndarray]]:
        """Return the state after the epochs of `columns`, which begin at `first`, and all columns of these epochs."""


def judged(
    plan: Plan, state: Any, first: int, columns: Mapping[str, np.ndarray]
) -> tuple[Any, Mapping[str, np.ndarray]]:
    """Return the state after the epochs of `columns`, and all columns; a plan without `judge` adds no columns."""
    return plan.judge(state, first, columns) if isinstance(plan, JudgedPlan) else (None, columns)


def shape_of(plan: Plan, column: Column, n_epochs: int) -> tuple[int, ...]:
    """Return the shape of a column over `n_epochs` epochs.

    `ValueError` is raised if the column does not have the dim `epoch` exactly once. A dim without coordinate, or with
    coordinates of different lengths, also raises `ValueError`.
    """
    if column.dims.count(EPOCH) != 1:
        raise ValueError(f"a column needs the dim {EPOCH} once, not {column.dims}")
    return tuple(n_epochs if dim == EPOCH else _length(plan, dim) for dim in column.dims)


def check_results(plan: Plan, results: Mapping[str, np.ndarray], n_epochs: int) -> None:
    """Check that a plan's results for `n_epochs` epochs have the columns, dtypes and shapes of the plan.

    `ValueError` is raised if a column is missing, is unknown, or has another dtype or shape.
    """
    if set(results) != set(plan.columns):
        raise ValueError(f"measure returned {sorted(results)}, the plan's columns are {sorted(plan.columns)}")
    for name, column in plan.columns.items():
        found = (str(results[name].dtype), results[name].shape)
        expected = (column.dtype, shape_of(plan, column, n_epochs))
        if found != expected:
            raise ValueError(f"measure returned {name} as {found}, the plan says {expected}")


def _length(plan: Plan, dim: str) -> int:
    lengths = {len(coord.values) for coord in plan.coords.values() if coord.dim == dim}
    if len(lengths) != 1:
        raise ValueError(f"dim {dim} needs coordinates of one length, found lengths {sorted(lengths)}")
    return lengths.pop()
