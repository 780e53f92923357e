"""Plan of a campaign: its epochs, and the two halves of its work.

Epoch i of a plan is one snapshot of a simulated receiver. Some parts of it have memory (the clock walks, multipath
persists, the ionosphere drifts) and are cheap; the rest (signals, noise, correlators, detection) is a pure function of
that epoch and is heavy. So a plan has two halves:

* `prepare()` returns an object that runs through the epochs in order. `advance(first, count)` gives the inputs of the
  next `count` epochs as arrays and carries the state along. It runs in the coordinating process only.
* `measure(first, inputs)` turns inputs into columns. It runs on any thread, process or machine, in any order.
* `judge(state, first, columns)`, if a plan has it, adds the columns of conclusions that depend on the order of time: a
  receiver's verdicts depend on earlier ones. It runs in the coordinating process, chunk after chunk, from `state` None
  on.

Laws, on which resuming and running in parallel rest:

1. `advance` is called with the epochs in order, from 0, without a gap: `advance(0, a)`, `advance(a, b)`, … What it
   gives for an epoch must not depend on the cut: advancing in pieces equals advancing at once, bit for bit. A resumed
   campaign calls `prepare()` anew and runs through all epochs before the last one that is missing, so `advance` should
   cost much less than `measure`.
2. `measure` depends on nothing but the plan, `first` and `inputs`, and its result for an epoch must not depend on the
   cut either. Randomness comes from streams that are named by the epoch, never from a generator that is carried along.
   It may be called by several threads at once, and twice for the same epochs.
3. `measure` returns every column of the plan but those that `judge` adds, truth that it passes on from the inputs
   included, with the exact dtype and shape: the column's dims with `epoch` as long as the inputs. Anything else is a
   `ValueError`. `judge` gives the same state and the same columns for those of `measure` and for all of them: a resumed
   campaign judges the chunks that it has stored anew, to carry the state on. The cut changes nothing here either.
4. The plan, the inputs and the results can be pickled, and are small then: the plan travels with every chunk, so what
   can be derived from it (replicas, tables) is derived in the worker, behind a cache of its own.
5. Two plans with equal `attrs` give equal results. That is how a store knows whether it may be resumed, so `attrs` hold
   the scenario, its digest and the seed; the store adds version and source of vestige. If the bits depend on the kind
   of processor, `attrs` name it as `processor`.

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

EPOCH = "epoch"  # the dimension along which a campaign is cut
CHUNK_EPOCHS = 2000  # large against the cost of a chunk (some 40 small files), small against a run


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One variable of the results."""

    # names of its axes in order. `epoch` is one of them, anywhere; each of the others is the dim of a `Coord`.
    dims: tuple[str, ...]
    dtype: str  # a numpy dtype by name, e.g. `float32`, `complex64`, `int8`.
    units: str  # in the words of UDUNITS: `m`, `m s-1`, `Hz`, `rad`, `1`
    long_name: str  # what it is, for the axis of a plot
    # further attributes, e.g. `flag_values` and `flag_meanings`.
    attrs: Mapping[str, Any] = field(default_factory=dict)


def column_table(
    *rows: tuple[str, tuple[str, ...], str, str, str], attrs: Mapping[str, Mapping[str, Any]] | None = None
) -> dict[str, Column]:
    """Return columns from rows of name, dims, dtype, units and meaning; some have attributes."""
    more = attrs or {}
    return {
        name: Column(dims=dims, dtype=dtype, units=units, long_name=text, attrs=more.get(name, {}))
        for name, dims, dtype, units, text in rows
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Coord:
    """Labels along one axis other than `epoch`; a coordinate with the name of its dim is the axis' index."""

    dim: str  # the axis
    values: np.ndarray  # one number or text for each place on it
    long_name: str
    units: str = "1"


@runtime_checkable
class Preparation(Protocol):
    """The sequential half: what has memory, epoch after epoch."""

    def advance(self, first: int, count: int) -> Mapping[str, Any]:
        """Return the inputs of epochs first … first + count − 1 (arrays by name), which are the next ones."""


@runtime_checkable
class Plan(Protocol):
    """The work of a campaign; the laws that it must keep stand at the top of this module."""

    @property
    def n_epochs(self) -> int:
        """Number of epochs; at least 1."""

    @property
    def columns(self) -> Mapping[str, Column]:
        """The variables that `measure` returns."""

    @property
    def coords(self) -> Mapping[str, Coord]:
        """The axes other than `epoch`; each one needs at least one coordinate."""

    @property
    def attrs(self) -> Mapping[str, Any]:
        """Identity of the work: text, whole and finite numbers, and lists of them."""

    def prepare(self) -> Preparation:
        """Return the sequential half at its beginning."""

    def measure(self, first: int, inputs: Mapping[str, Any]) -> Mapping[str, np.ndarray]:
        """Return every column for the epochs from `first` on to which `inputs` belong."""


@runtime_checkable
class JudgedPlan(Plan, Protocol):
    """A plan with memory in its conclusions."""

    def judge(self, state: Any, first: int, columns: Mapping[str, np.ndarray]) -> tuple[Any, Mapping[str, np.ndarray]]:
        """Return the state after the epochs from `first` on, and all their columns."""


def judged(
    plan: Plan, state: Any, first: int, columns: Mapping[str, np.ndarray]
) -> tuple[Any, Mapping[str, np.ndarray]]:
    """Return the state after some epochs, and all their columns; as they are if the plan concludes nothing."""
    return plan.judge(state, first, columns) if isinstance(plan, JudgedPlan) else (None, columns)


def shape_of(plan: Plan, column: Column, n_epochs: int) -> tuple[int, ...]:
    """Return the shape of a column over `n_epochs` epochs.

    Raises `ValueError` if the column has no `epoch`, a dim without coordinate, or a dim whose coordinates differ in
    length.
    """
    if column.dims.count(EPOCH) != 1:
        raise ValueError(f"a column needs the dim {EPOCH} once, not {column.dims}")
    return tuple(n_epochs if dim == EPOCH else _length(plan, dim) for dim in column.dims)


def check_results(plan: Plan, results: Mapping[str, np.ndarray], n_epochs: int) -> None:
    """Return nothing if a plan's results for `n_epochs` epochs are what its columns promise.

    Raises `ValueError` if a column is missing, unknown, or of another dtype or shape.
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
