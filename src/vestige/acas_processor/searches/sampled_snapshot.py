"""Convert one snapshot of samples to a block of one epoch, the processor's input from a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from vestige.acas_processor.searches.block_searches import SampledSearches
from vestige.records import Correlatable, E1Observation, Snapshot
from vestige.records.inertial import Accelerations
from vestige.records.snapshot_block import OBSERVED, BankBlock, E1Block, FrontEndBlock, Handovers, SnapshotBlock
from vestige.records.times import GalileoTimes
from vestige.signals.definitions import E6C
from vestige.time import GalileoTime
from vestige.valid_numbers import require_finite


@dataclass(frozen=True, slots=True, eq=False)
class SampledE6:
    """E6 samples of one epoch, with the method that correlates the samples."""

    e6: Correlatable

    def correlate(
        self, asked: Bool[np.ndarray, "n m"], handovers: Handovers, offsets_m: Float[np.ndarray, " n_taps"]
    ) -> BankBlock:
        """Return the requested banks of correlators; NaN where the samples do not contain the RECS."""
        taps = np.full((*asked.shape, offsets_m.size), np.nan + 0j)
        noise_power, integration_s = np.full((2, *asked.shape), np.nan)
        for epoch, satellite in zip(*(axis.tolist() for axis in np.nonzero(asked)), strict=True):
            handover = handovers.at(epoch, satellite)
            bank = None if handover is None else self.e6.correlate(handover, offsets_m)
            if handover is not None and bank is not None:
                owner, largest = f"E6 of E{handover.svid:02d}", float(np.abs(bank.taps).sum())
                require_finite(owner, taps=largest, noise_power=bank.noise_power)
                taps[epoch, satellite], noise_power[epoch, satellite] = bank.taps, bank.noise_power
                integration_s[epoch, satellite] = handover.chips.n_chips / E6C.chip_rate_hz
        return BankBlock(offsets_m=offsets_m, taps=taps, noise_power=noise_power, integration_s=integration_s)


def block_of(
    snapshot: Snapshot, *, since: GalileoTime | None = None, accelerations: Accelerations | None = None
) -> SnapshotBlock:
    """Return a snapshot as a block of one epoch.

    Accelerations from `since` on are used. `since` is the time of the previous snapshot, None for the first snapshot.
    """
    svids = tuple(sorted(set(snapshot.observations) | snapshot.recs))
    observations = [snapshot.observations.get(svid) for svid in svids]

    observed: dict[str, Any] = {name: _row(observations, name) for name in OBSERVED}
    shape = (1, len(svids))
    return SnapshotBlock(
        index=np.array([snapshot.index]),
        time=GalileoTimes.of([snapshot.time]),
        received_at=GalileoTimes.of([snapshot.received_at]).reshaped(shape),
        time_uncertainty_s=np.array([snapshot.time_uncertainty_s], np.float64),
        svids=svids,
        asked=np.ones(shape, np.bool_),
        recs=np.ones(1, np.bool_),
        e1=E1Block(**observed),
        front_end={
            band: FrontEndBlock(
                agc_gain_db=np.array([status.agc_gain_db], np.float64),
                total_power_db=np.array([status.total_power_db], np.float64),
                saturated=np.array([status.saturated], np.bool_),
            )
            for band, status in snapshot.front_end.items()
        },
        e6=None if snapshot.e6 is None else SampledE6(snapshot.e6),
        searches=SampledSearches(snapshot, svids),
        increments=None if accelerations is None else accelerations.increments(since, snapshot.time),
    )


def _row(observations: Sequence[E1Observation | None], name: str) -> Float[np.ndarray, "1 m"]:
    """Return an observed quantity of each satellite; NaN for satellites that E1 does not track."""
    return np.array([[np.nan if one is None else getattr(one, name) for one in observations]])
