"""A plan at once and in memory: for campaigns of some minutes, of which a table needs thousands."""

from __future__ import annotations

import xarray

from vestige.campaign.columns.measured_columns import Columns
from vestige.campaign.plan import Plan, judged


def direct_results(plan: Plan, *, judge: bool = True) -> xarray.Dataset:
    """Return the results of a plan as `run` does, without a store.

    Whoever judges at several levels does it later, and wants no columns of `Plan.judge`.
    """
    columns = plan.measure(0, plan.prepare().advance(0, plan.n_epochs))
    if judge:
        _, columns = judged(plan, None, 0, columns)
    return results_of(plan, columns)


def results_of(plan: Plan, columns: Columns) -> xarray.Dataset:
    """Return the columns of all epochs of a plan as its results."""
    return xarray.Dataset(
        {name: (column.dims, columns[name]) for name, column in plan.columns.items() if name in columns},
        coords={name: (coord.dim, coord.values) for name, coord in plan.coords.items()},
        attrs=dict(plan.attrs),
    )
