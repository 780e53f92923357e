"""Draw the measured outcome of each attack at each mitigation level as a coloured map, like [WFO, Fig. 4].

Green marks a defence that works, and red marks a defence that fails. The words in a cell say if the outcome differs
from the expected outcome.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle

from vestige.plots.figure import BLACK, GREY, LETTERS_PT, ORANGE, SMALL_LETTERS_PT, new_axes

MAP_WIDTH_CM = 29.0
_ROW_CM, _ROUND_CM = 0.5, 3.2
_TITLE_PT = 9.0  # the title is larger than in other figures, because the map is 29 cm wide
_WHOLE = 10.0  # numbers from this value on have no decimals
_LIGHT = 0.5  # opacity of the colours, so that black letters are readable on them
_WHITE, _RED = "#FFFFFF", "#CC3311"


class _Meaning(NamedTuple):
    colour: str
    legend: str


# word of a cell -> colour of the cell, and explanation of the word in the legend
MEANINGS = {
    "mitigated": _Meaning("#007A4D", "mitigated: goes on with true ranges"),
    "mitigated late": _Meaning("#3CB88A", "mitigated late: wrong ranges at first"),
    "detected": _Meaning("#A8DFC6", "detected: an alarm, no wrong range in use"),
    "detected, missed": _Meaning(ORANGE, "detected, missed: an alarm, and a wrong range in use"),
    "missed": _Meaning(_RED, "missed: a wrong range in use, no alarm"),
    "no verdict": _Meaning(GREY, "no verdict: too few RECS could be judged"),
    "mixed": _Meaning("#F0E68C", "mixed: no outcome in more than half of the runs"),
    "no alarm, no harm": _Meaning(_WHITE, "no alarm, no harm"),
}


def threat_map(table: xarray.Dataset) -> Axes:
    """Draw the map with a line for each scene, grouped by attack, and a column for each level, and return the axes.

    A cell has the outcome as a word, and the shares in % of the runs that were detected, that were mitigated, and that
    had a wrong range in use. If the outcome was not expected, the cell also has the expected outcome. A cell of a scene
    without attack has the number of alarms a day and its upper limit. The table is `threats.zarr` of `vestige threats`,
    with variables over `scene` and `level`.
    """
    levels = table["level"].values.tolist()
    lines = _lines(table)
    ax = new_axes(width_cm=MAP_WIDTH_CM, height_cm=_ROUND_CM + _ROW_CM * len(lines))
    values = {str(name): one.values for name, one in table.data_vars.items() if one.dims == ("scene", "level")}
    names = []
    for place, (name, row) in enumerate(lines):
        names.append(name)
        if row is None:
            continue
        for column in range(len(levels)):
            cell = {name: of_cells[row, column] for name, of_cells in values.items()}
            meaning = MEANINGS.get(str(cell["word"]))
            colour = _WHITE if meaning is None else meaning.colour
            ax.add_patch(Rectangle((column, place), 1, 1, facecolor=colour, alpha=_LIGHT, edgecolor="none"))
            ax.add_patch(Rectangle((column, place), 1, 1, facecolor="none", edgecolor="white", linewidth=1.0))
            left, right = _texts(cell)
            ax.text(column + 0.03, place + 0.5, left, fontsize=SMALL_LETTERS_PT, va="center", color=BLACK)
            ax.text(column + 0.97, place + 0.5, right, fontsize=SMALL_LETTERS_PT, va="center", ha="right", color=BLACK)
    ax.set_xlim(0, len(levels))
    ax.set_ylim(len(lines), 0)
    ax.set_xticks(np.arange(len(levels)) + 0.5, [f"level {level}" for level in levels])
    ax.set_title("Outcome of each attack at each mitigation level", fontsize=_TITLE_PT, fontweight="bold", pad=8)
    ax.xaxis.tick_top()
    ax.set_yticks(np.arange(len(lines)) + 0.5, names)
    ax.tick_params(length=0, labelsize=SMALL_LETTERS_PT)
    for label, (_, row) in zip(ax.get_yticklabels(), lines, strict=True):
        label.set_fontweight("bold" if row is None else "normal")
    for spine in ax.spines.values():
        spine.set_visible(False)
    _legend(ax, table)
    return ax


def _lines(table: xarray.Dataset) -> list[tuple[str, int | None]]:
    """Return label and table row of each line of the map; the row is None for a line with the name of an attack."""
    lines: list[tuple[str, int | None]] = []
    rows = zip(table["threat"].values, table["attack"].values, table["scene"].values, strict=True)
    for (threat, attack), scenes in groupby(enumerate(rows), key=lambda one: (one[1][0], one[1][1])):
        lines.append((f"{threat}  {attack}".strip(), None))
        lines += [(str(scene), row) for row, (_, _, scene) in scenes]
    return lines


def _legend(ax: Axes, table: xarray.Dataset) -> None:
    found = {str(word) for word in table["word"].values.ravel()}
    patches = [
        Patch(facecolor=one.colour, alpha=_LIGHT, edgecolor=GREY, linewidth=0.5, label=one.legend)
        for word, one in MEANINGS.items()
        if word in found
    ]
    runs = int(np.nanmax(table["detected_of"].values, initial=0))
    title = f"Numbers: runs of {runs} in % that are detected · mitigated · with a wrong range in use"
    ax.legend(
        handles=patches,
        title=title,
        fontsize=SMALL_LETTERS_PT,
        title_fontsize=LETTERS_PT,
        loc="upper center",
        bbox_to_anchor=(0.3, -0.01),
        ncols=2,
        frameon=False,
    )


def _texts(cell: Mapping[str, Any]) -> tuple[str, str]:
    """Return the texts at the left and at the right edge of a cell; `cell` contains the cell's values by name."""
    word, how = str(cell["word"]), str(cell["agreement"])
    if not word:
        value, budget = (_short(float(cell[name])) for name in ("alarms_a_day", "budget_alarms_a_day"))
        return f"{value} alarms a day", f"at most {budget}{_NOT_KEPT.get(how, '')}"
    expected = {"DIFFERS": f", expected {cell['expected']}", "undecided": ", undecided"}.get(how, "")
    names = ("detected", "mitigated", "missed")
    shares = [round(100 * float(cell[name]) / float(cell[f"{name}_of"])) for name in names]
    return f"{word}{expected}", " · ".join(str(share) for share in shares)


_NOT_KEPT = {"DIFFERS": ", exceeded", "undecided": ", undecided"}


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= _WHOLE else f"{value:.2g}"
