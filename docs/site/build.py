"""Build the documentation site: `make docs`, or `make docs-quick` with the front page's examples only.

    python docs/site/build.py [--quick] [-o FOLDER]

The pages are staged in `FOLDER/source` (build/docs), the pages that the program itself determines are generated there,
and Sphinx writes `FOLDER/html`. Warnings are errors, and every internal link and picture of the result is checked.
Nothing is fetched from a network.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import api_pages
import command_pages
import format_pages
import html_links
import ledger
import scenario_pages
import staging
from sphinx.cmd.build import main as sphinx

SITE = Path(__file__).resolve().parent
GENERATED = (command_pages.pages, api_pages.pages, format_pages.pages, ledger.pages, scenario_pages.pages)
# What Sphinx or its extensions write into the staged tree themselves.
OWNED_BY_SPHINX = ("gallery", "sg_execution_times.rst")


def remove_stale(source: Path, written: set[Path]) -> None:
    """Delete the staged files that no page of the repository stands for any more."""
    for path in sorted(source.rglob("*")):
        relative = path.relative_to(source)
        if path.is_file() and relative not in written and not relative.as_posix().startswith(OWNED_BY_SPHINX):
            path.unlink()


def main() -> int:
    """Build the site and return the exit status."""
    arguments = argparse.ArgumentParser(description="Build the documentation site.")
    arguments.add_argument("--quick", action="store_true", help="run only the examples of the front page")
    arguments.add_argument("-o", "--output", type=Path, default=SITE.parents[1] / "build" / "docs")
    options = arguments.parse_args()
    # Examples that were not run must not stand for examples that were.
    folder = options.output / "quick" if options.quick else options.output
    source, html = folder / "source", folder / "html"
    if options.quick:
        os.environ["VESTIGE_DOCS_QUICK"] = "1"
    written = staging.stage(source)
    for pages in GENERATED:
        for place, text in pages().items():
            staging.write_if_changed(source / place, text)
            written.add(Path(place))
    remove_stale(source, written | api_pages.places())
    doctrees = str(folder / "doctrees")
    # -a: every page is written, because the menu of each changes with any page; only pages that changed are read.
    options_of_sphinx = ["-q", "-a", "-W", "--keep-going", "-c", str(SITE), "-d", doctrees, "-b", "html"]
    status = sphinx([*options_of_sphinx, str(source), str(html)])
    if status:
        return status
    if faults := html_links.faults(html):
        sys.stderr.write("".join(f"{fault}\n" for fault in faults))
        return 1
    sys.stdout.write(f"The site is {html / 'index.html'}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
