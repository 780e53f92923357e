"""Find the figures that an example of the gallery drew: those of pyplot, and the axes that `vestige.plots` returns."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from sphinx_gallery.scrapers import figure_rst, matplotlib_scraper

from vestige.plots.figure import figure_of

# Figures of vestige.plots are made for a column of a paper, 8 cm wide; on a screen they are shown larger.
_DOTS_PER_INCH = 200
_found: set[int] = set()


def scrape_figures(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Write the figures of one block of code as PNG and return the reST that shows them."""
    # The scraper of pyplot closes its figures, so they have to be known before.
    drawn = [value for value in list(block_vars["example_globals"].values()) if isinstance(value, Axes)]
    _found.update(id(value) for value in drawn if figure_of(value).canvas.manager is not None)
    text: str = matplotlib_scraper(block, block_vars, gallery_conf)
    shown = []
    for value in drawn:
        if id(value) in _found:
            continue
        _found.add(id(value))
        path = block_vars["image_path_iterator"].next()
        figure_of(value).savefig(path, dpi=_DOTS_PER_INCH)
        shown.append(path)
    return text + (figure_rst(shown, gallery_conf["src_dir"]) if shown else "")
