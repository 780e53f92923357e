"""Figures of a sky: where the satellites are, where the fix is, when the checks failed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray
from jaxtyping import Bool, Float
from matplotlib.axes import Axes

from vestige.errors import VestigeError
from vestige.plots.figure import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LETTERS_PT,
    ORANGE,
    RED,
    SMALL_LETTERS_PT,
    dress,
    legend,
    new_axes,
    time_label,
)

_AXES = (("east", BLUE), ("north", ORANGE), ("up", GREEN))


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorLine:
    """One check over time: whether it was run, and whether it failed for any satellite."""

    name: str
    run: Bool[np.ndarray, " n"]
    failed: Bool[np.ndarray, " n"]


def sky_plot(results: xarray.Dataset, ax: Axes | None = None) -> Axes:
    """Return the axes of a sky plot: zenith in the middle, north up; a dot where each satellite is last.

    Raises
    ------
    VestigeError
        If the results are not those of a sky.
    """
    _check(results, "elevation_deg", "azimuth_deg")
    ax = new_axes(width_cm=8.0, height_cm=8.0, projection="polar") if ax is None else ax
    ax.set_theta_zero_location("N")  # type: ignore[attr-defined]
    ax.set_theta_direction(-1)  # type: ignore[attr-defined]
    for column, svid in enumerate(results["svid"].values.tolist()):
        one = results.isel(satellite=column)
        away_deg = 90 - one["elevation_deg"].values
        azimuth = np.radians(one["azimuth_deg"].values)
        seen = np.flatnonzero(np.isfinite(away_deg))
        if not seen.size:
            continue
        ax.plot(azimuth, away_deg, color=BLUE, linewidth=1.0)
        last = seen[-1]
        ax.plot(azimuth[last], away_deg[last], "o", color=RED, markersize=3)
        ax.annotate(
            f"E{svid:02d}",
            (azimuth[last], away_deg[last]),
            xytext=(3, 3),
            textcoords="offset points",
            fontsize=SMALL_LETTERS_PT,
        )
    ax.set_rlim(0, 90)  # type: ignore[attr-defined]
    ax.set_rticks([0, 30, 60, 90], ["90°", "60°", "30°", ""])  # type: ignore[attr-defined]
    ax.set_thetagrids(range(0, 360, 45), ["N", "NE", "E", "SE", "S", "SW", "W", "NW"])  # type: ignore[attr-defined]
    ax.tick_params(labelsize=LETTERS_PT, pad=0)
    ax.grid(linewidth=0.4)
    ax.set_title("satellites in view", fontsize=LETTERS_PT, pad=8)
    return ax


def position_error(results: xarray.Dataset, ax: Axes | None = None) -> Axes:
    """Return the axes of the position's error against time: lines of all satellites, dots of the authenticated fix.

    Raises
    ------
    VestigeError
        If the results are not those of a sky.
    """
    _check(results, "fix_error_m", "time_s")
    ax = new_axes() if ax is None else ax
    time_s = results["time_s"].values
    for name, colour in _AXES:
        along = results["fix_error_m"].sel(local_axis=name)
        ax.plot(time_s, along.sel(fix="all").values, color=colour, linewidth=0.6, label=name)
        ax.plot(time_s, along.sel(fix="authenticated").values, ".", color=colour, markersize=3, markeredgewidth=0)
    ax.plot([], [], ".", color=GREY, markersize=3, label="authenticated")
    ax.axhline(0, color=BLACK, linewidth=0.4)
    dress(ax, title="position error", x=time_label(ax.xaxis, time_s), y="error (m)")
    legend(ax, columns=4)
    return ax


def monitor_timeline(time_s: Float[np.ndarray, " n"], lines: Sequence[MonitorLine], ax: Axes | None = None) -> Axes:
    """Return the axes of a time-line: for each check a line where it was run, and marks where it failed."""
    ax = new_axes(height_cm=1.6 + 0.4 * len(lines)) if ax is None else ax
    for row, line in enumerate(lines):
        ax.plot(time_s, np.where(line.run, float(row), np.nan), color=GREY, linewidth=0.8)
        if np.count_nonzero(line.run) < 0.5 * line.run.size:
            ax.plot(time_s[line.run], np.full(np.count_nonzero(line.run), row), "|", color=GREY, markersize=3)
        bad = line.failed
        ax.plot(time_s[bad], np.full(np.count_nonzero(bad), row), "|", color=RED, markersize=6, markeredgewidth=0.7)
    ax.set_yticks(range(len(lines)), [line.name for line in lines])
    ax.set_ylim(len(lines) - 0.5, -0.5)
    dress(ax, title="checks: run (grey), failed (red)", x=time_label(ax.xaxis, time_s), y="")
    return ax


def _check(results: xarray.Dataset, *names: str) -> None:
    for name in names:
        if name not in results.variables:
            raise VestigeError(f"results of a campaign: found no {name}, expected those of a [constellation]")
