"""Draw the range offset against time [WFO, Sec. VI-A, fifth figure; Sec. VI-B, last two figures]."""

from __future__ import annotations

import numpy as np
import xarray
from matplotlib.axes import Axes

from vestige.plots.bank_edge import LIMIT_LINE, mark_bank_edge
from vestige.plots.epochs import column, is_missed, select, title_of
from vestige.plots.figure import BLACK, BLUE, RED, dot_size_pt, dress, legend, new_axes, time_label

_EMPTY_M = 15.0  # limit of the axis in m on both sides if nothing is detected
_TICKS_SHARE = 0.08  # height of the strip of missed epochs below the range offsets, as a share of the axes
_LEGEND_ROW_SHARE = 0.08  # height of a row of the legend above the range offsets, as a share of the axes


def range_offset(
    results: xarray.Dataset,
    *,
    detector: str = "early",
    svid: int | None = None,
    limit_m: float | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Return axes with a dot for each range offset (measured minus predicted E6 range) against time.

    An offset is positive if the signal arrives later than predicted. Epochs with a correlation but without a detection
    have no offset and are drawn as ticks in a strip below the offsets. A dashed line marks the edge of the bank of
    correlators if offsets come near this edge. A signal beyond the edge is measured near the edge, or is not detected.

    Parameters
    ----------
    limit_m
        Largest range offset in m that passes the range check. Dashed lines at plus and minus this limit are drawn if
        the magnitude of an offset is larger than half of the limit. If all offsets are smaller, the dashed lines would
        make the scale of the axis too coarse.

    Raises
    ------
    VestigeError
        If a variable of the results is missing or invalid, or the results lack the detector or the satellite. If `svid`
        is None for several satellites.
    """
    shown = select(results, detector=detector, svid=svid)
    time_s, offset_m, missed = column(shown, "time_s"), column(shown, "range_offset_m"), is_missed(shown)
    ax = new_axes() if ax is None else ax
    ax.axhline(0.0, color=BLACK, linewidth=0.5)
    ax.plot(
        time_s, offset_m, ".", color=BLUE, markersize=dot_size_pt(time_s.size), markeredgewidth=0,
        rasterized=True,
    )  # fmt: skip
    if limit_m is not None and np.nanmax(np.abs(offset_m), initial=0.0) > limit_m / 2:
        ax.axhline(-limit_m, **LIMIT_LINE)
        ax.axhline(limit_m, label=f"range check ±{limit_m:.1f} m", **LIMIT_LINE)
    mark_bank_edge(ax, shown, offset_m)
    if not np.isfinite(offset_m).any():
        ax.set_ylim(-_EMPTY_M, _EMPTY_M)
    if missed.any():
        low_m, high_m = ax.get_ylim()
        ax.set_ylim(low_m - _TICKS_SHARE * (high_m - low_m), high_m)
        ax.plot(
            time_s[missed], np.full(missed.sum(), 0.035), "|", color=RED, markersize=4, markeredgewidth=0.6,
            transform=ax.get_xaxis_transform(), label=f"not detected: {missed.sum()}", rasterized=True,
        )  # fmt: skip
    dress(ax, title=title_of("Range offset", shown), x=time_label(ax.xaxis, time_s), y="range offset (m)")
    rows = -(-len(ax.get_legend_handles_labels()[1]) // 2)
    low_m, high_m = ax.get_ylim()
    ax.set_ylim(low_m, high_m + rows * _LEGEND_ROW_SHARE * (high_m - low_m))
    legend(ax, "upper left", columns=2)
    return ax
