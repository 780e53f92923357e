"""Draw the output of the detecting correlator against time [WFO, Sec. VI-A, first figure]."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from vestige.plots.epochs import attribute, column, is_detected, is_missed, phase_rad, select, title_of
from vestige.plots.figure import (
    BLACK,
    BLUE,
    LEGEND,
    ORANGE,
    RED,
    SMALL_LETTERS_PT,
    dot_size_pt,
    dress,
    new_axes,
    time_label,
)

MAGNITUDE_SHARE = 0.66  # share of the height for flags and magnitude, below the phase
_BELOW = 0.06  # free space below the flags, as a share of the space for flags and magnitude
_DOTS: dict[str, Any] = {"marker": ".", "markeredgewidth": 0, "rasterized": True}
_FLAG_PT = 2.5  # size of the flags, so that a single miss in a long campaign is visible
_CURVE_EPOCHS = 20_000  # largest number of epochs that are drawn as a curve; more epochs are drawn as dots


def detecting_correlator(
    results: xarray.Dataset, *, detector: str = "early", svid: int | None = None, ax: Axes | None = None
) -> Axes:
    """Return axes with magnitude (orange), phase (blue, right axis) and detection (red dots at 1 or 0) against time.

    The phase is relative to the carrier phase of E1, which the receiver knows except for a constant. Results of older
    versions contain only the absolute phase. If nothing is detected, magnitude and phase are not defined and the curves
    have a gap. Flags and magnitude share the left axis. A magnitude lies above the threshold, so the flags lie below
    the magnitudes and do not cover any magnitude.

    The function raises `VestigeError` if a variable of the results is missing or invalid, or the results lack the
    detector or the satellite. The error is also raised if `svid` is None for several satellites.
    """
    shown = select(results, detector=detector, svid=svid)
    time_s, magnitude = column(shown, "time_s"), column(shown, "magnitude_sigma")
    flags = np.where(is_detected(shown), 1.0, np.where(is_missed(shown), 0.0, np.nan))
    threshold = attribute(shown, "threshold_sigma")
    ax = new_axes(height_cm=6.2) if ax is None else ax
    size = dot_size_pt(time_s.size)

    style = "-" if time_s.size <= _CURVE_EPOCHS else "none"
    ax.plot(time_s, magnitude, linestyle=style, color=ORANGE, linewidth=0.5, markersize=size, **_DOTS)
    ax.plot(time_s, flags, linestyle="none", color=RED, markersize=_FLAG_PT, **_DOTS)
    if threshold is not None:
        ax.axhline(threshold, color=BLACK, linewidth=0.6, linestyle="--")

    top = max(np.nanmax(magnitude, initial=0.0), 1.5 * (threshold or 0.0), 2.0)
    low, high = -_BELOW * top, top / MAGNITUDE_SHARE
    ax.set_ylim(low, high)
    ax.set_yticks([tick for tick in ax.get_yticks() if 0 <= tick <= top])
    dress(ax, title=title_of("Detecting correlator", shown), x=time_label(ax.xaxis, time_s), y="magnitude (σ)")
    ax.yaxis.label.set_y((top / 2 - low) / (high - low))
    phase, against = phase_rad(shown)
    _draw_phase(ax, time_s, phase, against, above=(top - low) / (high - low))
    _name_the_curves(ax, threshold)
    return ax


def _draw_phase(
    ax: Axes, time_s: Float[np.ndarray, " n"], phase: Float[np.ndarray, " n"], against: str, above: float
) -> None:
    """Draw the phase at the top of the axes, from the share `above` of the height on, with an axis on the right."""
    right = ax.twinx()
    size = dot_size_pt(time_s.size)
    right.plot(time_s, phase, linestyle="none", color=BLUE, markersize=size, **_DOTS)
    end = 1.15 * np.pi  # the factor 1.15 leaves a small distance to the frame and to the magnitude
    right.set_ylim(end - 2 * end / (1 - above), end)
    right.set_yticks([-np.pi, 0, np.pi], ["−π", "0", "π"])
    dress(right, title="", x="", y="phase (rad)")
    right.yaxis.label.set_y((1 + above) / 2)
    if against:
        paper = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 0.8}
        place: dict[str, Any] = {"transform": ax.transAxes, "va": "top", "bbox": paper}
        right.text(0.015, 0.985, against, fontsize=SMALL_LETTERS_PT, color=BLUE, **place)


def _name_the_curves(ax: Axes, threshold: float | None) -> None:
    """Set a legend below the axes, with dots that are larger than the dots in the axes of a long campaign."""
    dot: dict[str, Any] = {**_DOTS, "linestyle": "none", "markersize": 4.0}
    names = [
        Line2D([], [], color=ORANGE, linewidth=1.2, label="magnitude"),
        Line2D([], [], color=BLUE, label="phase", **dot),
        Line2D([], [], color=RED, label="detected 1, not 0", **dot),
    ]
    if threshold is not None:
        names.append(Line2D([], [], color=BLACK, linewidth=0.6, linestyle="--", label=f"threshold {threshold:.2f} σ"))
    place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.17), "frameon": False}
    ax.legend(handles=names, ncols=len(names), **place, **LEGEND)
