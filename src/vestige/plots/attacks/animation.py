"""Animate the correlation function over time, with the signal that each detector found."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path

import numpy as np
import xarray
from jaxtyping import Float
from matplotlib.animation import PillowWriter

from vestige.campaign.statistics import detectors_of
from vestige.output import replacement
from vestige.plots.attacks.attack_comparison import spoofing_power_and_offset
from vestige.plots.epochs import attribute, column, is_attacked, magnitudes_sigma, select, thinned, title_of
from vestige.plots.figure import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LETTERS_PT,
    ORANGE,
    RED,
    WIDTH_CM,
    dress,
    figure_of,
    legend,
    new_axes,
)

FRAMES = 120  # largest number of frames; if the results have more epochs, every k-th epoch is shown
FRAMES_A_S = 10
ANIMATION_DPI = 150
_LINES = {"true signal": GREEN, "spoofer": ORANGE}
_MARKERS = (("v", BLUE), ("^", RED), ("<", GREY), (">", BLACK))  # marker and colour of each detector


def write_animation(
    results: xarray.Dataset, path: Path | str, *, svid: int | None = None, width_cm: float = WIDTH_CM
) -> int:
    """Write a GIF of magnitude over correlator offset with the detected signals, and return the number of frames.

    Under attack, dashed lines mark the true signal and the strongest spoofing signal.

    `path` ends in `.gif`. The image has 150 pixels per inch of its width.

    Raises
    ------
    VestigeError
        If a variable of the results is missing or invalid, or the results lack the satellite. If `svid` is None for
        several satellites. If `path` is a symbolic link, a device or a pipe, or lies in the store of a campaign.
    ValueError
        If the suffix of `path` is not `.gif`.
    """
    if Path(path).suffix.lower() != ".gif":
        raise ValueError(f"{path}: an animation is a .gif")
    epochs = thinned(results.sizes.get("epoch", 0), FRAMES)
    shown = {name: select(results, detector=name, svid=svid).isel(epoch=epochs) for name in detectors_of(results)}
    one = next(iter(shown.values()))
    offsets_m, time_s, magnitude = column(one, "tap_offset_m"), column(one, "time_s"), magnitudes_sigma(one)
    found = {name: (column(each, "range_offset_m"), column(each, "magnitude_sigma")) for name, each in shown.items()}
    truth = _truth(one) if is_attacked(results) else {}

    ax = new_axes(width_cm=width_cm)
    (curve,) = ax.plot([], [], "-o", color=BLACK, linewidth=0.8, markersize=2)
    marks = {
        name: ax.plot([], [], marker, color=colour, markersize=5, label=f"{name} detector")[0]
        for name, (marker, colour) in zip(shown, cycle(_MARKERS), strict=False)
    }
    lines = {name: ax.axvline(0.0, color=_LINES[name], linewidth=1.0, linestyle="--", label=name) for name in truth}
    if (threshold := attribute(one, "threshold_sigma")) is not None:
        ax.axhline(threshold, color=GREY, linewidth=0.6, linestyle=":")
    spacing_m = float(np.max(np.diff(offsets_m), initial=1.0))
    ax.set_xlim(offsets_m[0] - spacing_m / 2, offsets_m[-1] + spacing_m / 2)
    ax.set_ylim(0.0, 1.15 * max(float(np.nanmax(magnitude, initial=1.0)), threshold or 0.0))
    dress(ax, title=title_of("Correlators", one, with_detector=False), x="correlator offset (m)", y="magnitude (σ)")
    clock = ax.text(0.02, 0.96, "", transform=ax.transAxes, va="top", fontsize=LETTERS_PT)
    legend(ax, "upper right")
    figure = figure_of(ax)
    figure.set_layout_engine("constrained")
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # all frames have the layout of the first frame, so that only the signal moves

    writer = PillowWriter(fps=FRAMES_A_S)
    with replacement(Path(path)) as part, writer.saving(figure, str(part), ANIMATION_DPI):
        for epoch, at_s in enumerate(time_s):
            curve.set_data(offsets_m, magnitude[epoch])
            for name, mark in marks.items():
                mark.set_data(*([values[epoch]] for values in found[name]))
            for name, line in lines.items():
                line.set_xdata([truth[name][epoch]] * 2)
            clock.set_text(f"{at_s:g} s")
            writer.grab_frame()
    return time_s.size


def _truth(selected: xarray.Dataset) -> dict[str, Float[np.ndarray, " n_epochs"]]:
    """Return the range offsets in m of the true signal and of the strongest spoofing signal, by line label."""
    power_db, spoofer_m = spoofing_power_and_offset(selected)
    strongest = np.argmax(np.where(np.isnan(power_db), -np.inf, power_db), axis=1)
    return {
        "true signal": column(selected, "truth_prediction_error_m"),
        "spoofer": spoofer_m[np.arange(strongest.size), strongest],
    }
