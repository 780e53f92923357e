"""The vestigial searches of a block, drawn from the model of their detection (`receiver/search_outcome.py`).

They are drawn at both fidelities: in samples an exhaustive search of 30 s takes minutes. E6 says something only where
the receiver has the key, and where the earliest signal is provably from before its disclosure; E1 alone still counts.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int8, Int64

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.crypto.disclosure import provably_before_disclosure
from vestige.receiver.search_outcome import SearchOutcome, search_outcome
from vestige.receiver.snapshots.assistance import recs_block
from vestige.receiver.snapshots.receiver_truth import ReceiverTruth
from vestige.records.recs_block import RecsBlock
from vestige.records.snapshot_block import SEARCH_NOT_RUN, SearchBlock, SearchRequest
from vestige.records.times import GalileoTimes

_NO_E1, _NO_RECS, _NOT_FOUND = (
    SEARCH_NOT_RUN.index(reason) + 1
    for reason in (
        "no signal of this satellite on E1",
        "no RECS of this satellite, or no key that proves anything",
        "the RECS was not found in E6",
    )
)


@dataclass(frozen=True, slots=True, eq=False)
class DrawnSearches:
    """What the searches of a block would find; drawn once for all its RECS.

    Attributes
    ----------
    of
        The block.
    received_at
        When the receiver has the last sample of each RECS.
    """

    of: ReceiverTruth
    received_at: GalileoTimes
    _outcomes: dict[float, tuple[SearchOutcome, ...]] = field(default_factory=dict)
    _recs: list[RecsBlock] = field(default_factory=list)

    def e1(self, request: SearchRequest) -> SearchBlock:
        """Return what the search of E1 with hand-over to E6 finds."""
        on_e1 = self._found("e1_signals", request)
        provable = self._provable(request)
        carrying = np.where(provable, self._found("handover_carrying", request), 0.0)
        signals = np.where(on_e1 > 0, np.maximum(on_e1, carrying), np.nan)
        return SearchBlock(
            signals=signals,
            carrying=np.where(on_e1 > 0, carrying, np.nan),
            earliest_m=np.where(provable & (on_e1 > 0), self._earliest_m("handover_error_m", request), np.nan),
            not_run=np.where(on_e1 > 0, 0, _NO_E1).astype(np.int8),
        )

    def exhaustive(self, request: SearchRequest) -> SearchBlock:
        """Return what the exhaustive search of E6 finds."""
        count, provable = self._found("exhaustive_signals", request), self._provable(request)
        made = provable & (count > 0)
        signals = np.where(made, count, np.nan)
        not_run: Int8[np.ndarray, "k m"] = np.where(made, 0, np.where(provable, _NOT_FOUND, _NO_RECS)).astype(np.int8)
        return SearchBlock(
            signals=signals,
            carrying=signals,
            earliest_m=np.where(made, self._earliest_m("exhaustive_error_m", request), np.nan),
            not_run=not_run,
        )

    def _found(self, name: str, request: SearchRequest) -> Float[np.ndarray, "k m"]:
        """Return what was drawn for the epochs that are asked for; nothing of satellites out of view."""
        if not request.epoch.size:
            return np.zeros((0, self.of.shape[1]))
        drawn = np.stack([getattr(one, name) for one in self._drawn(request.p_fa)], axis=1)
        return np.where(self.of.in_view[request.epoch], drawn[self._numbers(request)], np.nan)

    def _drawn(self, p_fa: float) -> tuple[SearchOutcome, ...]:
        if p_fa not in self._outcomes:
            self._outcomes[p_fa] = tuple(
                search_outcome(
                    truth,
                    cn0_e1_dbhz=simulation.cn0_e1_dbhz,
                    cn0_e6_dbhz=simulation.cn0_dbhz,
                    integration_s=simulation.integration_s,
                    seed=simulation.seed,
                    svid=simulation.svid,
                    first=self.of.first_recs,
                    p_fa=p_fa,
                )
                for simulation, truth in zip(self.of.simulations, self.of.of_recs, strict=True)
            )
        return self._outcomes[p_fa]

    def _numbers(self, request: SearchRequest) -> Int64[np.ndarray, " k"]:
        return (request.epoch - self.of.rows.start) // self.of.every

    def _earliest_m(self, name: str, request: SearchRequest) -> Float[np.ndarray, "k m"]:
        """Return how much later the earliest is than E1 puts it: both ranges have geometry, clock and ionosphere."""
        return self._found(name, request) - self.of.e1_error_m[request.epoch]

    def _provable(self, request: SearchRequest) -> Bool[np.ndarray, "k m"]:
        """Return where there is a key, and the true signal was provably received before it was on air."""
        if not self._recs:
            self._recs.append(recs_block(self.of))
        recs, late_m = self._recs[0], np.stack([one.e1.error_m for one in self.of.of_recs], axis=1)
        earliest_at = self.received_at[request.epoch] + -late_m[self._numbers(request)] / SPEED_OF_LIGHT_MPS
        uncertainty_s = [
            [limit.at(earliest_at.at(row, column)) for column in range(self.of.shape[1])]
            for row, limit in enumerate(request.uncertainty)
        ]
        lead_s = recs.disclosed[request.epoch] - earliest_at
        return recs.with_key[request.epoch] & provably_before_disclosure(
            lead_s, np.array(uncertainty_s).reshape(lead_s.shape)
        )
