"""Combine the truth of all satellites of a receiver in a block of epochs, and find the epochs with RECS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int64

from vestige.receiver.draws import rows_of
from vestige.receiver.samples.sampled_epoch import Arrival
from vestige.receiver.simulation import Simulation, e1_error_m
from vestige.receiver.truth import TruthBlock


@dataclass(frozen=True, kw_only=True)
class ReceiverTruth:
    """Truth of n epochs and m satellites."""

    simulations: tuple[Simulation, ...]  # simulation of each satellite
    truth: tuple[TruthBlock, ...]  # truth of each satellite
    first: int  # number of the first epoch
    every: int  # number of epochs from one RECS to the next

    @property
    def n(self) -> int:
        """Number of epochs."""
        return self.truth[0].time_s.size

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of epochs and satellites."""
        return self.n, len(self.simulations)

    @property
    def seed(self) -> int:
        """Seed of all random numbers."""
        return self.simulations[0].seed

    @property
    def svids(self) -> tuple[int, ...]:
        """SVIDs of the satellites."""
        return tuple(one.svid for one in self.simulations)

    @cached_property
    def in_view(self) -> Bool[np.ndarray, "n m"]:
        """Whether each satellite is above the elevation mask."""
        return np.stack([one.geometry.in_view for one in self.truth], axis=1)

    @cached_property
    def acquiring(self) -> Bool[np.ndarray, "n m"]:
        """Whether E1 acquires each satellite, and thus has no measurement."""
        return np.stack([one.e1.acquiring for one in self.truth], axis=1)

    @property
    def rows(self) -> slice:
        """Rows of the epochs with RECS."""
        return slice(min(-self.first % self.every, self.n), self.n, self.every)

    @property
    def recs_rows(self) -> Int64[np.ndarray, " k"]:
        """Row numbers of the epochs with RECS."""
        return np.arange(self.n, dtype=np.int64)[self.rows]

    @property
    def first_recs(self) -> int:
        """Number of the first RECS in the block, or of the next RECS after the block if the block has no RECS."""
        return -(-self.first // self.every)

    @cached_property
    def of_recs(self) -> tuple[TruthBlock, ...]:
        """Truth of each satellite at the epochs with RECS."""
        return self.truth if self.every == 1 else tuple(rows_of(one, self.rows) for one in self.truth)

    @cached_property
    def arrived(self) -> tuple[Arrival, ...]:
        """Arrival in E6 of the RECS of each satellite."""
        return self.arrived_at_epochs if self.every == 1 else self._arrived(self.of_recs)

    @cached_property
    def arrived_at_epochs(self) -> tuple[Arrival, ...]:
        """Arrival in E6 of the chips that each satellite sends at each epoch, also at epochs without RECS."""
        return self._arrived(self.truth)

    def _arrived(self, truths: tuple[TruthBlock, ...]) -> tuple[Arrival, ...]:
        return tuple(simulation.arrival(truth) for simulation, truth in zip(self.simulations, truths, strict=True))

    @cached_property
    def received_s(self) -> Float[np.ndarray, "n m"]:
        """Reception time of each RECS's last sample in s after the start, or the time of an epoch without RECS."""
        elapsed_s = np.repeat(self.truth[0].time_s[:, None], self.shape[1], axis=1)
        for column, (simulation, truth) in enumerate(zip(self.simulations, self.of_recs, strict=True)):
            if self.recs_rows.size:
                elapsed_s[self.rows, column] = simulation.received_s(truth, self.arrived[column])
        return elapsed_s

    @cached_property
    def e1_multipath_m(self) -> Float[np.ndarray, "n m"]:
        """Multipath error of each pseudorange on E1, in m."""
        return self.each(Simulation.e1_multipath_m)

    @cached_property
    def e1_error_m(self) -> Float[np.ndarray, "n m"]:
        """Error of each pseudorange on E1 that E6 does not share, in m."""
        each = [e1_error_m(truth, own) for truth, own in zip(self.truth, self.e1_multipath_m.T, strict=True)]
        return np.stack(each, axis=1)

    def each(self, quantity: Callable[[Simulation, TruthBlock], np.ndarray]) -> Float[np.ndarray, "n m"]:
        """Return the values of a quantity at all epochs and for all satellites."""
        return np.stack(
            [quantity(simulation, truth) for simulation, truth in zip(self.simulations, self.truth, strict=True)],
            axis=1,
        )
