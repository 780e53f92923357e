"""Bins and counts of all histograms."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

_MOST_BINS = 600  # largest number of bins; at 8 cm a bin is then a pixel and a half


def bin_edges(values: Float[np.ndarray, " n"], *, border: float, width: float) -> Float[np.ndarray, " n_edges"]:
    """Return equidistant borders of bins, of which `border` is one, with a free bin on either side of the values.

    The width is doubled until at most 600 bins are needed.
    """
    low, high = min(values.min(initial=border), border), max(values.max(initial=border), border)
    while (high - low) / width > _MOST_BINS:
        width *= 2
    first, last = np.floor((low - border) / width) - 1, np.ceil((high - border) / width) + 1
    return np.asarray(border + np.arange(first, last + 1) * width, dtype=np.float64)


def width_of(edges: Float[np.ndarray, " n_edges"]) -> float:
    """Return the width of the bins, without rounding errors of their borders."""
    return float(f"{edges[1] - edges[0]:.6g}")


def log_counts(ax: Axes, highest: float) -> None:
    """Set the axis of counts to log scale, from half an event to a decade above the highest bar."""
    ax.set_ylim(0.5, 12 * max(highest, 1.0))  # the free decade is for the legend
    ax.set_yscale("log")
