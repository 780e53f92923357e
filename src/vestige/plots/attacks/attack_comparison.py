"""Draw the range offsets of all detectors under attack, and the power of the spoofing signals [WFO, Sec. VI-B]."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray
from jaxtyping import Float
from matplotlib.axes import Axes

from vestige.campaign.statistics import detectors_of
from vestige.errors import VestigeError
from vestige.plots.bank_edge import mark_bank_edge
from vestige.plots.epochs import column, is_attacked, is_missed, select, title_of
from vestige.plots.figure import (
    BLACK,
    BLUE,
    GREEN,
    LEGEND,
    ORANGE,
    RED,
    dot_size_pt,
    dress,
    figure_of,
    new_axes,
    time_label,
)

_AXES_CM, _REST_CM = 4.0, 3.5  # height in cm of the axes of a detector, and of the rest of the figure
_POWER_SHARE = 0.45  # height of the power axes as a share of the height of range-offset axes
_MARGIN_M = 12.0
_LINE: dict[str, Any] = {"linewidth": 0.5, "rasterized": True}


def attack_comparison(results: xarray.Dataset, *, svid: int | None = None) -> Axes:
    """Draw the power of the spoofing signals above the range offset of each detector, and return the uppermost axes.

    Lines in the range-offset axes mark the true signal and each spoofing signal. The line of a spoofing signal has a
    gap while the signal is off. A dashed line marks the edge of the bank of correlators if measured offsets come near
    this edge.

    The function raises `VestigeError` if the campaign has no attack or lacks the satellite, or if a variable is missing
    or invalid. The error is also raised if `svid` is None for several satellites.
    """
    if not is_attacked(results):
        raise VestigeError("results of a campaign: found no attack, expected a scenario with [[attack]]")
    shown = {detector: select(results, detector=detector, svid=svid) for detector in detectors_of(results)}
    one = next(iter(shown.values()))
    time_s, true_m = column(one, "time_s"), column(one, "truth_prediction_error_m")
    power_db, spoofer_m = spoofing_power_and_offset(one)
    figure = figure_of(new_axes(height_cm=_REST_CM + _AXES_CM * len(shown)))
    figure.clear()
    power, *offsets = figure.subplots(1 + len(shown), sharex=True, height_ratios=[_POWER_SHARE, *(1 for _ in shown)])

    power.axhline(0.0, color=BLACK, linewidth=0.5)
    power.plot(time_s, power_db, color=ORANGE, **_LINE)
    dress(power, title=title_of("Attack", one, with_detector=False), x="", y="power (dB)")
    measured_m = [column(each, "range_offset_m") for each in shown.values()]
    for ax, (detector, selected) in zip(offsets, shown.items(), strict=True):
        missed = is_missed(selected)
        ax.plot(time_s, true_m, color=GREEN, label="true signal", **_LINE)
        ax.plot(time_s, spoofer_m, color=ORANGE, **_LINE)[0].set_label("spoofer")
        ax.plot(
            time_s, column(selected, "range_offset_m"), ".", color=BLUE, markersize=dot_size_pt(time_s.size),
            markeredgewidth=0, rasterized=True, label="measured",
        )  # fmt: skip
        ax.plot(
            time_s[missed], np.full(missed.sum(), 0.03), "|", color=RED, markersize=4, markeredgewidth=0.6,
            transform=ax.get_xaxis_transform(), label="not detected", rasterized=True,
        )  # fmt: skip
        dress(ax, title=f"{detector} detector", x="", y="range offset (m)")
        edges_m = mark_bank_edge(ax, one, *measured_m)
        ax.set_ylim(*_limits(one, true_m, spoofer_m, *measured_m, edges_m))
    offsets[-1].set_xlabel(time_label(offsets[-1].xaxis, time_s), fontsize=offsets[-1].yaxis.label.get_fontsize())
    handles, labels = offsets[0].get_legend_handles_labels()
    columns = len(labels) if len(labels) < 5 else 3
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False, **LEGEND)
    return power


def spoofing_power_and_offset(
    selected: xarray.Dataset,
) -> tuple[Float[np.ndarray, "n_epochs n_attacks"], Float[np.ndarray, "n_epochs n_attacks"]]:
    """Return the E6 power over the true signal in dB, and the range offset in m, of the spoofing signals.

    Both values are NaN while a signal is off.
    """
    power_db = selected["truth_spoofer_power_db"].transpose("epoch", "attack").values.astype(np.float64)
    later_m = selected["truth_spoofer_offset_m"].transpose("epoch", "attack").values.astype(np.float64)
    on = np.isfinite(power_db)
    place_m = column(selected, "truth_prediction_error_m")[:, None] + later_m
    return np.where(on, power_db, np.nan), np.where(on, place_m, np.nan)


def _limits(selected: xarray.Dataset, *places_m: Float[np.ndarray, "..."]) -> tuple[float, float]:
    """Return the limits in m of the range-offset axes, which show all offsets within the bank of correlators."""
    offsets_m = column(selected, "tap_offset_m")
    shown_m = np.concatenate([np.zeros(1), *(one.ravel() for one in places_m)])
    shown_m = shown_m[(shown_m >= offsets_m[0]) & (shown_m <= offsets_m[-1])]
    return float(shown_m.min()) - _MARGIN_M, float(shown_m.max()) + _MARGIN_M
