"""The documentation site in a real browser: silent, without a network, and no wider than a phone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from code_blocks import ROOT
from pages_in_browser import BEYOND, DESK, PHONE, asked_for, opened

BUILT = ROOT / "build" / "docs" / "html"
INDEX = BUILT / "index.html"
PAGES = sorted(BUILT.rglob("*.html"))
pytestmark = pytest.mark.skipif(not INDEX.is_file(), reason="needs the built site: make docs")


def wrong(browser: Any, page: Path) -> list[str]:
    """Return what is wrong with a page on a phone, and then at a desk, a line each."""
    opened(browser, page.as_uri(), PHONE)
    wide = []
    for width, height in (PHONE, DESK):
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width == PHONE[0]}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        found = browser.execute_script("return document.documentElement.scrollWidth")
        if found > width:
            wide.append(f"{found} pixels wide where there are {width}: {browser.execute_script(BEYOND)[:3]}")
    said = [entry["message"] for entry in browser.get_log("browser")]
    far = [address for address in asked_for(browser) if not address.startswith("file:")]
    return [f"{page.name}: {one}" for one in (*said, *far, *wide)]


def test_pages_are_silent_and_no_wider_than_the_window(browser: Any) -> None:
    assert len(PAGES) > 100
    assert [line for page in PAGES for line in wrong(browser, page)] == []


def test_such_a_page_is_seen(browser: Any, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(
        "<!doctype html><meta name=viewport content='width=device-width'><script>console.warn('a line')</script>"
        "<p style='width: 500px'>wide</p><img src='no.png'>"
    )
    found = " ".join(wrong(browser, page))
    assert "a line" in found
    assert "no.png" in found
    assert "pixels wide where there are 360" in found
    assert "where there are 1200" not in found


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_the_front_page_shows_three_things(size: tuple[int, int], browser: Any) -> None:
    """A recording, an attack and the paper's figure; at a desk all of them without scrolling."""
    opened(browser, INDEX.as_uri(), size)
    cards = browser.find_elements("css selector", ".front-card")
    assert [card.find_element("tag name", "strong").text for card in cards] == [
        "A real recording",
        "An attack",
        "The paper's lift-off",
    ]
    pictures = browser.execute_script(
        "return [...document.querySelectorAll('.front-card img')].map((one) => one.naturalWidth)"
    )
    assert len(pictures) == 2
    assert min(pictures) > 300
    if size == DESK:
        bottoms = [card.rect["y"] + card.rect["height"] for card in cards]
        assert max(bottoms) <= DESK[1]


def test_the_search_finds_a_page(browser: Any) -> None:
    opened(browser, (BUILT / "search.html").as_uri() + "?q=lift-off")
    browser.implicitly_wait(10)
    assert browser.find_elements("css selector", "#search-results li")
    assert browser.get_log("browser") == []
