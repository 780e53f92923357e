"""Pages in a real browser, without a head and without a network: drawn, readable on a phone, silent."""

from __future__ import annotations

from typing import Any

import pytest

from pages_in_browser import BEYOND, DESK, PHONE, asked_for, opened
from report_builder import LIFT_OFF, QUICK, SKY, made, threat_folder
from vestige.campaign.store.results import open_results
from vestige.report import run_page, threat_page, write_page
from vestige.threats.table import TABLE

webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium, of the extra dev")

RUNS = {"quick": QUICK, "liftoff_sudden": LIFT_OFF, "sky": SKY}
PAGES = [*RUNS, "threats"]
# How many colours a canvas has, and the text of all its pixels.
PIXELS = """
const canvas = document.querySelector(`canvas[data-figure=${arguments[0]}]`);
const all = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
const colours = new Set(new Uint32Array(all.buffer));
let hash = 0;
for (const byte of all) hash = (hash * 31 + byte) | 0;
return [colours.size, hash];
"""

NEXT_FRAME = "requestAnimationFrame(() => requestAnimationFrame(arguments[0]))"


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The address of each page."""
    folder = tmp_path_factory.mktemp("pages")
    made_pages = {
        name: run_page(open_results(made(folder / name, name, *settings)).dataset.load(), f"{name}-{60 * 'x'}")
        for name, settings in RUNS.items()
    }
    table = threat_folder(folder / "threats", {}, {"scene": "two", "level_1": "DIFFERS", "note": "why"}) / TABLE
    made_pages["threats"] = threat_page(table, "threats")
    for name, page in made_pages.items():
        write_page(page, folder / f"{name}.html")
    return {name: (folder / f"{name}.html").as_uri() for name in made_pages}


def figures(browser: Any) -> list[str]:
    return [canvas.get_attribute("data-figure") for canvas in browser.find_elements("css selector", "canvas")]


def pixels(browser: Any, figure: str) -> tuple[int, int]:
    colours, digest = browser.execute_script(PIXELS, figure)
    return colours, digest


def shown(browser: Any) -> str:
    return str(browser.find_element("id", "readout").text)


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_silent_and_asks_for_nothing(
    name: str, size: tuple[int, int], browser: Any, pages: dict[str, str]
) -> None:
    opened(browser, pages[name], size)
    assert browser.get_log("browser") == []
    assert asked_for(browser) == [pages[name]]


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
@pytest.mark.parametrize("name", RUNS)
def test_every_figure_is_drawn(
    name: str, size: tuple[int, int], dark: bool, browser: Any, pages: dict[str, str]
) -> None:
    opened(browser, pages[name], size, dark=dark)
    found = figures(browser)
    assert {"timeline", "waterfall", "epoch", "offsets", "histogram"} <= set(found)
    assert {"checks", "position"} <= set(found) or name != "sky"
    for figure in found:
        colours, _ = pixels(browser, figure)
        assert colours > (50 if figure == "waterfall" else 5), figure


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("name", PAGES)
def test_a_phone_shows_the_whole_width(name: str, dark: bool, browser: Any, pages: dict[str, str]) -> None:
    opened(browser, pages[name], PHONE, dark=dark)
    assert browser.execute_script("return document.documentElement.scrollWidth") == PHONE[0]
    assert browser.execute_script(BEYOND) == []
    smallest = browser.execute_script("""
        return Math.min(...[...document.querySelectorAll('p, td, th, dd, li, code')]
          .filter((one) => one.textContent.trim()).map((one) => parseFloat(getComputedStyle(one).fontSize)));
    """)
    assert smallest >= 12


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("name", PAGES)
def test_text_stands_out_from_the_page(name: str, dark: bool, browser: Any, pages: dict[str, str]) -> None:
    """A contrast of 4.5 at least, as WCAG 2 wants it of text, in both themes."""
    opened(browser, pages[name], PHONE, dark=dark)
    weak = browser.execute_script("""
        const parts = (text) => text.match(/[\\d.]+/g).map(Number);
        const light = (colour) => {
          const [r, g, b] = parts(colour).map((part) => part / 255)
            .map((part) => (part <= 0.03928 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
          return 0.2126 * r + 0.7152 * g + 0.0722 * b;
        };
        const behind = (one) => {
          const colour = getComputedStyle(one).backgroundColor;
          return parts(colour)[3] === 0 ? behind(one.parentElement) : colour;
        };
        return [...document.querySelectorAll('body *')]
          .filter((one) => [...one.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim()))
          .filter((one) => !['SCRIPT', 'CANVAS', 'NOSCRIPT', 'OPTION'].includes(one.tagName) && !one.disabled)
          .map((one) => {
            const pair = [light(getComputedStyle(one).color), light(behind(one))].sort((a, b) => b - a);
            return [(pair[0] + 0.05) / (pair[1] + 0.05), one.outerHTML.slice(0, 90)];
          })
          .filter(([contrast]) => contrast < 4.5);
    """)
    assert weak == []


def test_the_slider_changes_the_picture(browser: Any, pages: dict[str, str]) -> None:
    opened(browser, pages["liftoff_sudden"])
    slider = browser.find_element("id", "epoch")
    first, before = shown(browser), [pixels(browser, figure) for figure in ("waterfall", "epoch")]
    assert first.startswith("E11, T = 0 s: ")
    slider.send_keys("\ue014" * 5)  # arrow to the right
    assert shown(browser).startswith("E11, T = 5 s: ")
    assert slider.get_attribute("aria-valuetext") == shown(browser)
    assert all(pixels(browser, figure) != old for figure, old in zip(("waterfall", "epoch"), before, strict=True))
    slider.send_keys("\ue012" * 5)  # and back
    assert (shown(browser), [pixels(browser, figure) for figure in ("waterfall", "epoch")]) == (first, before)


def test_the_curve_is_that_of_the_chosen_epoch(browser: Any, pages: dict[str, str]) -> None:
    """Each correlator is a dot in the colour of the text, where its magnitude belongs."""
    opened(browser, pages["quick"])
    browser.find_element("id", "epoch").send_keys("\ue014" * 7)
    missing = browser.execute_script("""
        const canvas = document.querySelector('canvas[data-figure=epoch]');
        const of = DATA.satellites[0];
        const taps = rescaled(of.taps, DATA.top_sigma);
        const [wide, high, n] = [canvas.width - 54, canvas.height - 44, DATA.offsets_m.length];
        return DATA.offsets_m.filter((offset, tap) => {
          const x = 46 + ((tap + 0.5) / n) * wide;
          const y = 10 + high * (1 - taps[7 * n + tap] / (1.12 * DATA.top_sigma));
          const pixel = canvas.getContext('2d').getImageData(Math.round(x), Math.round(y) - 1, 1, 1).data;
          return pixel.slice(0, 3).join() !== '27,31,36';
        });
    """)
    assert missing == []


def test_the_time_line_has_the_colours_of_the_verdicts(browser: Any, pages: dict[str, str]) -> None:
    opened(browser, pages["liftoff_sudden"])
    counts = browser.execute_script("""
        const canvas = document.querySelector('canvas[data-figure=timeline]');
        const all = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
        const counts = {};
        for (let i = 0; i < all.length; i += 4) {
          const name = all.slice(i, i + 3).join();
          counts[name] = (counts[name] || 0) + 1;
        }
        return DATA.statuses.map((status) => {
          const parts = colour(status).match(/[0-9a-f]{2}/g).map((part) => parseInt(part, 16));
          return counts[parts.join()] || 0;
        });
    """)
    bits = browser.execute_script("return unpacked(DATA.satellites[0].statuses).reduce((all, bits) => all | bits, 0)")
    assert [count > 10 for count in counts] == [bool(bits >> place & 1) for place in range(5)]
    assert counts[0] == max(counts)


def test_dragging_over_the_map_chooses_the_epoch(browser: Any, pages: dict[str, str]) -> None:
    opened(browser, pages["liftoff_sudden"])
    canvas = browser.find_element("css selector", "canvas[data-figure=waterfall]")
    slider = browser.find_element("id", "epoch")
    chosen = []
    for offset in (0, -200, 250):
        chain = webdriver.ActionChains(browser)
        chain.move_to_element(canvas).click_and_hold().move_by_offset(offset, 0).release().perform()
        chosen.append(int(slider.get_attribute("value")))
        webdriver.ActionChains(browser).move_by_offset(5, 0).perform()
        assert int(slider.get_attribute("value")) == chosen[-1]  # the button is up: nothing is dragged
    a_pixel = 300 / (canvas.size["width"] - 54)  # epochs; the frame takes 54 pixels
    assert chosen[1] - chosen[0] == pytest.approx(-200 * a_pixel, abs=1)
    assert chosen[2] - chosen[0] == pytest.approx(250 * a_pixel, abs=1)


def test_the_buttons_go_from_alarm_to_alarm(browser: Any, pages: dict[str, str]) -> None:
    opened(browser, pages["quick"])
    browser.find_element("id", "alarm-after").click()
    first = shown(browser)
    assert "not detected" in first or "spoofed" in first
    browser.find_element("id", "alarm-after").click()
    assert shown(browser) != first
    browser.find_element("id", "alarm-before").click()
    assert shown(browser) == first


def test_another_satellite_has_other_correlators(browser: Any, pages: dict[str, str]) -> None:
    opened(browser, pages["sky"])
    browser.find_element("id", "epoch").send_keys("\ue014" * 3)
    before = pixels(browser, "waterfall")
    assert shown(browser).startswith("E06, T = 30 s: ")
    browser.find_element("id", "satellite").send_keys("E08")
    assert shown(browser).startswith("E08, T = 30 s: ")
    assert pixels(browser, "waterfall") != before


def test_a_detector_can_be_left_out(browser: Any, pages: dict[str, str]) -> None:
    opened(browser, pages["liftoff_sudden"])
    before = pixels(browser, "offsets"), pixels(browser, "histogram")
    box = browser.find_element("css selector", "input[data-detector=maximum]")
    box.click()
    without = pixels(browser, "offsets"), pixels(browser, "histogram")
    assert all(new != old for new, old in zip(without, before, strict=True))
    box.click()
    assert (pixels(browser, "offsets"), pixels(browser, "histogram")) == before


def test_figures_follow_the_theme_and_the_width(browser: Any, pages: dict[str, str]) -> None:
    opened(browser, pages["quick"])
    light, wide = pixels(browser, "timeline"), browser.find_element("css selector", "canvas").size["width"]
    scheme = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", scheme)
    browser.execute_async_script(NEXT_FRAME)
    assert pixels(browser, "timeline") != light
    metrics = {"width": 500, "height": 900, "deviceScaleFactor": 2, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    canvas = browser.find_element("css selector", "canvas")
    browser.execute_async_script(NEXT_FRAME)
    assert canvas.size["width"] < 500 < wide
    assert int(canvas.get_attribute("width")) == pytest.approx(2 * canvas.size["width"], abs=2)


def test_the_scenario_can_be_saved(browser: Any, pages: dict[str, str]) -> None:
    opened(browser, pages["quick"])
    link = browser.find_element("link text", "Save as scenario.toml")
    assert link.get_attribute("download") == "scenario.toml"
    text = browser.execute_script("return document.querySelector('#scenario pre').textContent")
    assert (
        browser.execute_script("return decodeURIComponent(arguments[0].href.split(',').slice(1).join(','))", link)
        == text
    )


def test_without_scripts_the_page_says_so(browser: Any, pages: dict[str, str]) -> None:
    browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        opened(browser, pages["quick"])
        assert "drawn by a script in it, which does not run here" in browser.find_element("tag name", "body").text
    finally:
        browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})
