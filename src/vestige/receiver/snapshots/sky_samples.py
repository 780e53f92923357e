"""Make the samples of a sky in one band, as in the recording that `vestige simulate` writes for the scenario.

All satellites, multipath, spoofing signals, jammers and noise are summed once and go through one front end. Only the
stretches of the recorder (10 ms) that overlap the requested window of samples are made. The latest stretches are kept,
because the windows of other satellites overlap the same stretches. If no attack delays the signals, the windows of all
satellites lie within about 40 ms for the RECS of an epoch, and within about 130 ms for E1.

E6 equals the recording to the last bit. E1 differs from the recording only in the symbols of E1-B. In a campaign the
symbols of E1-B are random, because no receiver of a campaign decodes the symbols.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from jaxtyping import Complex64
from scipy import fft

from vestige.receiver.samples.continuous import ContinuousTruth
from vestige.receiver.samples.recorder import BandRecorder, band_noise_key
from vestige.receiver.samples.sampled_epoch import recording_window
from vestige.receiver.samples.satellite_on_air import SatelliteOnAir, continuous_truth
from vestige.receiver.samples.spoofer_interference import SpooferInterference
from vestige.receiver.snapshots.receiver_truth import ReceiverTruth
from vestige.receiver.truth import TruthBlock
from vestige.receiver.truth_around import TruthWithin
from vestige.records import Band, FrontEndStatus, SampleBatch

_KEPT = 16  # number of stretches that are kept, of 1 MB each at 12.5 MHz


@dataclass(frozen=True, eq=False, kw_only=True)
class SkySamples:
    """The samples of one band with all satellites of a block, made on request."""

    of: ReceiverTruth
    band: Band
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
            band=self.band,
            sky=tuple(
                signal
                for one, path in zip(self.of.simulations, self.paths, strict=True)
                for signal in SatelliteOnAir(simulation=one, path=path).received(self.band)
            ),
            reference=simulation.start,
            front_end=simulation.front_end,
            noise_key=band_noise_key(self.of.seed, self.band),
            interference=SpooferInterference(simulation=simulation, band=self.band)
            if simulation.spoofer.attacks
            else None,
        )

    def around(self, expected_s: float, n_chips: int) -> tuple[SampleBatch, FrontEndStatus]:
        """Return the samples around a RECS and the status of the front end.

        Parameters
        ----------
        expected_s
            Time at which the receiver expects the first chip, in s after the scenario's start on the receiver's clock.
        n_chips
            Number of chips of the RECS.
        """
        wanted = recording_window(expected_s, n_chips, self._recorder.front_end)
        stretches = [self._stretch(number) for number in self._numbers(wanted)]
        return self._batch(wanted, [samples for samples, _ in stretches]), _status([status for _, status in stretches])

    def between(self, start_s: float, stop_s: float) -> SampleBatch:
        """Return the samples between two times in s after the scenario's start, before gain control.

        The noise has power 1 in the returned samples. The effects of a quantiser on the signal remain.
        """
        rate_hz = self._recorder.front_end.sample_rate_hz
        wanted = range(math.floor(start_s * rate_hz), math.ceil(stop_s * rate_hz))
        return self._batch(wanted, [self._before_gain(number) for number in self._numbers(wanted)])

    def power_near(self, time_s: float, bandwidth_hz: float) -> tuple[float, bool]:
        """Return the power around the carrier in the stretch that contains a time, and whether the stretch is clipped.

        The power is relative to the noise in the same bandwidth.

        Parameters
        ----------
        time_s
            Time in s after the scenario's start on the receiver's clock.
        bandwidth_hz
            Two-sided bandwidth in Hz in which the power is measured.
        """
        front_end, length = self._recorder.front_end, self._recorder.length
        number = math.floor(time_s * front_end.sample_rate_hz) // length
        spectrum = fft.fft(self._before_gain(number))
        within = np.abs(fft.fftfreq(length, 1 / front_end.sample_rate_hz)) <= bandwidth_hz / 2
        share = np.count_nonzero(within) / length * front_end.sample_rate_hz / front_end.power_bandwidth_hz
        power = float(np.sum(np.abs(spectrum[within].astype(np.complex128)) ** 2)) / length**2
        return power / min(share, 1.0), self._stretch(number)[1].saturated

    def _numbers(self, wanted: range) -> range:
        """Return the numbers of the stretches that overlap the wanted samples."""
        length = self._recorder.length
        return range(wanted.start // length, -(-wanted.stop // length))

    def _batch(self, wanted: range, stretches: list[Complex64[np.ndarray, " n"]]) -> SampleBatch:
        """Return the wanted samples, cut from the samples of the stretches that overlap the wanted samples."""
        skip = wanted.start % self._recorder.length
        return self._recorder.batch(wanted.start, np.concatenate(stretches)[skip : skip + len(wanted)])

    def _before_gain(self, number: int) -> Complex64[np.ndarray, " n"]:
        """Return the samples of a stretch, scaled to the power before gain control and quantiser."""
        samples, status = self._stretch(number)
        if self._recorder.front_end.bits is None:
            return samples
        parts = samples.view(np.float32)
        power = 2 * float(np.einsum("i,i->", parts, parts)) / parts.size
        return samples * np.float32(10 ** (status.total_power_db / 20) / math.sqrt(power))

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
    """Return the status of a front end over stretches: mean power and gain, and whether any stretch is clipped."""
    return FrontEndStatus(
        agc_gain_db=float(np.mean([one.agc_gain_db for one in stretches])),
        total_power_db=float(np.mean([one.total_power_db for one in stretches])),
        saturated=any(one.saturated for one in stretches),
    )
