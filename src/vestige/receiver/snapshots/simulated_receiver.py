"""Simulate the receiver: compute the input of the processor from the truth of a block of epochs.

The snapshots of a block are a pure function of the truth, of the number of the first epoch and of the seed. So any
worker can make a block, and the snapshots do not depend on the division of the epochs into blocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vestige.receiver.errors.accelerometer import Accelerometers
from vestige.receiver.samples.attacked_sky import latest_s
from vestige.receiver.samples.satellite_on_air import broadcast_group_delay_s
from vestige.receiver.simulation import Fidelity, Simulation
from vestige.receiver.sky.elevation import ElevationEffects
from vestige.receiver.snapshots.assistance import SimulatedAssistance
from vestige.receiver.snapshots.e1 import e1_block
from vestige.receiver.snapshots.e6 import DrawnE6, FrontEnds, SimulatedE6Samples
from vestige.receiver.snapshots.osnma import OsnmaReception, PagesReceived
from vestige.receiver.snapshots.receiver_truth import ReceiverTruth
from vestige.receiver.snapshots.searches import DrawnSearches
from vestige.receiver.truth import TruthBlock, TruthProcess
from vestige.receiver.truth_around import TAIL_S, TruthAround, epochs_around
from vestige.records import GroupDelay
from vestige.records.snapshot_block import SnapshotBlock, VelocityIncrements
from vestige.records.times import GalileoTimes


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedReceiver:
    """A receiver on one line of sight or under a sky."""

    simulations: tuple[Simulation, ...]  # simulation of each satellite, by ascending SVID
    fidelity: Fidelity  # whether E6 and the correlators and power of E1 are drawn or come from samples
    interval_s: float  # time in s between epochs
    every: int = 1  # number of epochs from one RECS to the next
    accelerometers: Accelerometers | None = None  # accelerometers of a receiver under a sky; None for no accelerometers
    with_taps: bool = True  # whether E1 is tracked between RECS, which gives correlators and power of E1

    @property
    def assistance(self) -> SimulatedAssistance:
        """Assistance that the service gives the receiver.

        Only the assistance for samples of a sky has group delays.
        """
        start = self.simulations[0].start
        delays = tuple(
            GroupDelay(
                svid=one.svid, bgd_e1_e6_s=broadcast_group_delay_s(one.seed, one.svid), valid_from=start.subframe
            )
            for one in self.simulations
            if self._samples_of_a_sky
        )
        return SimulatedAssistance(simulations=self.simulations, every=self.every, group_delays=delays)

    @property
    def _samples_of_a_sky(self) -> bool:
        return self.fidelity == "samples" and self.simulations[0].elevation is not None

    def truth(self) -> tuple[TruthProcess | TruthAround, ...]:
        """Return the truth process of each satellite.

        For samples of a sky the process also gives the truth at epochs around a block.
        """
        if not self._samples_of_a_sky:
            return tuple(one.truth() for one in self.simulations)
        return tuple(self._truth_around(one) for one in self.simulations)

    def _truth_around(self, one: Simulation) -> TruthAround:
        epochs_s = np.arange(0.0, one.n_epochs * one.interval_s, self.interval_s)
        before, after = epochs_around(self.interval_s, TAIL_S + latest_s(one.spoofer, one.svid, epochs_s))
        return TruthAround(one, before=before, after=after)

    def snapshots(self, first: int, truth: tuple[TruthBlock, ...]) -> SnapshotBlock:
        """Return the snapshots of the epochs of `truth`, which begin with epoch number `first`."""
        return self.snapshots_of(
            ReceiverTruth(simulations=self.simulations, truth=truth, first=first, every=self.every)
        )

    def snapshots_of(self, of: ReceiverTruth, pages: PagesReceived | None = None) -> SnapshotBlock:
        """Return the snapshots that follow from a given truth.

        `pages` are the OSNMA pages that are received under a sky; None to compute the pages from the truth.
        """
        e1, power = e1_block(of, fidelity=self.fidelity, with_taps=self.with_taps)
        e6 = DrawnE6(of) if self.fidelity == "correlators" else SimulatedE6Samples(of)
        time, elevation = self._times(of), self.simulations[0].elevation
        osnma = None if elevation is None else OsnmaReception(of=of)
        if osnma is not None and pages is None:
            pages = osnma.pages(self.interval_s)
        recs = np.zeros(of.n, np.bool_)
        recs[of.rows] = True
        return SnapshotBlock(
            index=of.first + np.arange(of.n, dtype=np.int64),
            time=time,
            received_at=GalileoTimes.after(self.simulations[0].start, of.received_s),
            time_uncertainty_s=np.full(of.n, self.simulations[0].time_uncertainty_s, np.float64),
            svids=of.svids,
            asked=np.ones(of.shape, np.bool_),
            recs=recs,
            e1=e1,
            front_end=FrontEnds(power, e6),
            e6=e6,
            searches=self.searches(of),
            osnma=None if pages is None else pages.block,
            increments=self._increments(of, time, elevation),
            data_authenticated=None if osnma is None else osnma.data_authenticated,
        )

    def searches(self, of: ReceiverTruth) -> DrawnSearches:
        """Return the search results of a block, which are drawn at both fidelities."""
        return DrawnSearches(of=of, received_s=of.received_s)

    def _times(self, of: ReceiverTruth) -> GalileoTimes:
        """Return the times of transmission of the epochs on the receiver's clock, whole multiples of 0.1 s."""
        deciseconds = (of.first + np.arange(of.n, dtype=np.int64)) * round(10 * self.interval_s)
        return GalileoTimes(self.simulations[0].start.gst_seconds + deciseconds // 10, deciseconds % 10 / 10)

    def _increments(
        self, of: ReceiverTruth, time: GalileoTimes, elevation: ElevationEffects | None
    ) -> VelocityIncrements | None:
        """Return the change of velocity since the previous epoch that accelerometers measure.

        The first epoch of a run has no measurement.
        """
        if self.accelerometers is None or elevation is None:
            return None
        delta_velocity_mps = self.accelerometers.delta_velocity_mps(
            elevation.path.trajectory,
            of.truth[0].time_s - self.simulations[0].clock_offset_s,
            self.interval_s,
            seed=of.seed,
            first=of.first,
        )
        rows = np.flatnonzero(np.isfinite(delta_velocity_mps[:, 0]))
        return VelocityIncrements(
            epoch=rows, time=time[rows], delta_velocity_mps=delta_velocity_mps[rows], covered=np.ones(of.n, np.bool_)
        )
