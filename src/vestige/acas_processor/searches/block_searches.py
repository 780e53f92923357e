"""Search E1 and E6 for vestigial signals in the samples of the snapshot of one epoch.

The searches use settings of the requesting processor, such as false-alarm probability and cipher mode.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from vestige.acas_processor.searches.sampled_searches import SatelliteSearch
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.records import Assistance, Snapshot
from vestige.records.recs_block import segment_at, segments_between
from vestige.records.snapshot_block import SEARCH_NOT_RUN, SampleSearches, SearchBlock, SearchRequest
from vestige.time import GalileoTime

if TYPE_CHECKING:
    from vestige.acas_processor.processor import AcasProcessor


@dataclass(frozen=True, slots=True, eq=False)
class SampledSearches:
    """E1 vestigial search and E6 exhaustive search of a block of one epoch, in the samples of its snapshot."""

    snapshot: Snapshot  # snapshot with E1, and with E6 if available
    svids: tuple[int, ...]

    def e1(self, request: SearchRequest) -> SearchBlock:
        """Return the result of the search of E1 with hand-over to E6."""
        return _in_samples(request).e1(self.snapshot, self.svids, request)

    def exhaustive(self, request: SearchRequest) -> SearchBlock:
        """Return the result of the exhaustive search of E6."""
        return _in_samples(request).exhaustive(self.snapshot, self.svids, request)


def _in_samples(request: SearchRequest) -> SampleSearches:
    if request.in_samples is None:
        raise ValueError("a search in samples needs the settings of a processor, and the request has none")
    return request.in_samples


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProcessorSearches:
    """E1 vestigial search and E6 exhaustive search in samples, with the settings of a processor."""

    processor: AcasProcessor
    assistance: Assistance

    def e1(self, snapshot: Snapshot, svids: tuple[int, ...], request: SearchRequest) -> SearchBlock:
        """Return the result of the search of E1 with hand-over to E6 for the given satellites."""
        search = replace(
            self.processor.monitoring.e1_search,
            p_fa=request.p_fa,
            cipher_mode=self.processor.cipher_mode,
            group_delay_convention=self.processor.group_delay_convention,
        )
        found = search.search(snapshot, self._recs_of(snapshot), request.uncertainty[0])
        return self._block(found, snapshot, svids, request)

    def exhaustive(self, snapshot: Snapshot, svids: tuple[int, ...], request: SearchRequest) -> SearchBlock:
        """Return the result of the exhaustive search of E6 for the given satellites."""
        settings = self.processor.monitoring.exhaustive_search
        search = replace(settings, p_fa=request.p_fa, cipher_mode=self.processor.cipher_mode)
        expected = {
            svid: snapshot.time + float(seconds)
            for svid, seconds in zip(svids, request.expected_s[0], strict=True)
            if math.isfinite(seconds)
        }
        found = search.search(snapshot, self._recs_of(snapshot), request.uncertainty[0], expected=expected)
        return self._block(found, snapshot, svids, request)

    def _recs_of(self, snapshot: Snapshot) -> Assistance:
        """Return the assistance with only the RECS of the snapshot.

        Earlier and later RECS have their own snapshots. So the verdicts do not depend on whether later RECS are already
        known.
        """
        times = [snapshot.time + -one.pseudorange_m / SPEED_OF_LIGHT_MPS for one in snapshot.observations.values()]
        segments = segments_between(self.assistance, min(times), max(times)) if times else ()
        return replace(self.assistance, segments=segments)

    def _block(
        self, found: Iterable[SatelliteSearch], snapshot: Snapshot, svids: tuple[int, ...], request: SearchRequest
    ) -> SearchBlock:
        by_svid = {one.svid: one for one in found}
        shape = (1, len(svids))
        signals, carrying, earliest_m = np.full((3, *shape), np.nan)
        not_run = np.full(
            shape,
            SEARCH_NOT_RUN.index("the satellite has no RECS with a known key that was still secret at reception") + 1,
        )
        for column, svid in enumerate(svids):
            one = by_svid.get(svid)
            if one is None:
                continue
            signals[0, column], carrying[0, column], not_run[0, column] = one.count, one.carrying, one.not_run
            expected_s = request.expected_s[0, column]
            same = one.sent is not None and self._sent_with(svid, one.sent, snapshot)
            if same and one.count > 1 and one.peaks and one.true_is_known and math.isfinite(expected_s):
                apart_s = (min(peak.start_time for peak in one.peaks) - snapshot.time) - expected_s
                earliest_m[0, column] = apart_s * SPEED_OF_LIGHT_MPS
        return SearchBlock(signals=signals, carrying=carrying, earliest_m=earliest_m, not_run=not_run.astype(np.int8))

    def _sent_with(self, svid: int, sent: GalileoTime, snapshot: Snapshot) -> bool:
        """Return whether the RECS with transmission time `sent` belongs to the snapshot; False without E1 tracking."""
        observation = snapshot.observations.get(svid)
        if observation is None:
            return False
        travel_s = observation.pseudorange_m / SPEED_OF_LIGHT_MPS
        own = segment_at(self.assistance, svid, snapshot.time + -travel_s)
        return own is not None and own.transmit_time == sent
