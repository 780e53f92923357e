"""Copy the documents of the repository into one source tree for Sphinx, with links that are right there.

The documents stay where GitHub, an editor and the tests expect them. In the staged tree the pages of `docs/site/pages`
and those of `docs` share the root, the documents of the repository's root stand in `project`, and any other file that
a page links to stands in `files`, from which a reader downloads it. A scenario file has a page (`scenario_pages.py`).
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import scenario_pages

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "docs" / "site" / "pages"
PICTURES = {".png", ".svg", ".jpg"}
_LINK = re.compile(r"\]\((?!\w+:|#)([^)#\s]+)(#[^)\s]*)?\)")
_FENCE = re.compile(r"^(```.*?^```)", re.MULTILINE | re.DOTALL)


def documents() -> dict[Path, Path]:
    """Return every document of the repository and where it stands in the staged tree."""
    found = {path: Path("project") / path.name for path in sorted(ROOT.glob("*.md"))}
    for path in sorted((ROOT / "docs").rglob("*.md")):
        base = PAGES if path.is_relative_to(PAGES) else ROOT / "docs"
        found[path] = path.relative_to(base)
    return found


def title(path: Path) -> str:
    """Return the first heading of a document."""
    found = re.search(r"^# (.+)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    return path.stem if found is None else found[1]


def staged_place(path: Path, pages: dict[Path, Path]) -> Path:
    """Return where a file that a page links to stands in the staged tree."""
    if path in pages:
        return pages[path]
    if path.parent == scenario_pages.FOLDER and path.suffix == ".toml":
        return Path(scenario_pages.place(path))
    return Path("files") / path.relative_to(ROOT)


def with_staged_links(text: str, source: Path, pages: dict[Path, Path], linked: set[Path]) -> str:
    """Return a document with each relative link changed to what it means in the staged tree.

    Files that are no documents are added to `linked`. A link to a folder becomes its text.

    Raises `FileNotFoundError` if a link leads nowhere.
    """

    def changed(match: re.Match[str]) -> str:
        target = (source.parent / match[1]).resolve()
        if not target.exists():
            raise FileNotFoundError(f"{source.relative_to(ROOT)}: the link {match[1]} leads nowhere")
        if target.is_dir():
            return "]"
        if target not in pages and staged_place(target, pages).parts[0] == "files":
            linked.add(target)
        place = os.path.relpath(staged_place(target, pages), pages[source].parent)
        return f"]({Path(place).as_posix()}{match[2] or ''})"

    parts = _FENCE.split(text)
    return "".join(part if part.startswith("```") else _LINK.sub(changed, part) for part in parts)


def write_if_changed(path: Path, content: str | bytes) -> None:
    """Write a file unless it has this content, so that Sphinx reads only pages that changed."""
    data = content.encode("utf-8") if isinstance(content, str) else content
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_bytes() != data:
        path.write_bytes(data)


def stage(folder: Path) -> set[Path]:
    """Write the staged tree into a folder and return the files in it, relative to the folder."""
    pages, linked, written = documents(), set[Path](), set[Path]()
    for source, place in pages.items():
        text = with_staged_links(source.read_text(encoding="utf-8"), source, pages, linked)
        write_if_changed(folder / place, text)
        written.add(place)
    for path in sorted(linked):
        place = staged_place(path, pages)
        write_if_changed(folder / place, path.read_bytes())
        written.add(place)
    return written
