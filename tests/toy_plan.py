"""A small campaign with everything that a real one has: memory, random numbers, text labels, any order of axes."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vestige.campaign.plan import Column, Coord
from vestige.streams import stream

TAPS = np.arange(-2, 3) * 15.0


class Walk:
    """A random walk: what an epoch's clock is depends on all epochs before it."""

    def __init__(self, seed: int) -> None:
        self._steps = stream(seed, "clock")
        self._clock_m = 0.0
        self._next = 0

    def advance(self, first: int, count: int) -> dict[str, np.ndarray]:
        assert first == self._next, "in order, without a gap"
        self._next += count
        clock_m = np.empty(count)
        for i, step in enumerate(self._steps.standard_normal(count)):  # one by one: a cumsum rounds by its cut
            self._clock_m = clock_m[i] = self._clock_m + step
        return {"clock_m": clock_m}


@dataclass(frozen=True, kw_only=True)
class ToyPlan:
    """`n_epochs` epochs of two satellites and five taps; each epoch takes `pause_s`."""

    n_epochs: int
    seed: int = 1
    pause_s: float = 0.0
    scenario: str = "a toy\nwith two lines"

    @property
    def columns(self) -> Mapping[str, Column]:
        return {
            "time_s": Column(dims=("epoch",), dtype="float64", units="s", long_name="time"),
            "taps": Column(dims=("epoch", "satellite", "tap"), dtype="complex64", units="1", long_name="correlators"),
            "tap_index": Column(
                dims=("detector", "epoch", "satellite"), dtype="int8", units="1", long_name="tap", attrs={"least": -1}
            ),
            "range_offset_m": Column(
                dims=("detector", "epoch", "satellite"), dtype="float32", units="m", long_name="range offset"
            ),
        }

    @property
    def coords(self) -> Mapping[str, Coord]:
        return {
            "svid": Coord(dim="satellite", values=np.array([4, 11], dtype=np.int64), units="1", long_name="SVID"),
            "tap_offset_m": Coord(dim="tap", values=TAPS, units="m", long_name="offset"),
            "detector": Coord(dim="detector", values=np.array(["early", "maximum"]), units="1", long_name="detector"),
        }

    @property
    def attrs(self) -> Mapping[str, Any]:
        return {"scenario": self.scenario, "seed": self.seed, "threshold_sigma": 2.0}

    def prepare(self) -> Walk:
        return Walk(self.seed)

    def measure(self, first: int, inputs: Mapping[str, Any]) -> dict[str, np.ndarray]:
        clock_m = inputs["clock_m"]
        time.sleep(self.pause_s * len(clock_m))
        epochs = range(first, first + len(clock_m))
        noise = np.array([stream(self.seed, "noise", epoch).standard_normal((2, 5, 2)) for epoch in epochs])
        taps = (noise[..., 0] + 1j * noise[..., 1]).astype(np.complex64)
        best = np.argmax(np.abs(taps), axis=-1)
        found = np.stack([best, np.where(np.abs(taps).max(axis=-1) > 2, best, -1)])
        offset = np.where(found < 0, np.nan, TAPS[found] + clock_m[:, None])
        return {
            "time_s": np.asarray(epochs, dtype=np.float64),
            "taps": taps,
            "tap_index": found.astype(np.int8),
            "range_offset_m": offset.astype(np.float32),
        }


@dataclass(frozen=True, kw_only=True)
class DeadlyPlan(ToyPlan):
    """Kills the process that measures `deadly_epoch`; apart from that the same work."""

    deadly_epoch: int

    def measure(self, first: int, inputs: Mapping[str, Any]) -> dict[str, np.ndarray]:
        if first <= self.deadly_epoch < first + len(inputs["clock_m"]):
            os.kill(os.getpid(), signal.SIGKILL)
        return super().measure(first, inputs)
