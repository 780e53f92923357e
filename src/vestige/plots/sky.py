"""Draw the satellites in the sky, the errors of the fix, and the failures of the checks over time."""

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
    GREY,
    LEGEND,
    LETTERS_PT,
    RED,
    SMALL_LETTERS_PT,
    dot_size_pt,
    dress,
    figure_of,
    new_axes,
    new_panels,
    time_label,
)

# corners of the name of a satellite, to the upper right of the satellite's dot, relative to the dot, in ° of the sky
# plot
_NAME_DEG = np.array([(3.0, 2.0), (17.0, 2.0), (3.0, 9.0), (17.0, 9.0)]).T
_AXES, _DOTS = ("east", "north", "up"), "authenticated"


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorLine:
    """A check over time: whether it was run, and whether it failed for any satellite."""

    name: str
    run: Bool[np.ndarray, " n"]
    failed: Bool[np.ndarray, " n"]


def sky_plot(results: xarray.Dataset, ax: Axes | None = None) -> Axes:
    """Return the axes of a sky plot with the zenith in the middle and north up.

    A dot marks the last position of each satellite.

    The function raises `VestigeError` if the results are from a scenario without a constellation.
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
        east_deg, north_deg = away_deg[last] * np.sin(azimuth[last]), away_deg[last] * np.cos(azimuth[last])
        # whether the name would cross the horizon, which is 90° from the zenith
        crosses = np.max(np.hypot(east_deg + _NAME_DEG[0], north_deg + _NAME_DEG[1])) > 90
        left, below = crosses and east_deg > 0, crosses and north_deg > 0
        ax.annotate(
            f"E{svid:02d}",
            (azimuth[last], away_deg[last]),
            xytext=(-3 if left else 3, -3 if below else 3),
            textcoords="offset points",
            ha="right" if left else "left",
            va="top" if below else "baseline",
            fontsize=SMALL_LETTERS_PT,
        )
    ax.set_rlim(0, 90)  # type: ignore[attr-defined]
    ax.set_rticks([0, 30, 60, 90], ["90°", "60°", "30°", ""])  # type: ignore[attr-defined]
    ax.set_thetagrids(range(0, 360, 45), ["N", "NE", "E", "SE", "S", "SW", "W", "NW"])  # type: ignore[attr-defined]
    ax.tick_params(labelsize=LETTERS_PT, pad=0)
    ax.grid(linewidth=0.4)
    ax.set_title("satellites in view, dot: last position", fontsize=LETTERS_PT, pad=8)
    return ax


def position_error(results: xarray.Dataset) -> Axes:
    """Draw the error of the fix against time in panels for east, north, up and clock, and return the lowest axes.

    Lines show fixes with all satellites, and dots show fixes with the authenticated satellites only.

    The function raises `VestigeError` if the results are from a scenario without a constellation, or if there is no
    fix.
    """
    _check(results, "fix_error_m", "fix_clock_error_m", "time_s")
    if not np.isfinite(results["fix_clock_error_m"].values).any():
        raise VestigeError("results of a campaign: found no position fix, expected four satellites at some time")
    panels = new_panels(len(_AXES) + 1)
    time_s = results["time_s"].values
    errors = {name: results["fix_error_m"].sel(local_axis=name) for name in _AXES}
    for ax, (name, error) in zip(panels, (errors | {"clock": results["fix_clock_error_m"]}).items(), strict=True):
        ax.plot(time_s, error.sel(fix="all").values, color=GREY, linewidth=0.5, label="all satellites")
        known = error.sel(fix="authenticated").values
        ax.plot(time_s, known, "o", color=BLUE, markersize=dot_size_pt(time_s.size), markeredgewidth=0, label=_DOTS)
        ax.axhline(0, color=BLACK, linewidth=0.4)
        dress(ax, title="", x="", y=f"{name} (m)")
    dress(panels[0], title="error of the position fix", x="", y=f"{_AXES[0]} (m)")
    figure_of(panels[0]).legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False, **LEGEND
    )
    panels[-1].set_xlabel(time_label(panels[-1].xaxis, time_s), fontsize=LETTERS_PT, labelpad=2)
    return panels[-1]


def monitor_timeline(time_s: Float[np.ndarray, " n"], lines: Sequence[MonitorLine], ax: Axes | None = None) -> Axes:
    """Draw for each check a line while the check was run, and marks at its failures, and return the axes."""
    ax = new_axes(height_cm=1.6 + 0.4 * len(lines)) if ax is None else ax
    for row, line in enumerate(lines):
        ax.plot(time_s, np.where(line.run, float(row), np.nan), color=GREY, linewidth=0.8)
        if np.count_nonzero(line.run) < 0.5 * line.run.size:
            ax.plot(time_s[line.run], np.full(np.count_nonzero(line.run), row), "|", color=GREY, markersize=3)
        if not line.run.any():
            ax.text(0.02, row, "not run", transform=ax.get_yaxis_transform(), fontsize=SMALL_LETTERS_PT, va="center")
        bad = line.failed
        ax.plot(time_s[bad], np.full(np.count_nonzero(bad), row), "|", color=RED, markersize=6, markeredgewidth=0.7)
    ax.set_yticks(range(len(lines)), [line.name for line in lines])
    ax.set_ylim(len(lines) - 0.5, -0.5)
    dress(ax, title="checks: run (grey), failed (red)", x=time_label(ax.xaxis, time_s), y="")
    return ax


def _check(results: xarray.Dataset, *names: str) -> None:
    for name in names:
        if name not in results.variables:
            raise VestigeError(
                f"results of a campaign: found no {name}, because its scenario has one line of sight; expected a "
                "scenario with the table [constellation], such as night.toml, which `vestige init` writes"
            )
