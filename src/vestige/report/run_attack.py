"""Show the outcome of the attack on each satellite in a section of a run's page."""

from __future__ import annotations

import math
from collections.abc import Mapping

import xarray

from vestige.campaign.outcomes import AttackReport, DetectedSignal, report
from vestige.report.markup import Html, card, element, number, table
from vestige.scenario.stored import StoredScenario


def attack_reports(results: xarray.Dataset, scenario: StoredScenario) -> dict[str, dict[str, AttackReport]]:
    """Return the outcome of the attack by satellite and detector."""
    if not scenario.attack:
        return {}
    reports: dict[str, dict[str, AttackReport]] = {}
    for place, svid in enumerate(results["svid"].values.tolist()):
        for detector in map(str, results["detector"].values):
            if (one := report(results, detector, satellite=place)) is not None:
                reports.setdefault(f"E{svid:02d}", {})[detector] = one
    return reports


def attack_cards(attacks: Mapping[str, Mapping[str, AttackReport]], chosen: str) -> list[Html]:
    """Return a card with the time from the start of the attack to the first alarm on any satellite.

    `chosen` is the name of the detector that gives the verdicts.
    """
    one = [reports[chosen] for reports in attacks.values()]
    alarms_s = [report.time_to_detect_s for report in one if math.isfinite(report.time_to_detect_s)]
    caught = f"on {len(alarms_s)} of {len(one)} attacked satellites" if len(one) > 1 else "after the attack began"
    return [
        card(
            "first alarm under attack", number(min(alarms_s, default=math.nan), 4, "s") if alarms_s else "none", caught
        ),
    ]


def attack_content(attacks: Mapping[str, Mapping[str, AttackReport]]) -> list[Html]:
    """Return a paragraph and a table with the outcome of the attack for each satellite and detector."""
    words = {
        DetectedSignal.TRUE: "the true signal",
        DetectedSignal.SPOOFER: "the spoofing signal",
        DetectedSignal.MIXED: "both in one peak",
        DetectedSignal.NONE: "nothing",
    }
    head = (
        "satellite, detector",
        *(f"found {word}" for word in words.values()),
        "first alarm",
        "return to the true signal",
        "largest range error in use",
        "E1 captured",
    )
    rows = [
        (
            f"{satellite}, {name}",
            *(f"{100 * one.shares[kind]:.1f} %" for kind in words),
            _after(one.time_to_detect_s),
            _after(one.time_to_mitigate_s),
            number(one.worst_range_m, 4, "m"),
            f"{100 * one.e1_captured:.0f} %",
        )
        for satellite, reports in attacks.items()
        for name, one in reports.items()
    ]
    return [
        element(
            "p",
            "The receiver does not know the true signals of this table. The table says which signal each detector "
            "found "
            "during the "
            "attack. Two signals less than a chip (58.6 m) apart are one peak. Times count from the start of the "
            "attack. "
            "Alarms and ranges in use come from the verdicts.",
        ),
        table("Outcome of the attack", head, rows),
    ]


def _after(time_s: float) -> str:
    return "never" if math.isnan(time_s) else f"after {number(time_s, 5, 's')}"
