"""Settings of Sphinx. `make docs` calls `docs/site/build.py`, which stages the pages and then runs Sphinx with them."""

from __future__ import annotations

import os
import re
import sys
from importlib.metadata import version as installed_version
from pathlib import Path
from typing import Any

from sphinx.ext import autosummary

SITE = Path(__file__).resolve().parent
ROOT = SITE.parents[1]
# The gallery's scripts run in this process: they use the source beside them.
sys.path[:0] = [str(ROOT / "src"), str(SITE)]

project = "vestige"
author = "the contributors of vestige"
version = release = installed_version("vestige")
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
]
root_doc = "index"
exclude_patterns = ["files", "gallery/**/*.ipynb", "gallery/**/*.py", "**/GALLERY_HEADER.rst"]
highlight_language = "text"
smartquotes = False  # "--level" in a help text must stay two hyphens, so that it can be copied
default_role = "literal"  # docstrings write `name` for code

myst_enable_extensions = ["colon_fence", "deflist", "attrs_block"]
myst_heading_anchors = 4

templates_path = [str(SITE / "templates")]
autosummary_generate = True
autosummary_imported_members = True
autosummary.WELL_KNOWN_ABBREVIATIONS += ("Sec.", "Fig.", "Eq.")  # they end no sentence
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
maximum_signature_line_length = 70
numpydoc_show_class_members = False
toc_object_entries = False

sphinx_gallery_conf = {
    "examples_dirs": [str(SITE.parent / "gallery")],
    "gallery_dirs": ["gallery"],
    # The quick build runs what the front page shows, and only that.
    "filename_pattern": r"(1_lift_off|4_sky_of_verdicts)\.py$" if "VESTIGE_DOCS_QUICK" in os.environ else r"\.py$",
    "abort_on_example_error": True,
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 1e9,
    "write_computation_times": False,
    "image_scrapers": ("figure_scraper.scrape_figures",),
    "capture_repr": (),
}

html_theme = "furo"
html_title = "vestige"
html_static_path = [str(SITE / "static")]
html_css_files = ["vestige.css"]
html_copy_source = False
# A summary of a page found would have to be fetched, which a browser refuses on a site that is opened from a disk.
html_show_search_summary = False
html_show_sphinx = False
html_show_copyright = False
html_theme_options = {"navigation_with_keys": True}

_BARS = re.compile(r"\|([^|`\n]+)\|")


def _bars_are_magnitudes(_app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Keep |x| what it is in a docstring, the magnitude of x; reST would take it for a substitution."""
    lines[:] = [_BARS.sub(r"\|\1\|", line) for line in lines]


def setup(app: Any) -> None:
    """Tell Sphinx what is read differently here."""
    app.connect("autodoc-process-docstring", _bars_are_magnitudes)
