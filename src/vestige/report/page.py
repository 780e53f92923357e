"""Write a page as a single HTML file with style, script and data, so that a browser fetches nothing else.

The content security policy allows no network address. The only allowed script is the page's own script, which the
policy identifies by a hash.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from vestige.errors import InputFileError
from vestige.output import replacement
from vestige.report.markup import Html, joined, markup

MARK = '<meta name="generator" content="vestige report'
SCRIPTS = ("chart.js", "timeline.js", "waterfall.js", "offsets.js", "main.js")  # files in the order of their use
_HEAD_BYTES = 1000  # number of bytes at the start of a file that contain the mark of a report


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """Content of a report page."""

    title: str  # subject of the page
    question: str  # question that the page answers
    body: tuple[Html, ...]
    version: str
    # data that the script of the page draws: numbers, text, and arrays in the form of `drawing.packed`
    data: Mapping[str, Any] = field(default_factory=dict)

    def html(self) -> str:
        """Return the whole page as HTML."""
        script = _script()
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        return Template(_part("page.html")).substitute(
            mark=MARK,
            version=markup(self.version),
            script_hash=digest,
            title=markup(self.title),
            question=markup(self.question),
            style=_part("page.css"),
            body=joined(self.body),
            data=_json(self.data),
            script=script,
        )


def write_page(page: Page, path: Path) -> None:
    """Write a page to a file, as a whole or not at all.

    The function raises `InputFileError` if `path` exists and is not a report.
    """
    if path.exists() and not is_report(path):
        raise InputFileError(
            path, "output", "a file that is not a report", "a new name, or the name of an earlier report"
        )
    with replacement(path) as part:
        part.write_text(page.html(), encoding="utf-8")


def is_report(path: Path) -> bool:
    """Return whether a file is a page that vestige wrote."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return MARK.encode() in file.read(_HEAD_BYTES)


@cache
def _part(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


@cache
def _script() -> str:
    return "\n".join(["'use strict';", *map(_part, SCRIPTS)])


def _json(data: Mapping[str, Any]) -> str:
    """Return data as JSON that cannot close the HTML element in which the JSON stands."""
    text = json.dumps(data, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
