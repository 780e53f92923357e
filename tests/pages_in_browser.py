"""What tests of pages ask a browser: to open one, and what is wider than a phone."""

from __future__ import annotations

import json
from typing import Any

PHONE, DESK = (360, 740), (1200, 900)
# Elements that stand out to the right of the window and in no box that scrolls.
BEYOND = """
const scrolls = (one) => one && (getComputedStyle(one).overflowX === 'auto' || scrolls(one.parentElement));
return [...document.querySelectorAll('body *')]
  .filter((one) => one.getBoundingClientRect().right > innerWidth + 0.5 && !scrolls(one))
  .map((one) => one.outerHTML.slice(0, 80));
"""


def opened(browser: Any, address: str, size: tuple[int, int] = DESK, *, dark: bool = False) -> Any:
    """Open a page, the logs empty."""
    width, height = size
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": size == PHONE}
    scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": scheme})
    browser.get("about:blank")
    browser.get_log("browser")
    browser.get_log("performance")
    browser.get(address)
    return browser


def asked_for(browser: Any) -> list[str]:
    """Return the addresses that a browser has asked for since a page was opened, without those with their own data."""
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    asked = [one["params"]["request"]["url"] for one in messages if one["method"] == "Network.requestWillBeSent"]
    return [address for address in asked if not address.startswith("data:")]
