"""Show the verdicts at the mitigation level of a run's scenario on the page of the run.

The stored results have the status of each epoch at the level of the scenario. A verdict of the page belongs to a RECS.
The verdict is the gravest status since the previous RECS, including every status between the two RECS
(`campaign/levels.py`).
"""

from __future__ import annotations

import numpy as np
import xarray

from vestige.campaign.levels import LevelVerdicts
from vestige.report.markup import Html, card, element, number, table


def level_cards(found: LevelVerdicts | None) -> list[Html]:
    """Return a card with the number of alarms that a user saw."""
    if found is None:
        return []
    return [card("alarms that a user saw", number(int(np.count_nonzero(found.begins))), "each shown for at least 90 s")]


def level_content(found: LevelVerdicts | None, results: xarray.Dataset) -> list[Html]:
    """Return a table with the tests, the false-alarm probability and the failures of each check of the level."""
    if found is None:
        return []
    time_s = results["time_s"].values
    first = dict(found.first_failures(np.ones(time_s.size, np.bool_)))
    rows = [
        (
            name,
            number(int(np.count_nonzero(tests))),
            number(found.budget[name].p_fa, 2) if name in found.budget else "–",
            number(int(np.count_nonzero(found.failed[name]))),
            f"T = {number(float(time_s[first[name]]), 5, 's')}" if name in first else "–",
        )
        for name, tests in found.tests.items()
        if tests.any()
    ]
    parts = [
        table(
            f"Checks of mitigation level {found.level}, and when they first failed",
            ("check", "tests", "budget of a test", "failed", "first failure"),
            rows,
        ),
        element(
            "p",
            "A verdict on this page is the gravest status since the previous RECS. The receiver shows its user the "
            "gravest status of the last 90 s. An alarm begins if there was no alarm before.",
        ),
    ]
    if found.not_run:
        parts.append(
            element("p", f"Not run, because the results do not hold what the check needs: {', '.join(found.not_run)}.")
        )
    return parts
