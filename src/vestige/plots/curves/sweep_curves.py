"""Choose the abscissa of a sweep, and divide the rows of the sweep into curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray
from jaxtyping import Float, Int

from vestige.errors import VestigeError
from vestige.plots.figure import BLACK, BLUE, GREEN, GREY, ORANGE, RED

COLOURS = (BLUE, RED, GREEN, ORANGE, GREY, BLACK)
KEY = "key "  # prefix of the names of variables that contain the values of a key of the scenario as text
CN0 = "C/N0 (dBHz)"
_CN0_KEY = "receiver.cn0_dbhz"


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepCurve:
    """Rows of a sweep with the same values of all keys that are not the abscissa."""

    label: str  # values of the keys that are not the abscissa; empty if there is only one curve
    rows: Int[np.ndarray, " n"]  # numbers of the rows, ascending in the abscissa


def abscissa(sweep: xarray.Dataset) -> tuple[str, Float[np.ndarray, " n"]]:
    """Return label and values of a sweep's abscissa: C/N0, or the first varied numeric key if C/N0 is constant.

    A key whose values are not numbers separates curves (see `curves`).
    """
    cn0_dbhz = np.atleast_1d(sweep["cn0_dbhz"].values).astype(np.float64)
    if np.unique(cn0_dbhz).size == 1:
        for name in _varied(sweep):
            try:
                values = sweep[name].values.astype(np.float64)
            except ValueError:
                continue
            if np.isfinite(values).all():
                return name.removeprefix(KEY), values
    return CN0, cn0_dbhz


def curves(sweep: xarray.Dataset) -> tuple[SweepCurve, ...]:
    """Return the curves of a sweep, a curve for each combination of values of the keys that are not the abscissa.

    The function raises `VestigeError` if there are more curves than colours.
    """
    label, values = abscissa(sweep)
    order = np.argsort(values, kind="stable")
    others = [name for name in _varied(sweep) if name.removeprefix(KEY) not in (label, _CN0_KEY)]
    short = [name.rpartition(".")[2].removeprefix(KEY) for name in others]
    rows: dict[tuple[str, ...], list[int]] = {}
    for row in range(values.size):
        rows.setdefault(tuple(str(sweep[name].values[row]) for name in others), [])
    for row in order:
        rows[tuple(str(sweep[name].values[row]) for name in others)].append(int(row))
    if len(rows) > len(COLOURS):
        names = ", ".join(name.removeprefix(KEY) for name in others)
        raise VestigeError(f"sweep: found {len(rows)} combinations of {names}, expected at most {len(COLOURS)} curves")
    return tuple(
        SweepCurve(
            label=", ".join(f"{name} = {value}" for name, value in zip(short, combination, strict=True)),
            rows=np.array(members, dtype=np.int64),
        )
        for combination, members in rows.items()
    )


def _varied(sweep: xarray.Dataset) -> list[str]:
    names = [str(name) for name in sweep.variables if str(name).startswith(KEY)]
    return [name for name in names if len(set(sweep[name].values.tolist())) > 1]
