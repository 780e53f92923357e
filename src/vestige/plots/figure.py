"""Set the common style of all figures, which is size, letters, colours and file formats.

Most figures are made for a column of a paper, 8 cm wide, where 7 pt letters are as large as a footnote. Each figure has
its own `Figure`, which is made without `pyplot`. Drawing needs no window, no shared state and no change of global
settings. Most artists with a point for each epoch are drawn as pixels even in a PDF or SVG.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure

from vestige.output import replacement

WIDTH_CM = 8.0  # width in cm of all figures in [WFO]
HEIGHT_CM = 5.6
CM_PER_INCH = 2.54
DPI = 300
LETTERS_PT = 7.0
PD_TEXT, PFA_TEXT = r"$P_\mathrm{d}$", r"$P_\mathrm{fa}$"  # texts of P_d and P_fa for Matplotlib
SMALL_LETTERS_PT = 6.0
LEGEND: dict[str, Any] = {
    "fontsize": SMALL_LETTERS_PT,
    "handlelength": 1.4,
    "handletextpad": 0.5,
    "columnspacing": 1.0,
    "labelspacing": 0.2,
    "borderpad": 0.2,
}
_LONG_S = 10_000.0

# Okabe and Ito, Color Universal Design (2008): colours that differ for any kind of colour vision, and in grey
ORANGE, BLUE, RED, GREEN, BLACK, GREY = "#E69F00", "#0072B2", "#D55E00", "#009E73", "#000000", "#767676"
COLOUR_MAP = "cividis"  # colour map with the same lightness for every kind of colour vision

FIGURE_FORMATS = ("png", "pdf", "svg")


def new_axes(*, width_cm: float = WIDTH_CM, height_cm: float = HEIGHT_CM, projection: str | None = None) -> Axes:
    """Return the axes of a new figure.

    The projection is `3d` for the waterfall, and `polar` for the sky plot.
    """
    figure = Figure(figsize=(width_cm / CM_PER_INCH, height_cm / CM_PER_INCH), dpi=DPI, layout="constrained")
    return figure.add_subplot(projection=projection)


def new_panels(n: int) -> list[Axes]:
    """Return the axes of n panels above each other with a common abscissa, in a figure that is n times 3 cm high."""
    figure = Figure(figsize=(WIDTH_CM / CM_PER_INCH, n * 3.0 / CM_PER_INCH), dpi=DPI, layout="constrained")
    panels: list[Axes] = list(figure.subplots(n, sharex=True))
    return panels


def figure_of(ax: Axes) -> Figure:
    """Return the figure that contains the axes, also if the axes lie in a subfigure."""
    figure: Figure | SubFigure | None = ax.figure
    while isinstance(figure, SubFigure):
        figure = figure.figure
    if figure is None:
        raise ValueError("axes without a figure")
    return figure


def dress(ax: Axes, *, title: str, x: str, y: str) -> None:
    """Set title and labels, and set the letters and lines of the axes to the common sizes."""
    ax.set_title(title, fontsize=LETTERS_PT, pad=4)
    ax.set_xlabel(x, fontsize=LETTERS_PT, labelpad=2)
    ax.set_ylabel(y, fontsize=LETTERS_PT, labelpad=2)
    ax.tick_params(which="both", labelsize=LETTERS_PT, pad=2)
    ax.tick_params(which="major", width=0.5, length=2.5)
    ax.tick_params(which="minor", width=0.4, length=1.5)
    for spine in ax.spines.values():
        spine.set_linewidth(0.5)


def legend(ax: Axes, place: str = "best", columns: int = 1) -> None:
    """Set a legend in small letters if any artist has a label."""
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc=place, ncols=columns, framealpha=1.0, edgecolor="none", **LEGEND)  # type: ignore[call-overload]


def typeset(number: float) -> str:
    """Return a number as text for Matplotlib, with a power of ten in place of a notation such as 1e-7."""
    digits, _, exponent = f"{number:g}".partition("e")
    if not exponent:
        return digits
    factor = "" if digits == "1" else rf"{digits} \cdot "
    return f"${factor}10^{{{int(exponent)}}}$"


def dot_size_pt(n: int) -> float:
    """Return the diameter in pt of `n` dots, which is smaller for more dots, so that dots cover each other less."""
    return 2.2 if n <= 1000 else 1.6 if n <= 10_000 else 1.0


def time_label(axis: Axis, time_s: Float[np.ndarray, " n"]) -> str:
    """Return the label of a time axis in s, or in 1000 s if a time reaches 10,000 s, and shorten the axis numbers."""
    if np.max(time_s, initial=0.0) < _LONG_S:
        return "time (s)"
    axis.set_major_formatter(lambda at_s, _: f"{at_s / 1000:g}")
    return "time (1000 s)"


def write(ax: Axes, path: Path | str, *, width_cm: float | None = None) -> None:
    """Write the figure of `ax` to a file in the format of its suffix (`FIGURE_FORMATS`).

    If `width_cm` is given, the figure is first scaled to this width. The proportions of the figure and the size of its
    letters stay the same.

    Raises
    ------
    ValueError
        If the suffix is not one of `FIGURE_FORMATS`.
    OSError
        If the file cannot be written.
    InputFileError
        If `path` is a symbolic link, a device or a pipe, or lies in the store of a campaign.
    """
    path = Path(path)
    if path.suffix.lower().lstrip(".") not in FIGURE_FORMATS:
        raise ValueError(f"{path}: the suffix of a figure is one of {', '.join(FIGURE_FORMATS)}")
    figure = figure_of(ax)
    if width_cm is not None:
        width_inches, height_inches = figure.get_size_inches()
        figure.set_size_inches(width_cm / CM_PER_INCH, height_inches * width_cm / CM_PER_INCH / width_inches)
    with replacement(path) as part:
        figure.savefig(part, dpi=DPI)
