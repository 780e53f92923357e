"""Draw the results of the vestigial searches of a block from the model in `receiver/correlators/search_outcome.py`.

The results are drawn at both fidelities, because an exhaustive search of 30 s of samples takes minutes. A search of E6
has a result only if the receiver has the key, and the earliest signal provably arrived before the disclosure of the
key. The search of E1 has a result even without the key. The detections of each epoch are drawn for the false-alarm
probability that the processor requests, or come from stored results. Stored results belong to a single false-alarm
probability. This module decides which detections may be reported.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int8

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.crypto.osnma.disclosure import provably_before_disclosure
from vestige.errors import VestigeError
from vestige.receiver.correlators.search_outcome import WINDOW_S, search_outcome
from vestige.receiver.snapshots.assistance import recs_block
from vestige.receiver.snapshots.e1 import single
from vestige.receiver.snapshots.receiver_truth import ReceiverTruth
from vestige.records.recs_block import RecsBlock
from vestige.records.snapshot_block import SEARCH_NOT_RUN, SearchBlock, SearchRequest
from vestige.records.times import GalileoTimes
from vestige.time import GalileoTime

_NO_E1, _NO_RECS, _NOT_FOUND = (
    SEARCH_NOT_RUN.index(reason) + 1
    for reason in (
        "no signal of this satellite on E1",
        "the satellite has no RECS with a known key that was still secret at reception",
        "the RECS was not found in E6",
    )
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchFinds:
    """Results that searches in each of n epochs would have.

    The numbers of signals and the delays are NaN at epochs without RECS, and for satellites that are out of view or
    that E1 acquires. The receiver has no E1 measurement of a satellite that is out of view or being acquired, so no
    search is made.
    """

    p_fa: float  # false-alarm probability of a single search
    e1_signals: Float[np.ndarray, "n m"]  # number of signals on E1
    handover_carrying: Float[np.ndarray, "n m"]  # number of signals on E1 whose encrypted chips are found in E6
    # delay in m of the earliest of several signals relative to the tracked range on E1; NaN for a single signal
    handover_earliest_m: Float[np.ndarray, "n m"]
    exhaustive_signals: Float[np.ndarray, "n m"]  # number of signals in an exhaustive search of E6
    # delay in m of the exhaustive search's earliest signal relative to the tracked range on E1; NaN for a single signal
    exhaustive_earliest_m: Float[np.ndarray, "n m"]
    # reception time of the last sample of the earliest signal's RECS, in s after the scenario's start
    earliest_s: Float[np.ndarray, "n m"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KnownSearches:
    """Searches of a block whose results are known."""

    finds: SearchFinds
    start: GalileoTime  # start of the scenario
    recs: RecsBlock  # RECS and keys of the block

    def e1(self, request: SearchRequest) -> SearchBlock:
        """Return the result of the search of E1 with hand-over to E6.

        The function raises `VestigeError` if the request has another false-alarm probability than the known results.
        """
        self._require_p_fa(request)
        rows = request.epoch
        on_e1, provable = self.finds.e1_signals[rows], self._provable(request)
        carrying = np.where(provable, self.finds.handover_carrying[rows], 0.0)
        signals = np.where(on_e1 > 0, np.maximum(on_e1, carrying), np.nan)
        return SearchBlock(
            signals=signals,
            carrying=np.where(on_e1 > 0, carrying, np.nan),
            earliest_m=np.where(provable & (on_e1 > 0), self.finds.handover_earliest_m[rows], np.nan),
            not_run=np.where(on_e1 > 0, 0, _NO_E1).astype(np.int8),
        )

    def exhaustive(self, request: SearchRequest) -> SearchBlock:
        """Return the result of the exhaustive search of E6.

        The function raises `VestigeError` if the request has another false-alarm probability than the known results.
        """
        self._require_p_fa(request)
        rows = request.epoch
        count, provable = self.finds.exhaustive_signals[rows], self._provable(request)
        made = provable & (count > 0)
        signals = np.where(made, count, np.nan)
        not_run: Int8[np.ndarray, "k m"] = np.where(made, 0, np.where(provable, _NOT_FOUND, _NO_RECS)).astype(np.int8)
        return SearchBlock(
            signals=signals,
            carrying=signals,
            earliest_m=np.where(made, self.finds.exhaustive_earliest_m[rows], np.nan),
            not_run=not_run,
        )

    def _require_p_fa(self, request: SearchRequest) -> None:
        if request.p_fa != self.finds.p_fa:
            raise VestigeError(
                f"stored searches: found results for a false-alarm probability of {self.finds.p_fa:g} of one search, "
                f"expected {request.p_fa:g} as the processor asks; judge them with search_p_fa = {self.finds.p_fa:g}, "
                "or simulate the scenario again"
            )

    def _provable(self, request: SearchRequest) -> Bool[np.ndarray, "k m"]:
        """Return which RECS have a key, and an earliest signal that was provably received before the key was on air."""
        earliest_at = GalileoTimes.after(self.start, np.nan_to_num(self.finds.earliest_s[request.epoch]))
        uncertainty_s = [limit.over(earliest_at[row : row + 1])[0] for row, limit in enumerate(request.uncertainty)]
        lead_s = self.recs.disclosed[request.epoch] - earliest_at
        return self.recs.with_key[request.epoch] & provably_before_disclosure(
            lead_s, np.array(uncertainty_s).reshape(lead_s.shape)
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnSearches:
    """Search results of all RECS of a block, drawn at the first request with each false-alarm probability."""

    of: ReceiverTruth
    # reception time of the last sample of each RECS, in s after the scenario's start
    received_s: Float[np.ndarray, "n m"]

    def e1(self, request: SearchRequest) -> SearchBlock:
        """Return the result of the search of E1 with hand-over to E6."""
        return self._known(request.p_fa).e1(request)

    def exhaustive(self, request: SearchRequest) -> SearchBlock:
        """Return the result of the exhaustive search of E6."""
        return self._known(request.p_fa).exhaustive(request)

    def finds(self, p_fa: float) -> SearchFinds:
        """Return the results that searches with the false-alarm probability `p_fa` would have."""
        return self._known(p_fa).finds

    def _known(self, p_fa: float) -> KnownSearches:
        if p_fa not in self._drawn:
            self._drawn[p_fa] = KnownSearches(finds=self._finds(p_fa), start=self._start, recs=self._recs)
        return self._drawn[p_fa]

    @cached_property
    def _drawn(self) -> dict[float, KnownSearches]:
        return {}

    @cached_property
    def _start(self) -> GalileoTime:
        return self.of.simulations[0].start

    @cached_property
    def _recs(self) -> RecsBlock:
        return recs_block(self.of)

    def _finds(self, p_fa: float) -> SearchFinds:
        of = self.of
        drawn = [
            search_outcome(
                truth,
                cn0_e1_dbhz=simulation.cn0_e1_dbhz,
                cn0_e6_dbhz=simulation.cn0_dbhz,
                integration_s=simulation.integration_s,
                seed=simulation.seed,
                svid=simulation.svid,
                first=of.first_recs,
                p_fa=p_fa,
                clock_offset_s=simulation.clock_offset_s,
            )
            for simulation, truth in zip(of.simulations, of.of_recs, strict=True)
            if of.recs_rows.size
        ]

        def found(name: str) -> Float[np.ndarray, "n m"]:
            values = np.full(of.shape, np.nan)
            for column, one in enumerate(drawn):
                values[of.rows, column] = getattr(one, name)
            return np.where(of.in_view & ~of.acquiring, single(values), np.nan)

        # If the clock error exceeds the search window, the receiver finds no true signal. In this case the earliest
        # signal is the signal that E1 follows.
        window_m = WINDOW_S * SPEED_OF_LIGHT_MPS
        late_m = np.stack(
            [
                simulation.repeated_later_m(one) if abs(simulation.clock_offset_m) <= window_m else np.zeros(of.n)
                for simulation, one in zip(of.simulations, of.truth, strict=True)
            ],
            axis=1,
        )
        return SearchFinds(
            p_fa=p_fa,
            e1_signals=found("e1_signals"),
            handover_carrying=found("handover_carrying"),
            handover_earliest_m=found("handover_error_m") - of.e1_error_m,
            exhaustive_signals=found("exhaustive_signals"),
            exhaustive_earliest_m=found("exhaustive_error_m") - of.e1_error_m,
            earliest_s=self.received_s - late_m / SPEED_OF_LIGHT_MPS,
        )
