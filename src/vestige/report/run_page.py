"""Make the page of a run, with the question, the results, the figures, and the commands to repeat the run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray

from vestige.campaign.levels import highest_level, judged_between_recs, level_verdicts, verdicts_of_run
from vestige.campaign.outcomes import AttackReport, due_verdicts
from vestige.campaign.range_errors import worst_range_m
from vestige.campaign.statistics import Summary, summarise
from vestige.campaign.store.attributes import attributes_of, scenario_of, scenario_text
from vestige.campaign.verdicts import VerdictCounts, range_limit_m, verdict_counts
from vestige.errors import VestigeError
from vestige.plots.epochs import select
from vestige.records import Status
from vestige.report.markup import Html, card, element, figure, joined, number, section, table
from vestige.report.page import Page
from vestige.report.run_attack import attack_cards, attack_content, attack_reports
from vestige.report.run_checks import checks_section, false_alarms_section
from vestige.report.run_drawings import run_drawings
from vestige.report.run_levels import level_cards, level_content
from vestige.report.run_scenario import reproduce_section, scenario_section
from vestige.scenario.stored import StoredScenario

_NEEDED = (
    "status", "taps", "noise_power", "range_offset_m", "tap_index", "time_s", "svid", "detector", "recs", "check",
    "check_result", "check_threshold", "range_in_use_m", "range_is_earlier", "e1_pseudorange_m",
)  # fmt: skip


def run_page(results: xarray.Dataset, name: str, *, question: str = "") -> Page:
    """Return the page of a run.

    Results with a coordinate `epoch` are from a run that has not ended. `question` replaces the usual question of the
    page.

    The function raises `VestigeError` if the results are not from `vestige run`, or have no due verdict. The error is
    also raised if the code of a user's class has changed since the run.
    """
    scenario = _scenario(results)
    sky = scenario.constellation is not None
    own = scenario.processor.checks
    checks = tuple(level_verdicts(results, (highest_level(results),))[0].checks.values()) if sky or own else ()
    stored, (results, of_level) = results, verdicts_of_run(results)
    counts = verdict_counts(results)
    found = {str(name): summarise(results, str(name)) for name in results["detector"].values}
    attacks = attack_reports(results, scenario)
    data, thinned = run_drawings(results, checks)
    body = (
        _contents(),
        _answer(results, scenario, counts, found, attacks, level_cards(of_level)),
        section("verdicts", "Verdicts over time", _status_key(counts), *_timeline(data)),
        section("correlators", "Output of the correlators", *_waterfall(data)),
        section("offsets", "Range offset of both detectors", *_offsets(found, data, range_limit_m(results))),
        *([section("attack", "Under attack", *attack_content(attacks))] if attacks else ()),
        checks_section(results, scenario, checks, level_content(of_level, results)),
        *([section("position", "Position", *_position())] if sky else ()),
        false_alarms_section(results, counts, checks),
        scenario_section(scenario_text(results)),
        reproduce_section(stored, name, thinned, data),
    )
    return Page(
        title=f"{name}: {_subject(scenario, results.sizes['satellite'])}",
        question=question or _question(scenario),
        body=body,
        version=attributes_of(results).vestige_version,
        data=data,
    )


def _scenario(results: xarray.Dataset) -> StoredScenario:
    """Return the scenario of the results.

    The function raises `VestigeError` if the results are not from `vestige run`, or have no due verdict.
    """
    for name in _NEEDED:
        if name not in results.variables:
            raise VestigeError(f"results of a campaign: found no {name}, expected results of `vestige run`")
    attributes_of(results)
    scenario = scenario_of(results)
    if not results.sizes["epoch"] or not due_verdicts(results).any():
        raise VestigeError("results of a campaign: found no epoch with a verdict, expected one at least")
    select(results, svid=int(results["svid"].values[0]))  # wrong axes or times raise an error
    return scenario


def _subject(scenario: StoredScenario, n_satellites: int) -> str:
    place = "one satellite" if n_satellites == 1 else f"{n_satellites} satellites"
    kinds = ", ".join(dict.fromkeys(attack.kind for attack in scenario.attack))
    if kinds:
        return f"{place} under attack ({kinds})"
    return place if scenario.receiver.signal else "noise alone"


def _question(scenario: StoredScenario) -> str:
    if scenario.attack:
        return "What does the receiver say while it is under attack, and which signal does it follow?"
    if not scenario.receiver.signal:
        return "How often is noise alone taken for the signal?"
    if scenario.constellation:
        return "Without an attack: which satellites are authenticated, where is the receiver, which checks fail?"
    return "Without an attack: how often is the true signal found, and how far is it from the prediction?"


def _contents() -> Html:
    names = {
        "verdicts": "Verdicts",
        "correlators": "Correlators",
        "offsets": "Range offsets",
        "checks": "Checks",
        "false-alarms": "False alarms",
        "scenario": "Scenario",
        "reproduce": "Reproduce",
    }
    links = [element("li", element("a", text, href=f"#{name}")) for name, text in names.items()]
    return element("nav", element("ul", *links), aria_label="Sections")


def _answer(
    results: xarray.Dataset,
    scenario: StoredScenario,
    counts: VerdictCounts,
    found: Mapping[str, Summary],
    attacks: Mapping[str, Mapping[str, AttackReport]],
    of_level: list[Html],
) -> Html:
    """Return the cards with the numbers that answer the question of the page."""
    chosen = scenario.processor.detector
    summary = found[chosen]
    undecided = counts.of[Status.NOT_AVAILABLE]
    cards = [
        card(
            "verdicts that are AUTHENTIC",
            _share(counts.of[Status.AUTHENTIC], counts.due),
            f"{number(counts.of[Status.AUTHENTIC])} of {number(counts.due)}"
            + (f"; {number(undecided)} not available" if undecided else ""),
        )
    ]
    for detector, one in found.items():
        rate = one.detections
        word = "missed" if scenario.receiver.signal else "detected in noise"
        count = one.misses if scenario.receiver.signal else rate.successes
        low, high = (1 - rate.high, 1 - rate.low) if scenario.receiver.signal else (rate.low, rate.high)
        small = f"of {number(rate.trials)}; {number(low, 2)} to {number(high, 2)} (95 %)"
        cards.append(card(f"{word} by the {detector} detector", number(count), small))
    if scenario.attack and attacks:
        cards += attack_cards(attacks, chosen)
    elif scenario.receiver.signal:
        spread = f"mean {number(summary.range_offset_mean_m, 2, 'm')}, {chosen} detector"
        cards.append(card("range offset, 1σ", number(summary.range_offset_std_m, 3, "m"), spread))
    cards += of_level
    if scenario.attack or of_level:
        in_use = int(np.count_nonzero(np.isfinite(results["range_in_use_m"].values)))
        small = f"{number(in_use)} of {number(counts.due)} ranges were in use"
        cards.append(card("largest range error in use", number(worst_range_m(results), 4, "m"), small))
    alarms = counts.false_alarms
    if alarms.trials:
        a_day, low, high = counts.false_alarms_a_day
        small = (
            f"{number(low, 2)} to {number(high, 2)} (95 %); {number(alarms.successes)} in {number(alarms.trials)} RECS"
        )
        cards.append(card("false alarms a day and satellite", number(a_day, 2), small))
    return joined([_unfinished(results, scenario), element("dl", *cards, class_="cards")])


def _unfinished(results: xarray.Dataset, scenario: StoredScenario) -> Html:
    if "epoch" not in results.coords:
        return Html("")
    text = f"This run has not ended: {results.sizes['epoch']} of {scenario.epochs} epochs are stored."
    if judged_between_recs(results):
        text += " Until then a verdict does not include failures of checks between two RECS."
    return element("p", text, class_="notice")


def _status_key(counts: VerdictCounts) -> Html:
    """Return a table with the meaning and the colour of each status, and the number of verdicts with this status."""
    rows = []
    for status in Status:
        swatch = element("span", "", class_="swatch", style=f"--swatch: var(--{status.value.replace(' ', '-')})")
        name = joined([swatch, status.value, element("span", _MEANINGS[status], class_="detail")])
        rows.append((name, number(counts.of[status]), _share(counts.of[status], counts.due)))
    caption = f"{number(counts.due)} verdicts were due, {number(counts.attacked)} of them under attack"
    return table(caption, ("verdict", "epochs", "share"), rows)


_MEANINGS = {
    Status.AUTHENTIC: "no check of the level failed, and the range of E6 agrees with E1",
    Status.SUSPECT: "another check of the level failed",
    Status.SPOOFED: "the range of E6 disagrees with E1, or a satellite was found twice",
    Status.NOT_DETECTED: "no encrypted signal where E1 predicts it: an alarm",
    Status.NOT_AVAILABLE: "no evidence: the RECS or its key is missing, or the signal is too weak",
}


def _share(count: int, of: int) -> str:
    return f"{100 * count / of:.4g}\N{NO-BREAK SPACE}%" if of else "–"


def _timeline(data: Mapping[str, Any]) -> list[Html]:
    several = len(data["satellites"]) > 1
    lanes = (
        "One line for each satellite; alarms have higher marks."
        if several
        else ("One line for each verdict, with a mark where it occurred.")
    )
    longest = max(one["stretches"]["length"] for one in data["satellites"])
    each = "each mark is one epoch" if longest == 1 else f"each mark stands for up to {longest} epochs"
    return [
        figure(
            "timeline",
            "Time-line",
            "Verdicts against time; the table above has their numbers.",
            f"{lanes} The figure includes every epoch: {each}.",
        )
    ]


def _waterfall(data: Mapping[str, Any]) -> list[Html]:
    options = [element("option", one["name"], value=place) for place, one in enumerate(data["satellites"])]
    choice = element("label", "Satellite ", element("select", *options, id="satellite")) if len(options) > 1 else ""
    steps = [
        element("button", "‹ alarm", type="button", id="alarm-before", aria_label="Alarm before this epoch"),
        element("button", "alarm ›", type="button", id="alarm-after", aria_label="Alarm after this epoch"),
    ]
    slider = element("input", type="range", id="epoch", min=0, max=0, value=0, step=1, aria_label="Epoch")
    controls = element("div", choice, slider, *steps, class_="controls")
    readout = element("output", "", id="readout", for_="epoch", aria_live="polite")
    return [
        element(
            "p",
            "Drag over the map, or move the slider (arrow keys step epoch by epoch). The correlators of the chosen "
            "epoch are below the map. Every correlator is one possible delay of the encrypted signal on E6 against the "
            "prediction from E1.",
        ),
        figure(
            "waterfall",
            "All epochs",
            "Map of the correlators' magnitude: time from left to right, correlator offset upwards. "
            "The slider below chooses an epoch.",
            "Brighter is stronger (mean of each stretch). Marks above the map: alarms.",
        ),
        controls,
        readout,
        figure(
            "epoch",
            "The chosen epoch",
            "Magnitude of each correlator in the chosen epoch, the threshold, and what both "
            "detectors found; the line above has the same in words.",
            "Dashed: the threshold. Triangles: the correlation that each detector found. "
            + (
                "Vertical lines: true signal and spoofing signal, which the receiver does not know."
                if "true_m" in data["satellites"][0]
                else ""
            ),
        ),
    ]


def _offsets(found: Mapping[str, Summary], data: Mapping[str, Any], limit_m: float) -> list[Html]:
    boxes = [
        element(
            "label",
            element("input", type="checkbox", checked="", data_detector=name),
            " ",
            element("span", "", class_="swatch", style=f"--swatch: var(--{name})"),
            f" {name} detector",
        )
        for name in found
    ]
    points = sorted({p for one in found.values() for p in one.percentiles_m})
    rows = [
        (
            f"{name} detector",
            number(one.misses),
            number(one.range_offset_mean_m, 3, "m"),
            number(one.range_offset_std_m, 3, "m"),
            *(number(one.percentiles_m[p], 3, "m") for p in points),
        )
        for name, one in found.items()
    ]
    head = ("", "missed", "mean", "1σ", *(f"{p:g} %" for p in points))
    truth = " Lines: the spoofing signals." if "true_m" in data["satellites"][0] else ""
    parts = [
        element(
            "p",
            "The range offset is the delay of E6 after the prediction from E1, for each detector. The range check "
            "passes offsets "
            f"within ±{number(limit_m, 3, 'm')}.",
        ),
        element("div", *boxes, class_="controls"),
        figure(
            "offsets",
            "Against time",
            "Range offsets against time, of both detectors; the table below has their numbers.",
            f"Dots: single epochs. Dashed: limits of the range check. Ticks below: nothing detected.{truth}",
        ),
    ]
    if data["histogram"]:
        parts.append(
            figure(
                "histogram",
                "Histogram",
                "Histogram of the range offsets of all epochs, in log scale.",
                "All epochs of all satellites.",
            )
        )
    return [*parts, table("Range offset, percentiles of the detections", head, rows)]


def _position() -> list[Html]:
    return [
        figure(
            "position",
            "Error of the fix",
            "Error of the position fixes along east, north and up against time.",
            "Grey: fix of all satellites, at every epoch. Blue: fix of the authenticated satellites alone.",
        )
    ]
