"""docs/extend.md in parts: the scenario, and each part with its file, its tables and its commands."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

PAGE = Path(__file__).resolve().parents[1] / "docs" / "extend.md"
_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_FILE = re.compile(r"`(\w+)\.py`:\n\n```python")


@dataclass(frozen=True)
class Section:
    """A section of the page: the module with its source, the tables for the scenario, and what is typed."""

    title: str
    module: str
    source: str
    tables: str
    commands: tuple[str, ...]


def scenario() -> str:
    """Return the scenario at the top of the page."""
    return next(text for language, text in _BLOCK.findall(PAGE.read_text(encoding="utf-8")) if language == "toml")


def sections() -> dict[str, Section]:
    """Return the sections that have a file, by module."""
    found = {}
    for part in PAGE.read_text(encoding="utf-8").split("\n## ")[1:]:
        if (name := _FILE.search(part)) is None:
            continue
        blocks = dict(_BLOCK.findall(part))
        commands = tuple(line for line in blocks[""].splitlines() if line)
        found[name[1]] = Section(part.partition("\n")[0], name[1], blocks["python"], blocks["toml"], commands)
    return found


def write_page(folder: Path) -> None:
    """Write the files of all parts into a folder, and for each a scenario `<module>.toml` that names it."""
    for section in sections().values():
        (folder / f"{section.module}.py").write_text(section.source, encoding="utf-8")
        (folder / f"{section.module}.toml").write_text(f"{scenario()}\n{section.tables}", encoding="utf-8")
