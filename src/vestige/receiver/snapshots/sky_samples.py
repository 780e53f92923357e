"""The E6 samples of a sky: those of the recording that `vestige simulate` writes of the same scenario.

Satellites, rays, spoofing signals, jammers and noise are summed once and go through one front end. The stretches of
the recorder (10 ms) that hold some window are made, and the last of them are kept for the other satellites: the
windows of one RECS lie within some 40 ms.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from jaxtyping import Complex64

from vestige.receiver.samples.continuous import ContinuousTruth
from vestige.receiver.samples.recorder import BandRecorder, band_noise_key
from vestige.receiver.samples.sampled_epoch import recording_window
from vestige.receiver.samples.satellite_on_air import SatelliteOnAir, continuous_truth
from vestige.receiver.samples.spoofer_interference import SpooferInterference
from vestige.receiver.snapshots.receiver_truth import ReceiverTruth
from vestige.receiver.truth import TruthBlock
from vestige.receiver.truth_around import TruthWithin
from vestige.records import Band, FrontEndStatus, SampleBatch

_KEPT = 16  # stretches, of 1 MB each at 12.5 MHz


@dataclass(frozen=True, eq=False, kw_only=True)
class SkySamples:
    """The E6 samples of all satellites of a block, made when they are asked for."""

    of: ReceiverTruth
    _made: OrderedDict[int, tuple[Complex64[np.ndarray, " n"], FrontEndStatus]] = field(default_factory=OrderedDict)

    @cached_property
    def paths(self) -> tuple[ContinuousTruth, ...]:
        """The truth of each satellite at any time."""
        return tuple(
            continuous_truth(simulation, _around(truth))
            for simulation, truth in zip(self.of.simulations, self.of.truth, strict=True)
        )

    @cached_property
    def _recorder(self) -> BandRecorder:
        simulation = self.of.simulations[0]
        return BandRecorder(
            band=Band.E6,
            sky=tuple(
                signal
                for one, path in zip(self.of.simulations, self.paths, strict=True)
                for signal in SatelliteOnAir(simulation=one, path=path).received(Band.E6)
            ),
            reference=simulation.start,
            front_end=simulation.front_end,
            noise_key=band_noise_key(self.of.seed, Band.E6),
            interference=SpooferInterference(simulation=simulation, band=Band.E6)
            if simulation.spoofer.attacks
            else None,
        )

    def around(self, expected_s: float, n_chips: int) -> tuple[SampleBatch, FrontEndStatus]:
        """Return the samples around a RECS, and what the front end says of them.

        Parameters
        ----------
        expected_s
            When the receiver expects the first chip, in s after the scenario's start on its own clock.
        n_chips
            Chips of the RECS.
        """
        wanted = recording_window(expected_s, n_chips, self._recorder.front_end)
        length = self._recorder.length
        numbers = range(wanted.start // length, -(-wanted.stop // length))
        stretches = [self._stretch(number) for number in numbers]
        skip = wanted.start - numbers.start * length
        samples = np.concatenate([samples for samples, _ in stretches])[skip : skip + len(wanted)]
        return self._recorder.batch(wanted.start, samples), _status([status for _, status in stretches])

    def _stretch(self, number: int) -> tuple[Complex64[np.ndarray, " n"], FrontEndStatus]:
        if number in self._made:
            self._made.move_to_end(number)
        else:
            self._made[number] = self._recorder.stretch(number)
            if len(self._made) > _KEPT:
                self._made.popitem(last=False)
        return self._made[number]


def _around(truth: TruthBlock) -> TruthBlock:
    if not isinstance(truth, TruthWithin):
        raise TypeError("the samples of a sky need the truth around its epochs, as `SimulatedReceiver.truth` gives it")
    return truth.around


def _status(stretches: list[FrontEndStatus]) -> FrontEndStatus:
    """Return what a front end says of stretches: the mean of power and gain, and whether it clips in one of them."""
    return FrontEndStatus(
        agc_gain_db=float(np.mean([one.agc_gain_db for one in stretches])),
        total_power_db=float(np.mean([one.total_power_db for one in stretches])),
        saturated=any(one.saturated for one in stretches),
    )
