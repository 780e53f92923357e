"""Draw the decision regions of power and distortion, with the measurements of a receiver [WESSON18]."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from jaxtyping import Bool, Float, Int8
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vestige.plots.figure import BLACK, BLUE, GREEN, LEGEND, ORANGE, RED, dot_size_pt, dress, figure_of, new_axes
from vestige.records.checks import SignalClass

_LIGHT = 0.35  # opacity of the colours, so that dots are visible on them
CLASS_COLOURS = {
    SignalClass.CLEAN: GREEN,
    SignalClass.MULTIPATH: BLUE,
    SignalClass.SPOOFED: RED,
    SignalClass.JAMMED: ORANGE,
}


class Regions(Protocol):
    """Decision regions of the processor's power–distortion check."""

    @property
    def power_edges_db(self) -> Float[np.ndarray, " k"]:
        """Edges of the cells along the rise of the power in dB."""

    @property
    def distortion_edges(self) -> Float[np.ndarray, " l"]:
        """Edges of the cells along the distortion, in standard deviations."""

    @property
    def classes(self) -> Int8[np.ndarray, "a b"]:
        """`SignalClass` of each cell."""


def decision_map(
    regions: Regions,
    *,
    title: str,
    power_db: Float[np.ndarray, " n"] | None = None,
    distortion: Float[np.ndarray, " n"] | None = None,
    attacked: Bool[np.ndarray, " n"] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the map with power to the right, distortion upwards and a colour for each class, and return the axes.

    Measurements are drawn as dots, or as crosses under attack. Measurements beyond the map are drawn at the edge of the
    map, and belong to the class at the edge.
    """
    ax = new_axes() if ax is None else ax
    x, y = regions.power_edges_db, np.log10(1 + regions.distortion_edges)
    colours = ListedColormap([CLASS_COLOURS[one] for one in SignalClass])
    ax.pcolormesh(x, y, regions.classes.T, cmap=colours, vmin=-0.5, vmax=3.5, alpha=_LIGHT, rasterized=True)
    handles: list[Patch | Line2D] = [
        Patch(color=CLASS_COLOURS[one], alpha=_LIGHT, label=one.name.lower()) for one in SignalClass
    ]
    if power_db is not None and distortion is not None:
        known = np.isfinite(power_db) & np.isfinite(distortion)
        hit = np.zeros(known.size, bool) if attacked is None else attacked
        right, upwards = np.clip(power_db, x[0], x[-1]), np.clip(np.log10(1 + np.where(known, distortion, 0)), 0, y[-1])
        for rows, mark, size, text in ((known & ~hit, ".", 1.0, "without attack"), (known & hit, "x", 1.2, "attacked")):
            if rows.any():
                points = int(np.count_nonzero(rows))
                look: dict[str, Any] = {
                    "color": BLACK,
                    "linestyle": "",
                    "markersize": size * dot_size_pt(points),
                    "rasterized": True,
                }
                handles += ax.plot(right[rows], upwards[rows], mark, markeredgewidth=0.4, label=text, **look)
    ticks = np.array([0, 1, 3, 10, 30, 100, 300, 1000])
    ax.set_yticks(np.log10(1 + ticks), [str(one) for one in ticks])
    ax.set_xlim(x[0], x[-1])
    ax.set_ylim(y[0], y[-1])
    dress(ax, title=title, x="rise of the power (dB)", y="distortion (σ)")
    figure_of(ax).legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, **LEGEND)
    return ax
