"""OSNMA over a campaign of a sky, subframe by subframe: do keys still come, and do all pages come.

The checks are made at the first epoch after the end of a subframe. A key counts as received if one satellite brought
all its pages. What a second channel knows was due are the pages of all satellites in view: a weak jammer that takes
those of the low satellites leaves the keys of the high ones, and only the second check has something to see. The third
compares the pages that came with those of the second channel: they differ where E1 tracking is on a counterfeit with
data of the attacker's own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int64

from vestige.acas_processor.checks.check import Check
from vestige.acas_processor.checks.osnma import (
    OsnmaAgreementMonitor,
    OsnmaAvailabilityMonitor,
    OsnmaReceptionMonitor,
)
from vestige.campaign.track import Track, values
from vestige.receiver.osnma_reception import KEY_PAGES, PAGES, of_mask, pages_due

if TYPE_CHECKING:
    import xarray

WINDOW = 10  # subframes that the availability looks back


def osnma_tracks(
    results: xarray.Dataset, week_s: Float[np.ndarray, " n"], p_fa: Callable[[str], float]
) -> tuple[Track, ...]:
    """Return availability of keys, reception of pages and their agreement, NaN between the ends of subframes.

    Parameters
    ----------
    results
        Of a campaign of a sky.
    week_s
        Its epochs in s after the start of the week.
    p_fa
        Budget of one test of the first two by name, which keep below it.
    """
    n = week_s.size
    epoch, seen, received, differs = _subframes(results, week_s)
    keys = np.any((received & ~differs)[:, list(KEY_PAGES)].all(axis=1), axis=1)
    due = PAGES * np.count_nonzero(seen, axis=1)
    came = np.count_nonzero(received & seen[:, None], axis=(1, 2))
    wrong = np.count_nonzero(received & differs & seen[:, None], axis=(1, 2))
    availability = OsnmaAvailabilityMonitor(p_fa=p_fa("OSNMA availability"))
    assisted = OsnmaReceptionMonitor(p_fa=p_fa("OSNMA reception"))
    window = np.minimum(np.arange(epoch.size) + 1, WINDOW)
    missing = np.cumsum(~keys)
    missing[WINDOW:] -= np.cumsum(~keys)[:-WINDOW]
    parts: tuple[tuple[Check, Int64[np.ndarray, " k"], Int64[np.ndarray, " k"], list[int]], ...] = (
        (availability, missing, window, [availability.threshold(size) for size in window.tolist()]),
        (assisted, due - came, due, [assisted.threshold(size) for size in due.tolist()]),
        (OsnmaAgreementMonitor(), wrong, came, [0] * came.size),
    )
    made = []
    for monitor, count, of, limits in parts:
        statistic, threshold = np.full(n, np.nan), np.full(n, np.nan)
        enough = np.array(limits, dtype=np.int64) < of  # otherwise no count would say anything
        statistic[epoch[enough]], threshold[epoch[enough]] = count[enough], np.array(limits)[enough]
        made.append(
            Track(
                name=monitor.name,
                unit=monitor.unit,
                p_fa=monitor.p_fa,
                statistic=statistic,
                threshold=threshold,
                exact=False,
            )
        )
    return tuple(made)


def _subframes(
    results: xarray.Dataset, week_s: Float[np.ndarray, " n"]
) -> tuple[Int64[np.ndarray, " k"], Bool[np.ndarray, "k m"], Bool[np.ndarray, "k 15 m"], Bool[np.ndarray, "k 15 m"]]:
    """Return of each whole subframe the epoch after it, satellites in view, pages received, and which are not true."""
    interval_s = float(week_s[1] - week_s[0]) if week_s.size > 1 else 1.0
    page = pages_due(week_s, interval_s)
    row, place = np.nonzero(page >= 0)
    number = page[row, place] // PAGES
    first, last = (int(number.min()), int(number.max())) if number.size else (0, -1)
    count = last - first + 1
    mask = values(results, "osnma_pages", "epoch", "satellite").astype(np.int16)
    of_attacker = values(results, "osnma_differs", "epoch", "satellite").astype(bool)
    in_view = np.isfinite(values(results, "elevation_deg", "epoch", "satellite"))
    known = np.zeros((count, PAGES), bool)
    epoch = np.zeros((count, PAGES), np.int64)
    received, differs = np.zeros((2, count, PAGES, mask.shape[1]), bool)
    known[number - first, place] = True
    epoch[number - first, place] = row
    received[number - first, place] = np.moveaxis(of_mask(mask), -1, 1)[row, place]
    differs[number - first, place] = of_attacker[row]
    whole = known.all(axis=1)
    return epoch[whole].max(axis=1, initial=0), in_view[epoch[whole]].all(axis=1), received[whole], differs[whole]
