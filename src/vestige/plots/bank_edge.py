"""Mark the edge of the bank of correlators, beyond which a detector measures no range offset."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray
from jaxtyping import Float
from matplotlib.axes import Axes

from vestige.plots.epochs import column
from vestige.plots.figure import GREY

EDGE_LABEL = "edge of the bank"
# style of the lines that mark the limits of the range check
LIMIT_LINE: dict[str, Any] = {"color": "black", "linestyle": "--", "linewidth": 0.7}
_EDGE_LINE: dict[str, Any] = {"color": GREY, "linestyle": (0, (7, 3)), "linewidth": 0.9, "zorder": 1.5}
# A detector chooses a tap that is at least one detector spacing inside the edge. The range offset lies at most half a
# detector spacing from the chosen tap. So range offsets end half a tap inside the edge for a detector spacing of 1 tap.
# For a detector spacing of 2 taps, range offsets end 1 tap inside the edge.
_NEAR_TAPS = 1.0


def mark_bank_edge(
    ax: Axes, selected: xarray.Dataset, *shown_m: Float[np.ndarray, "..."], upright: bool = False
) -> Float[np.ndarray, " n_edges"]:
    """Draw a dashed line at each edge of the bank that a range offset in `shown_m` exceeds, or misses by up to a tap.

    The axis of the range offset is the ordinate, or the abscissa if `upright` is true. The lines may widen the limits
    of the axes. The function returns the range offsets of the lines in m.
    """
    taps_m = column(selected, "tap_offset_m")
    values_m = np.concatenate([one[np.isfinite(one)] for one in shown_m] or [np.zeros(0)])
    if taps_m.size < 2 or not values_m.size:
        return np.zeros(0)
    near_m = _NEAR_TAPS * float(taps_m[1] - taps_m[0])
    first, last = values_m.min() <= taps_m[0] + near_m, values_m.max() >= taps_m[-1] - near_m
    edges_m = taps_m[[0, -1]][[first, last]]
    for edge_m, label in zip(edges_m, (EDGE_LABEL, ""), strict=False):
        (ax.axvline if upright else ax.axhline)(edge_m, label=label, **_EDGE_LINE)
    return edges_m
