"""Draw receiver operating characteristics (ROC) of searches, from theory with grid losses and from measurements."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int
from matplotlib.axes import Axes

from vestige.campaign.statistics import binomial_intervals
from vestige.plots.figure import BLUE, GREEN, ORANGE, PD_TEXT, PFA_TEXT, RED, dress, legend, new_axes

_COLOURS = (BLUE, RED, GREEN, ORANGE)

RocCurve = tuple[
    str, Float[np.ndarray, " n"], Float[np.ndarray, " n"], Float[np.ndarray, " m"], Int[np.ndarray, " m"], int
]


def roc_curves(curves: Sequence[RocCurve], *, title: str) -> Axes:
    """Draw P_d against the false-alarm probability of the whole search, and return the axes.

    Each curve has a name, the theoretical P_fa and P_d of the whole search, and P_fa, detections and trials of the
    measurement.
    """
    ax = new_axes()
    for colour, (name, pfa, pd, at, found, trials) in zip(_COLOURS, curves, strict=False):
        ax.plot(pfa, pd, color=colour, linewidth=0.8, label=name)
        share = found / trials
        low, high = binomial_intervals(found, trials)
        ax.errorbar(at, share, [share - low, high - share], fmt="o", color=colour, markersize=2, linewidth=0.6)
    ax.set_xscale("log")
    ax.set_ylim(0, 1)
    dress(ax, title=title, x=f"{PFA_TEXT} of the whole search", y=PD_TEXT)
    legend(ax, "lower right")
    return ax
