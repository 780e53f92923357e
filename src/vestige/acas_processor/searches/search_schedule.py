"""When the exhaustive search of level 3 is made: one rule, for the processor and for what a campaign makes of a level.

The paper's level 3 searches E6 exhaustively [WFO, Sec. IV-C, step 5] and leaves open how often; with every RECS it
would take more time than there is. So it is made at the start, now and then, and with every RECS as long as something
is suspicious. That goes on with the RECS after a search that found a second signal, though no other check may see it:
an attacker who nulls E1 and is quiet would otherwise be AUTHENTIC again one RECS after he was found.
"""

from __future__ import annotations

_ROUNDING_S = 1e-6  # of times that are sums of intervals


def search_due(since_s: float | None, period_s: float, *, suspicious: bool, found_twice: bool) -> bool:
    """Return whether the search is to be made with a RECS.

    `since_s` is None if no search was made. It is suspicious if another check failed since the RECS before, or does
    with this one; `found_twice` if the search with the RECS before found more than one signal of a satellite.
    """
    return since_s is None or suspicious or found_twice or since_s >= period_s - _ROUNDING_S
