"""Attack by mitigation level as a map of colours: the counterpart of [WFO, Fig. 4] with measured numbers in it."""

from __future__ import annotations

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from vestige.plots.figure import BLACK, BLUE, GREEN, GREY, LETTERS_PT, ORANGE, RED, SMALL_LETTERS_PT, dress, new_axes

MAP_WIDTH_CM = 21.0
_ROW_CM, _ROUND_CM = 0.5, 1.6
_WHOLE = 10.0  # from here on without decimals
_LIGHT = 0.45  # of the colours, so that black letters are read on them
# word of a cell: its colour
WORD_COLOURS = {
    "mitigated": GREEN,
    "mitigated late": "#56B4E9",
    "detected": BLUE,
    "detected, missed": ORANGE,
    "missed": RED,
    "no verdict": GREY,
    "no alarm, no harm": "#FFFFFF",
    "": "#FFFFFF",
}
_MARKS = {"as expected": "✓", "DIFFERS": "≠", "undecided": "?", "": ""}


def threat_map(table: xarray.Dataset) -> Axes:
    """Return the axes of the map: scenes from the top, levels beside each other, a word and shares in each cell.

    The table is `threats.zarr` of `vestige threats`: variables over `scene` and `level`.
    """
    rows, levels = table.sizes["scene"], table["level"].values.tolist()
    ax = new_axes(width_cm=MAP_WIDTH_CM, height_cm=_ROUND_CM + _ROW_CM * rows)
    for row in range(rows):
        for column, level in enumerate(levels):
            cell = table.isel(scene=row).sel(level=level)
            word = str(cell["word"].item())
            colour = WORD_COLOURS.get(word, "#FFFFFF")
            ax.add_patch(Rectangle((column, row), 1, 1, facecolor=colour, alpha=_LIGHT, edgecolor="none"))
            ax.add_patch(Rectangle((column, row), 1, 1, facecolor="none", edgecolor="white", linewidth=1.0))
            left, right = _texts(cell)
            ax.text(column + 0.03, row + 0.5, left, fontsize=SMALL_LETTERS_PT, va="center", color=BLACK)
            ax.text(column + 0.97, row + 0.5, right, fontsize=SMALL_LETTERS_PT, va="center", ha="right", color=BLACK)
    ax.set_xlim(0, len(levels))
    ax.set_ylim(rows, 0)
    ax.set_xticks(np.arange(len(levels)) + 0.5, [f"level {level}" for level in levels])
    ax.xaxis.tick_top()
    names = zip(table["threat"].values, table["scene"].values, strict=True)
    ax.set_yticks(np.arange(rows) + 0.5, [f"{threat}  {scene}" for threat, scene in names])
    runs = int(np.nanmax(table["detected_of"].values)) if rows else 0
    title = (
        f"runs of {runs} in %: d detected, m mitigated, w wrong range in use;  ✓ as expected, ≠ differs, ? undecided"
    )
    dress(ax, title=title, x="", y="")
    ax.tick_params(length=0, labelsize=SMALL_LETTERS_PT)
    ax.title.set_fontsize(LETTERS_PT)
    for spine in ax.spines.values():
        spine.set_visible(False)
    return ax


def _texts(cell: xarray.Dataset) -> tuple[str, str]:
    """Return what stands on the left and on the right of a cell."""
    word, how = str(cell["word"].item()), str(cell["agreement"].item())
    mark = _MARKS.get(how, "")
    if not word:
        value, budget = (_short(float(cell[name].item())) for name in ("alarms_a_day", "budget_alarms_a_day"))
        return f"{mark} {value} alarms a day", f"budget {budget}"
    expected = f", not: {cell['expected'].item()}" if how == "DIFFERS" else ""
    shares = [
        round(100 * float(cell[name].item()) / float(cell[f"{name}_of"].item()))
        for name in ("detected", "mitigated", "missed")
    ]
    return f"{mark} {word}{expected}", " · ".join(str(share) for share in shares)


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= _WHOLE else f"{value:.2g}"
