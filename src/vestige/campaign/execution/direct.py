"""Run a short campaign in memory and without chunks. A threat table needs thousands of short campaigns."""

from __future__ import annotations

import xarray

from vestige.campaign.columns.measured_columns import Columns
from vestige.campaign.plan import Plan, judged


def direct_results(plan: Plan, *, judge: bool = True) -> xarray.Dataset:
    """Return the results of a plan without a store, with the same values as the results of `run`.

    With `judge=False`, the results have no columns of `JudgedPlan.judge`. Verdicts at several levels can be made from
    these results later.
    """
    columns = plan.measure(0, plan.prepare().advance(0, plan.n_epochs))
    if judge:
        _, columns = judged(plan, None, 0, columns)
    return results_of(plan, columns)


def results_of(plan: Plan, columns: Columns) -> xarray.Dataset:
    """Return the results of a plan as a dataset, from the columns of all epochs."""
    return xarray.Dataset(
        {name: (column.dims, columns[name]) for name, column in plan.columns.items() if name in columns},
        coords={name: (coord.dim, coord.values) for name, coord in plan.coords.items()},
        attrs=dict(plan.attrs),
    )
