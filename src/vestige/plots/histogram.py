"""Compute the bins of histograms, and scale the axis of counts."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

_LOWEST = 0.5  # lower end of the axis of counts, in events
_LEAST_FREE_DECADES = 1.08  # least free space above the highest bar in decades
_ROW_SHARE = 0.08  # height of a row of the legend as a share of the axes
_MOST_BINS = 600  # largest number of bins, each 1.5 pixels wide in a figure of 8 cm


def bin_edges(values: Float[np.ndarray, " n"], *, border: float, width: float) -> Float[np.ndarray, " n_edges"]:
    """Return equidistant borders of bins, with an empty bin on either side of the values.

    A border of two bins lies at `border`. The width of the bins is doubled until the values span at most 600 widths.
    """
    low, high = min(values.min(initial=border), border), max(values.max(initial=border), border)
    while (high - low) / width > _MOST_BINS:
        width *= 2
    first, last = np.floor((low - border) / width) - 1, np.ceil((high - border) / width) + 1
    return np.asarray(border + np.arange(first, last + 1) * width, dtype=np.float64)


def width_of(edges: Float[np.ndarray, " n_edges"]) -> float:
    """Return the width of the bins, without the rounding errors of the borders."""
    return float(f"{edges[1] - edges[0]:.6g}")


def log_counts(ax: Axes, highest: float, rows: int = 2) -> None:
    """Set the axis of counts to log scale, with free space above the highest bar for the `rows` of a legend."""
    bars_decades = np.log10(max(highest, 1.0) / _LOWEST)
    free_share = max(1 - bars_decades / (bars_decades + _LEAST_FREE_DECADES), _ROW_SHARE * rows)
    ax.set_ylim(_LOWEST, _LOWEST * 10 ** (bars_decades / (1 - free_share)))
    ax.set_yscale("log")
