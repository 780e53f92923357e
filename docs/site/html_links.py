"""Check the built site: every internal link and picture leads somewhere, and nothing is loaded from a network."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# attributes that make a browser load something, and the one that a reader follows
_LOADED = {("img", "src"), ("script", "src"), ("link", "href"), ("source", "src"), ("iframe", "src")}
_FOLLOWED = ("a", "href")
_NO_RESOURCE = {"search", "index", "next", "prev", "canonical"}


class _Page(HTMLParser):
    """Collects the anchors of a page, what it loads and what it links to."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.anchors: set[str] = {""}
        self.loaded: list[str] = []
        self.followed: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take one element."""
        values = {name: value for name, value in attrs if value is not None}
        self.anchors |= {values[name] for name in ("id", "name") if name in values}
        for name, value in values.items():
            if (tag, name) == _FOLLOWED or values.get("rel") in _NO_RESOURCE:
                self.followed += [value] if name == "href" else []
            elif (tag, name) in _LOADED:
                self.loaded.append(value)


def faults(html: Path) -> list[str]:
    """Return one line for each link or picture of the built site that leads nowhere or to a network."""
    pages: dict[Path, _Page] = {}
    for path in sorted(html.rglob("*.html")):
        page = pages[path.resolve()] = _Page()
        page.feed(path.read_text(encoding="utf-8"))
    found = []
    for path, page in pages.items():
        place = path.relative_to(html.resolve()).as_posix()
        found += [f"{place}: loads {target} from a network" for target in page.loaded if urlsplit(target).netloc]
        for target in (*page.loaded, *page.followed):
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            to = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            to = to / "index.html" if to.is_dir() else to
            if not to.is_file():
                found.append(f"{place}: {target} leads nowhere")
            elif to in pages and unquote(parts.fragment) not in pages[to].anchors:
                found.append(f"{place}: {target} names no place on that page")
    return found
