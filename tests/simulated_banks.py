"""Banks of one simulated line of sight, as the processor correlates them: simulation and truth in, arrays out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.searches.handover import hand_over
from vestige.crypto.recs.recs_segment import decrypt
from vestige.receiver.draws import rows_of
from vestige.receiver.simulation import Fidelity, Simulation
from vestige.receiver.snapshots.simulated_receiver import SimulatedReceiver
from vestige.receiver.truth import TruthBlock
from vestige.records import Band, Handover
from vestige.records.snapshot_block import FrontEndBlock, SnapshotBlock

PROCESSOR = AcasProcessor(early_reach_m=75.0)
OFFSETS_M = PROCESSOR.offsets_m


class Banks(NamedTuple):
    """Taps and noise power of n epochs, NaN where nothing was correlated, and what the E6 front end said."""

    taps: np.ndarray
    noise_power: np.ndarray
    front_end: FrontEndBlock


def receiver_of(simulation: Simulation, fidelity: Fidelity) -> SimulatedReceiver:
    """Return the receiver on one line of sight."""
    return SimulatedReceiver(
        simulations=(simulation,), fidelity=fidelity, interval_s=simulation.interval_s, with_taps=False
    )


def snapshots(simulation: Simulation, fidelity: Fidelity, first: int, truth: TruthBlock) -> SnapshotBlock:
    """Return the block of a truth."""
    return receiver_of(simulation, fidelity).snapshots(first, (truth,))


def banks(
    simulation: Simulation, fidelity: Fidelity, first: int, truth: TruthBlock, processor: AcasProcessor = PROCESSOR
) -> Banks:
    """Return what the processor correlates in the epochs from `first` on."""
    receiver = receiver_of(simulation, fidelity)
    block = receiver.snapshots(first, (truth,))
    found = processor.measure(block, receiver.assistance).banks
    return Banks(found.taps[:, 0], found.noise_power[:, 0], block.front_end[Band.E6])


def handover_of(simulation: Simulation, epoch: int, row: int, truth: TruthBlock) -> Handover:
    """Return the hand-over of one epoch, `row` of a truth."""
    block = snapshots(simulation, "samples", epoch, rows_of(truth, slice(row, row + 1)))
    chips = decrypt(*simulation.segment(epoch))
    return hand_over(block.e1.observation(simulation.svid, 0, 0), block.time.at(0), chips)
