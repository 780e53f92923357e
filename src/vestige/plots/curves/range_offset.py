"""The range offset against time [WFO, Sec. VI-A, fifth figure; Sec. VI-B, last two]."""

from __future__ import annotations

import numpy as np
import xarray
from matplotlib.axes import Axes

from vestige.plots.epochs import column, is_missed, select, title_of
from vestige.plots.figure import BLACK, BLUE, RED, dot_size_pt, dress, legend, new_axes, time_label

_EMPTY_M = 15.0  # limit of the axis if nothing is detected


def range_offset(
    results: xarray.Dataset, *, detector: str = "early", svid: int | None = None, ax: Axes | None = None
) -> Axes:
    """Return axes with measured minus predicted E6 range against time, a dot for each epoch; positive is later.

    Epochs in which nothing is detected have no offset, and are drawn as ticks at the lower edge.

    Raises `VestigeError` if the results lack the detector or the satellite.
    """
    shown = select(results, detector=detector, svid=svid)
    time_s, offset_m, missed = column(shown, "time_s"), column(shown, "range_offset_m"), is_missed(shown)
    ax = new_axes() if ax is None else ax
    ax.axhline(0.0, color=BLACK, linewidth=0.5)
    ax.plot(
        time_s, offset_m, ".", color=BLUE, markersize=dot_size_pt(time_s.size), markeredgewidth=0,
        rasterized=True,
    )  # fmt: skip
    if missed.any():
        ax.plot(
            time_s[missed], np.full(missed.sum(), 0.025), "|", color=RED, markersize=4, markeredgewidth=0.6,
            transform=ax.get_xaxis_transform(), label=f"not detected: {missed.sum()}", rasterized=True,
        )  # fmt: skip
    if not np.isfinite(offset_m).any():
        ax.set_ylim(-_EMPTY_M, _EMPTY_M)
    dress(ax, title=title_of("Range offset", shown), x=time_label(ax.xaxis, time_s), y="range offset (m)")
    legend(ax)
    return ax
