"""Check with two vestigial searches whether there is more than one signal of a satellite.

Step 4 of [WFO, Sec. IV-B] finds all signals on E1 and hands each signal over to E6. Step 5 of [WFO, Sec. IV-C] searches
E6 exhaustively. The statistic is the number of signals of a satellite, and the threshold is 1. An attacker can evade
both searches by nulling the true signal on both bands, or by burying the true signal in noise. The checks of received
power can detect such noise. By assumption, the paper excludes an attacker who nulls both bands [WFO, Sec. II].

The search on E1 is made at every RECS. The paper does not state how often the exhaustive search is made, and at every
RECS the search would take too long. The exhaustive search is therefore made at the start, once in a configured period,
and at every RECS for which another check failed. A search that found a second signal is repeated at the next RECS, even
if no other check fails. Otherwise the signals of an attacker who nulls the true signals on E1 and adds no noise would
be AUTHENTIC again after a single RECS. Both searches cover the possible error of the clock (`TimeUncertainty`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int8, Int64

from vestige.acas_processor.evidence import Evidence
from vestige.records.checks import CheckName, CheckSeries
from vestige.records.snapshot_block import SEARCH_NOT_RUN, SearchBlock

NOT_DUE = SEARCH_NOT_RUN.index("the next search is not due yet") + 1
_ROUNDING_S = 1e-6  # rounding error of times that are sums of intervals, in s


def search_due(since_s: float | None, period_s: float, *, suspicious: bool, found_twice: bool) -> bool:
    """Return whether the exhaustive search is due at a RECS.

    `since_s` is the time since the last search; None if no search was made. `suspicious` is true if another check
    failed since the previous RECS, or fails at this RECS. `found_twice` is true if the search at the previous RECS
    found more than one signal of a satellite.
    """
    return since_s is None or suspicious or found_twice or since_s >= period_s - _ROUNDING_S


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchResults:
    """Results of one kind of search in a block of n epochs; NaN where the search was not made."""

    # fields of `SearchBlock`, for every epoch
    signals: Float[np.ndarray, "n m"]
    carrying: Float[np.ndarray, "n m"]
    earliest_m: Float[np.ndarray, "n m"]
    not_run: Int8[np.ndarray, "n m"]

    @classmethod
    def empty(cls, shape: tuple[int, int]) -> SearchResults:
        """Return results of a search that was never due."""
        signals, carrying, earliest_m = np.full((3, *shape), np.nan)
        not_run = np.full(shape, NOT_DUE, np.int8)
        return cls(signals=signals, carrying=carrying, earliest_m=earliest_m, not_run=not_run)

    def put(self, epoch: Int64[np.ndarray, " k"], found: SearchBlock) -> None:
        """Replace the results of the given epochs by the results of a search that was made."""
        for name in ("signals", "carrying", "earliest_m", "not_run"):
            getattr(self, name)[epoch] = getattr(found, name)

    @property
    def twice(self) -> Bool[np.ndarray, "n m"]:
        """Epochs and satellites for which more than one signal was found."""
        return self.signals > 1

    def series(self, name: CheckName, p_fa: float, evidence: Evidence) -> CheckSeries:
        """Return the results of the search as the results of a check."""

        def explain(epoch: int, satellite: int) -> str:
            here = (epoch, satellite)
            if np.isnan(self.signals[here]):
                if evidence.measured.snapshots.searches is None:
                    return "no samples to search"
                return SEARCH_NOT_RUN[max(int(self.not_run[here]), 1) - 1]
            text = f"{self.signals[here]:.0f} signals of one satellite: "
            if not self.carrying[here] > 1:
                return f"{text}E6 does not tell which is the true signal"
            text = f"{text}{self.carrying[here]:.0f} carry the encrypted chips; "
            if np.isnan(self.earliest_m[here]):
                return f"{text}all of them arrived when their key may have been public"
            return f"{text}the earliest, {self.earliest_m[here]:+.1f} m from the E1 prediction, is the true signal"

        return CheckSeries(
            name=name,
            unit="signals",
            p_fa=p_fa,
            statistic=self.signals,
            threshold=np.where(np.isnan(self.signals), np.nan, 1.0),
            explain=explain,
            exact=False,
        )
