"""Make the RECS of every satellite on request, as assistance of the simulated service."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Int64

from vestige.constants import SUBFRAME_S
from vestige.receiver.simulation import KEY_ON_AIR, Simulation
from vestige.receiver.snapshots.e6 import DrawnE6, SimulatedE6Samples
from vestige.receiver.snapshots.osnma import OsnmaReception
from vestige.receiver.snapshots.receiver_truth import ReceiverTruth
from vestige.records import EncryptedSegment, GroupDelay
from vestige.records.recs_block import RecsBlock
from vestige.records.snapshot_block import SnapshotBlock
from vestige.records.times import GalileoTimes
from vestige.validated_key import ValidatedKey


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedAssistance:
    """Assistance of a simulated receiver: RECS, keys, and optional predictions of the delay between the bands.

    The known keys depend on the pages that the receiver receives. So `recs_of` takes the truth of the receiver from
    `e6` of the snapshots.
    """

    simulations: tuple[Simulation, ...]  # simulation of each satellite
    every: int  # number of epochs from one RECS to the next
    group_delays: tuple[GroupDelay, ...] = ()
    hardware_bias_e1_e6_s: float = 0.0
    ionosphere_e1_m: Mapping[int, float] = field(default_factory=dict)

    def recs_of(self, snapshots: SnapshotBlock) -> SimulatedRecs:
        """Return the RECS that the satellites of a block sent, with their keys."""
        if not isinstance(snapshots.e6, DrawnE6 | SimulatedE6Samples):
            raise TypeError("the assistance of a simulation needs snapshots of the same simulation")
        return SimulatedRecs(assistance=self, block=recs_block(snapshots.e6.of), first=snapshots.e6.of.first)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SimulatedRecs:
    """RECS of a block, each encrypted on request."""

    assistance: SimulatedAssistance
    block: RecsBlock
    first: int  # number of the block's first epoch

    def segment(self, epoch: int, satellite: int) -> tuple[EncryptedSegment, ValidatedKey]:
        """Return the RECS of one satellite at one epoch, and the key that decrypts this RECS."""
        number = (self.first + epoch) // self.assistance.every
        return self.assistance.simulations[satellite].segment(number)


def recs_block(of: ReceiverTruth) -> RecsBlock:
    """Return the RECS of all satellites, at all epochs of a block that have RECS."""
    simulation = of.simulations[0]
    second = simulation.start.gst_seconds + np.round(10 * of.truth[0].time_s).astype(np.int64) // 10
    found, with_key = np.zeros((2, *of.shape), np.bool_)
    found[of.rows] = True
    key_s = _key_second(second, simulation.key_delay)
    with_key[of.rows] = _keys_received(of, key_s - simulation.start.gst_seconds)[of.rows, None]
    return recs_with_keys(second, found, with_key, key_delay=simulation.key_delay)


def recs_with_keys(
    second: Int64[np.ndarray, " n"],
    found: Bool[np.ndarray, "n m"],
    with_key: Bool[np.ndarray, "n m"],
    *,
    key_delay: int,
) -> RecsBlock:
    """Return RECS with the times of their keys.

    `second` is the time of transmission of each RECS, in whole seconds since the GST epoch.
    """
    key_s = _key_second(second, key_delay)

    def times(later_s: int) -> GalileoTimes:
        return GalileoTimes(np.repeat((key_s + later_s)[:, None], found.shape[1], axis=1), np.zeros(found.shape))

    return RecsBlock(
        found=found,
        with_key=with_key,
        key_time=times(0),
        disclosed=times(KEY_ON_AIR.disclosure_start_s),
        complete=times(KEY_ON_AIR.disclosure_end_s),
    )


def _key_second(second: Int64[np.ndarray, " n"], key_delay: int) -> Int64[np.ndarray, " n"]:
    return SUBFRAME_S * (second // SUBFRAME_S + key_delay)


def _keys_received(of: ReceiverTruth, key_s: Int64[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Return for each epoch whether the receiver receives the key of a RECS that is sent at this epoch.

    `key_s` is the start of the subframe of the key, in s after the scenario's start.
    """
    simulation = of.simulations[0]
    if simulation.elevation is not None:
        return OsnmaReception(of=of).key_received
    if not simulation.spoofer.attacks:
        return np.ones(of.n, np.bool_)
    each_s, place = np.unique(key_s, return_inverse=True)
    return np.array([not simulation.withheld(float(one)) for one in each_s], np.bool_)[place]
