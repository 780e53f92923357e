"""Show the scenario of a run as a file, and all data needed to repeat the results, in sections of the run's page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

import xarray

from vestige.campaign.store.attributes import attributes_of
from vestige.campaign.verdicts import results_digest
from vestige.report.markup import Html, element, section, table
from vestige.scenario.toml.campaign_toml import campaign_toml


def scenario_section(text: str) -> Html:
    """Return the section with the scenario as TOML with all defaults, and a link that saves the TOML file.

    `text` is the scenario as JSON, as the results contain it.
    """
    toml = campaign_toml(text)
    save = element(
        "a",
        "Save as scenario.toml",
        href=f"data:application/toml;charset=utf-8,{quote(toml)}",
        download="scenario.toml",
    )
    return section(
        "scenario",
        "The scenario",
        element("p", "With all defaults written out. ", save, "."),
        element("details", element("summary", "Show the scenario"), _code(toml, "Scenario as TOML"), open=""),
    )


def reproduce_section(
    results: xarray.Dataset, name: str, thinned: Mapping[str, Mapping[str, int]], data: Mapping[str, Any]
) -> Html:
    """Return the section with the commands, the origin of the results, and the epochs of the run that are drawn."""
    attributes = attributes_of(results)
    store = f"{re.sub(r'[^A-Za-z0-9_.-]', '_', name)}.zarr"
    commands = f"vestige run scenario.toml -o {store}\nvestige report {store} -o report.html"
    rows = [
        ("vestige", attributes.vestige_version),
        ("seed", attributes.seed),
        ("fidelity", attributes.fidelity),
        *([("processor", attributes.processor)] if attributes.processor else ()),
        ("epochs", results.sizes["epoch"]),
        ("SHA-256 of the scenario", attributes.scenario_digest),
        ("SHA-256 of all results", results_digest(results)),
    ]
    same = "The same version and scenario give the same bits, however many workers there are"
    same += ", on processors of this kind." if attributes.processor else "."
    return section(
        "reproduce",
        "How to reproduce the results",
        element("p", f"{same} A report of these results shows the same digests."),
        _code(commands, "Commands"),
        table(
            "Origin of the results",
            ("", "value"),
            [(key, element("code", value)) for key, value in rows],
            numbers_from=99,
        ),
        element("h3", "What is drawn"),
        element(
            "p",
            "Tables, statistics, time-lines, map and histogram include all epochs. A mark may stand for a stretch "
            "of epochs. "
            "The slider and the dots show these single epochs:",
        ),
        element("ul", *(element("li", line) for line in _drawn(thinned, data))),
    )


def _drawn(thinned: Mapping[str, Mapping[str, int]], data: Mapping[str, Any]) -> list[str]:
    """Return sentences that say which epochs are drawn individually."""
    lines: dict[str, list[str]] = {}
    for satellite, every in thinned.items():
        if every["epochs"] == 1:
            text = "every epoch with a verdict"
        else:
            first, *rest = (every_kth(kind, k) for kind, k in every.items())
            text = f"{first}; besides, {', '.join(rest)}"
        lines.setdefault(text, []).append(satellite)
    drawn = [f"{', '.join(satellites)}: {text}." for text, satellites in lines.items()]
    for fix, one in data.get("position", {}).get("fixes", {}).items():
        drawn.append(f"position fixes, {fix}: {every_kth('fixes', one['every'])}.")
    return drawn


def every_kth(kind: str, k: int) -> str:
    """Return a text which says that every k-th epoch of a kind is drawn."""
    if k == 1:
        return f"all {kind}"
    ending = {1: "st", 2: "nd", 3: "rd"}.get(k % 10 if k % 100 not in (11, 12, 13) else 0, "th")
    return f"every {k}{ending} of the {kind}"


def _code(text: str, label: str) -> Html:
    return element("pre", element("code", text), tabindex=0, role="region", aria_label=label)
