"""Draw the detection rate of checks against the strength of an attack, with confidence intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from vestige.campaign.statistics import Proportion
from vestige.plots.curves.sweep_curves import COLOURS
from vestige.plots.figure import dress, legend, new_axes

_APART = 0.006  # distance between the curves as a share of the range of the strengths


def check_curves(
    strength: Sequence[float],
    seen: Mapping[str, Sequence[Proportion]],
    *,
    title: str,
    label: str,
    log: bool = False,
    ax: Axes | None = None,
) -> Axes:
    """Draw, against the strength of an attack, the share of runs in which each check failed, and return the axes.

    The strengths ascend. `seen` gives for each check, at each strength, the share of runs in which the check failed,
    with its confidence interval. `label` is the label of the axis of strengths. The axis of strengths is logarithmic if
    `log` is true.
    """
    ax = new_axes() if ax is None else ax
    x = np.log(strength) if log else np.array(strength, dtype=np.float64)
    step = _APART * float(np.ptp(x))
    for number, ((name, points), colour) in enumerate(zip(seen.items(), COLOURS, strict=False)):
        beside = x + step * (number - (len(seen) - 1) / 2)
        beside = np.exp(beside) if log else beside
        ax.vlines(beside, [one.low for one in points], [one.high for one in points], color=colour, linewidth=0.8)
        ax.plot(beside, [one.value for one in points], "o-", color=colour, markersize=2.5, linewidth=0.8, label=name)
    if log:
        ax.set_xscale("log")
    ax.set_ylim(-0.03, 1.03)
    dress(ax, title=title, x=label, y="share of runs that fail")
    legend(ax)
    return ax
