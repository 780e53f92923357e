"""Write the attack section of `vestige run`'s output: effect on each satellite, and outcome of each detector."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import xarray

from vestige.campaign.outcomes import AttackReport, DetectedSignal, report
from vestige.campaign.statistics import detectors_of

_NAMES = {
    DetectedSignal.TRUE: "the true signal",
    DetectedSignal.SPOOFER: "the spoofing signal",
    DetectedSignal.MIXED: "both in one peak",
    DetectedSignal.NONE: "nothing",
}


def attack_values(results: xarray.Dataset) -> list[dict[str, Any]]:
    """Return the attack reports of the satellites as values for JSON; the list is empty without an attack."""
    return [
        {"svid": svid}
        | {
            name: asdict(one) | {"shares": {kind.name: share for kind, share in one.shares.items()}}
            for name, one in reports.items()
        }
        for svid, reports in _reports(results)
    ]


def attack_lines(results: xarray.Dataset) -> list[str]:
    """Return lines of text for each satellite with a spoofing signal: about the attack, and about each detector.

    If no satellite has a spoofing signal, because the attack is only noise, the lines are about all satellites.
    """
    aimed = results["svid"].values[results["truth_spoofed"].any("epoch").values] if "truth_spoofed" in results else ()
    return [
        line
        for svid, reports in _reports(results)
        if svid in aimed or not len(aimed)
        for line in (_attack_line(svid, reports), *map(_detector_line, reports.values()))
    ]


def _reports(results: xarray.Dataset) -> Iterator[tuple[int, dict[str, AttackReport]]]:
    for satellite, svid in enumerate(results["svid"].values.tolist()):
        reports = {name: report(results, name, satellite=satellite) for name in detectors_of(results)}
        found = {name: one for name, one in reports.items() if one is not None}
        if found:
            yield svid, found


def _attack_line(svid: int, reports: dict[str, AttackReport]) -> str:
    one = next(iter(reports.values()))  # the reports of all detectors have the same verdicts and the same E1 results
    alarm = "no alarm" if math.isnan(one.time_to_detect_s) else f"first alarm after {one.time_to_detect_s:g} s"
    return (
        f"attack on E{svid:02d}: {one.epochs} epochs from {one.first_s:g} s on, {alarm}; "
        f"E1 captured in {100 * one.e1_captured:.0f} %, {range_words(one.worst_range_m)}"
    )


def range_words(worst_m: float) -> str:
    """Return the largest error of a range in use as text; `worst_m` is NaN if no range was in use."""
    return "no range in use" if math.isnan(worst_m) else f"largest range error in use {worst_m:+.1f} m"


def _detector_line(one: AttackReport) -> str:
    shares = ", ".join(f"{text} {100 * one.shares[kind]:.1f} %" for kind, text in _NAMES.items())
    if math.isnan(one.time_to_mitigate_s):
        return f"  {one.detector:8s} found {shares}; it did not return to the true signal for the rest of the attack"
    returned = f"it returned to the true signal after {one.time_to_mitigate_s:g} s and stayed"
    return f"  {one.detector:8s} found {shares}; {returned}"
