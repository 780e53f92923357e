"""Write the part of `vestige run`'s output about failed checks, alarms, states and ranges in use.

The output has this part at level 2 or 3, or if the scenario has checks that the user wrote.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray

from vestige.campaign.levels import LevelVerdicts
from vestige.campaign.range_errors import recs_that_count, worst_of
from vestige.cli.campaigns.attack_report import range_words
from vestige.records import Status


def level_values(results: xarray.Dataset, found: LevelVerdicts) -> dict[str, Any]:
    """Return the outcome of a campaign at the level of the scenario, as values for JSON by name."""
    time_s = results["time_s"].values
    due = found.recs[:, None] & found.seen
    return {
        "level": found.level,
        "first_failures": {
            name: float(time_s[place]) for name, place in found.first_failures(np.ones(time_s.size, np.bool_))
        },
        "failures": {name: int(np.count_nonzero(failed)) for name, failed in found.failed.items() if failed.any()},
        "own_checks": {name: {"tests": made, "failed": failed} for name, (made, failed) in found.own_counts.items()},
        "not_run": list(found.not_run),
        "alarms": int(np.count_nonzero(found.begins)),
        "state": {
            status.name: int(np.count_nonzero((found.state == place) & due)) for place, status in enumerate(Status)
        },
        "exhaustive_searches": int(np.count_nonzero(found.searched)),
        "ranges_in_use": int(np.count_nonzero(np.isfinite(found.range_error_m))),
        "ranges_due": int(np.count_nonzero(due)),
        "ranges_of_the_earlier_signal": int(np.count_nonzero(found.earlier)),
        "worst_range_m": worst_of(found.range_error_m[recs_that_count(results)]),
    }


def level_lines(results: xarray.Dataset, found: LevelVerdicts) -> list[str]:
    """Return the outcome of a campaign at the level of the scenario as a few lines of text."""
    values = level_values(results, found)
    states = ", ".join(f"{count} {name}" for name, count in values["state"].items() if count)
    lines = [f"level {values['level']}: {values['alarms']} alarms; states at the RECS: {states}"]
    for name, first_s in values["first_failures"].items():
        lines.append(f"  {name} failed {values['failures'][name]} times, first at T = {first_s:g} s")
    lines += [
        f"  {name}, your own check: {one['failed']} of {one['tests']} tests failed"
        for name, one in values["own_checks"].items()
    ]
    if values["not_run"]:
        lines.append(f"  not run, because the results do not hold what the check needs: {', '.join(values['not_run'])}")
    lines.append(
        f"  ranges in use: {values['ranges_in_use']} of {values['ranges_due']}, "
        f"{values['ranges_of_the_earlier_signal']} of them from the earlier of two signals; "
        f"{range_words(values['worst_range_m'])}"
    )
    return lines
