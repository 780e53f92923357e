"""Draw the correlation function against time as a surface and as a colour map [WFO, Sec. VI-A, second figure]."""

from __future__ import annotations

from itertools import count
from typing import Any

import numpy as np
import xarray
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import MaxNLocator, MultipleLocator

from vestige.plots.epochs import column, magnitudes_sigma, select, thinned, title_of
from vestige.plots.figure import COLOUR_MAP, LETTERS_PT, dress, figure_of, new_axes, time_label

LABELLED_TAPS = 8  # largest number of labels along the bank that do not overlap
SLICES = 90  # largest number of epochs that remain distinguishable in a surface 8 cm wide
MAP_COLUMNS = 1600  # largest number of epochs in a map, about two epochs for each pixel
_BOX = (4.0, 4.6, 2.6)  # relative lengths of the axes of tap offset, time and magnitude
_VIEW = {"elev": 44.0, "azim": -66.0}  # direction of view in °, in which time increases away from the viewer


def waterfall(results: xarray.Dataset, *, svid: int | None = None, ax: Axes | None = None) -> Axes:
    """Return axes with the magnitude of every tap as a surface over tap offset and time.

    The campaign begins at the front of the surface. If any epoch has a RECS, only epochs with RECS are drawn. In a long
    campaign only every k-th epoch with RECS is drawn, without averaging. An epoch with RECS but without a correlation
    is a gap.

    `ax` must have the projection `3d`.

    Raises
    ------
    VestigeError
        If a variable of the results is missing or invalid, or the results lack the satellite. If `svid` is None for
        several satellites.
    ValueError
        If `ax` does not have the projection `3d`.
    """
    shown = _thin(select(results, svid=svid), SLICES)
    offsets_m, time_s, magnitude = column(shown, "tap_offset_m"), column(shown, "time_s"), magnitudes_sigma(shown)
    space: Any = new_axes(height_cm=6.2, projection="3d") if ax is None else ax
    if not hasattr(space, "plot_surface"):
        raise ValueError("a waterfall needs axes with the projection 3d")
    space.plot_surface(
        offsets_m[None, :] + 0 * time_s[:, None], time_s[:, None] + 0 * offsets_m[None, :], magnitude,
        rstride=1, cstride=1, cmap=COLOUR_MAP, linewidth=0.15, edgecolor="#00000060", antialiased=True,
    )  # fmt: skip
    space.view_init(**_VIEW)
    space.set_box_aspect(_BOX, zoom=0.9)  # space for the labels, which the layout ignores
    title, time = title_of("Correlators", shown, with_detector=False), time_label(space.yaxis, time_s)
    dress(space, title=title, x="offset (m)", y=time)
    space.set_zlabel("magnitude (σ)", fontsize=LETTERS_PT)
    for axis, label_pt in ((space.xaxis, -6), (space.yaxis, -3), (space.zaxis, -8)):
        axis.labelpad = label_pt
        axis.set_tick_params(pad=-3)
    _ticks_at_taps(space.xaxis, offsets_m)
    space.yaxis.set_major_locator(MaxNLocator(5))
    space.zaxis.set_major_locator(MaxNLocator(4))
    return space


def waterfall_map(results: xarray.Dataset, *, svid: int | None = None, ax: Axes | None = None) -> Axes:
    """Return axes with the magnitude of every tap as colours over time and tap offset.

    If any epoch has a RECS, only epochs with RECS are drawn. The colour of an epoch reaches halfway to the neighbouring
    drawn epochs. In a long campaign only every k-th epoch with RECS is drawn, without averaging. An epoch with RECS but
    without a correlation is white.

    The function raises `VestigeError` if a variable of the results is missing or invalid, or the results lack the
    satellite. The error is also raised if `svid` is None for several satellites.
    """
    shown = _thin(select(results, svid=svid), MAP_COLUMNS)
    ax = new_axes() if ax is None else ax
    offsets_m, time_s = column(shown, "tap_offset_m"), column(shown, "time_s")
    mesh = ax.pcolormesh(
        _edges(time_s), _edges(offsets_m), magnitudes_sigma(shown).T,
        cmap=COLOUR_MAP, vmin=0, rasterized=True,
    )  # fmt: skip
    title, time = title_of("Correlators", shown, with_detector=False), time_label(ax.xaxis, time_s)
    dress(ax, title=title, x=time, y="correlator offset (m)")
    _ticks_at_taps(ax.yaxis, offsets_m)
    bar = figure_of(ax).colorbar(mesh, ax=ax, pad=0.02, aspect=25)
    dress(bar.ax, title="", x="", y="magnitude (σ)")
    return ax


def _ticks_at_taps(axis: Axis, offsets_m: Float[np.ndarray, " n"]) -> None:
    """Set ticks at the prediction and at every second tap, or at every 5th, 10th, 20th ... tap of a long bank."""
    if offsets_m.size < 2:
        return
    steps = (factor * 10**power for power in count() for factor in (2, 5, 10))
    step = next(step for step in steps if offsets_m.size <= step * LABELLED_TAPS)
    axis.set_major_locator(MultipleLocator(step * float(offsets_m[1] - offsets_m[0])))


def _thin(shown: xarray.Dataset, limit: int) -> xarray.Dataset:
    """Return the epochs with RECS, or every k-th epoch with RECS if there are more than `limit` epochs with RECS.

    If no epoch has a RECS, the function chooses among all epochs.
    """
    if "recs" in shown.variables and (with_recs := np.flatnonzero(shown["recs"].values)).size:
        shown = shown.isel(epoch=with_recs)
    return shown.isel(epoch=thinned(shown.sizes["epoch"], limit))


def _edges(centres: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n+1"]:
    """Return the borders of cells around `centres`, halfway between neighbours.

    An outermost centre is in the middle of its cell.
    """
    if centres.size < 2:
        return np.array([centres[0] - 0.5, centres[0] + 0.5])
    middle = (centres[1:] + centres[:-1]) / 2
    return np.concatenate([[2 * centres[0] - middle[0]], middle, [2 * centres[-1] - middle[-1]]])
