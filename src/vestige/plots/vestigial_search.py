"""Draw the results of a vestigial signal search on E1 and in E6, as in the sketch [WFO, Fig. 3]."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from vestige.plots.figure import BLUE, GREEN, GREY, RED, dot_size_pt, dress, legend, new_axes

_ROOM = 1.25  # upper end of the axis divided by the strongest magnitude, so that the legend has space


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchTrace:
    """Magnitudes and result of a search in E6."""

    time_s: Sequence[float]  # arrival times, in s after the transmission of the RECS
    # Magnitude at each arrival time of a hand-over search, or the largest magnitude in each block of an exhaustive
    # search, in standard deviations of the noise per dimension.
    magnitude: Sequence[float]
    threshold: float  # threshold of the magnitude in standard deviations of the noise per dimension
    peaks: Sequence[tuple[float, float]]  # signals that were found: time and magnitude, the earliest first


def vestigial_search(trace: SearchTrace, *, title: str) -> Axes:
    """Return axes with magnitude against time, the threshold and the peaks.

    The earliest peak is marked as the true signal.
    """
    ax = new_axes()
    size = dot_size_pt(len(trace.time_s))
    ax.plot(trace.time_s, trace.magnitude, ".", color=GREY, markersize=size, label="searched", rasterized=True)
    ax.axhline(trace.threshold, color=BLUE, linewidth=0.7, linestyle="--", label=f"threshold {trace.threshold:.2f}")
    for number, (at_s, magnitude) in enumerate(trace.peaks):
        colour, mark, name = (GREEN, "^", "true: the earliest") if number == 0 else (RED, "v", "later: spoofing")
        ax.plot(at_s, magnitude, mark, color=colour, markersize=4, label=name if number < 2 else None)
    highest = max([trace.threshold, *trace.magnitude, *(magnitude for _, magnitude in trace.peaks)])
    ax.set_ylim(0, highest * _ROOM)
    dress(ax, title=title, x="travel time of the first chip (s)", y="magnitude (σ)")
    legend(ax, columns=2)
    return ax


def code_phases(
    phase_ms: Float[np.ndarray, " n"],
    power: Float[np.ndarray, " n"],
    found: Sequence[tuple[float, float]],
    *,
    title: str,
) -> Axes:
    """Return axes with the power of the strongest Doppler bin, divided by the threshold, against code phase.

    The axes also show the signals in `found`, given as code phase in ms and power divided by the threshold, the
    strongest first.
    """
    ax = new_axes()
    ax.plot(phase_ms, power, color=GREY, linewidth=0.4, rasterized=True)
    ax.axhline(1.0, color=BLUE, linewidth=0.7, linestyle="--", label="threshold")
    at, high = np.array(found, np.float64).reshape(-1, 2).T
    ax.plot(at, high, "o", color=RED, markersize=5, fillstyle="none", label=f"signals found: {at.size}")
    ax.set_yscale("log")
    ax.set_ylim(0.3, max(float(np.max(power)), 1.0) * 2)
    ax.set_xlim(0, float(phase_ms[-1]))
    dress(ax, title=title, x="code phase (ms)", y="power / threshold")
    legend(ax, columns=2)
    return ax
