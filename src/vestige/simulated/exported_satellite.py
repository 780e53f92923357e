"""Compute truth, signals on E1 and E6, and E1 observations of one satellite in an exported recording."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, MEDIAN_TRAVEL_TIME_S, SPEED_OF_LIGHT_MPS
from vestige.receiver.samples.attacked_sky import latest_s
from vestige.receiver.samples.continuous import ContinuousTruth
from vestige.receiver.samples.recorder import ReceivedSatellite
from vestige.receiver.samples.satellite_on_air import SatelliteOnAir, broadcast_group_delay_s, continuous_truth
from vestige.receiver.simulation import CLOCK_FOLLOWS_S, Simulation
from vestige.receiver.snapshots.e1 import is_tracked, reported_cn0_dbhz
from vestige.receiver.truth_around import TAIL_S, TruthAround, TruthWithin, epochs_around
from vestige.records import Band, E1Observation
from vestige.signal_generator.waveform import Sequence
from vestige.streams import stream

# The numbers of epochs that are computed at once limit the needed memory.
_AT_ONCE = 10_000  # number of epochs whose spoofing delays are computed at once
_PASSED_AT_ONCE = 1000  # number of epochs before `first` whose truth is computed at once


@dataclass(frozen=True, kw_only=True)
class ExportedSatellite:
    """Satellite in the epochs `first` to `end` − 1 of a campaign."""

    simulation: Simulation
    interval_s: float  # time between two epochs in s
    first: int
    end: int
    symbols: Sequence | None = None  # symbols of E1-B, counted from the start; None for random symbols
    forged_symbols: Sequence | None = None  # symbols of the message that an attacker invents; None for random symbols
    known: TruthWithin | None = None  # truth at the epochs; None if the truth is not yet computed

    @property
    def svid(self) -> int:
        """SVID of the satellite."""
        return self.simulation.svid

    @property
    def tail_s(self) -> float:
        """Time in s from the last epoch to the last sample, long enough for the last RECS in every spoofing signal."""
        return tail_after_s(self.simulation, self.interval_s, self.first, self.end)

    def blocks(self, n_epochs: int) -> Iterator[ExportedSatellite]:
        """Yield the satellite in successive blocks of at most `n_epochs` epochs, each with its truth.

        The bits of truth, samples and observations do not depend on the size of the blocks.
        """
        before, after = epochs_around(self.interval_s, self.tail_s)
        process = TruthAround(self.simulation, before=before, after=after)
        for begin in range(0, self.first, _PASSED_AT_ONCE):
            process.advance(begin, min(_PASSED_AT_ONCE, self.first - begin))
        for begin in range(self.first, self.end, n_epochs):
            count = min(n_epochs, self.end - begin)
            yield replace(self, first=begin, end=begin + count, known=process.advance(begin, count))

    @cached_property
    def truth(self) -> TruthWithin:
        """Truth at the epochs `first` to `end` − 1."""
        if self.known is not None:
            return self.known
        (whole,) = self.blocks(self.end - self.first)
        return whole.truth

    @cached_property
    def path(self) -> ContinuousTruth:
        """Truth of the satellite's signals as a function of time."""
        return continuous_truth(self.simulation, self.truth.around)

    @property
    def _own(self) -> slice:
        """Rows of the epochs `first` to `end` − 1 in the truth of `path`, which also has earlier and later epochs."""
        before = int(np.searchsorted(self.path.truth.time_s, self.truth.time_s[0]))
        return slice(before, before + self.end - self.first)

    @cached_property
    def bgd_s(self) -> float:
        """BGD(E1,E6) in s that the satellite broadcasts; `bias_m` of the truth contains the error of this BGD."""
        return broadcast_group_delay_s(self.simulation.seed, self.svid)

    @cached_property
    def received_s(self) -> Float[np.ndarray, " n"]:
        """Receiver time in s after the scenario's start at which the first chip of each epoch arrives on E6."""
        return self.path.received_s()[self._own]

    @property
    def tag_s(self) -> Float[np.ndarray, " n"]:
        """Time tags of the E1 observations, in s after the scenario's start on the receiver's clock."""
        return self.truth.time_s + MEDIAN_TRAVEL_TIME_S

    @cached_property
    def e1_error_m(self) -> Float[np.ndarray, " n"]:
        """Error of the E1 pseudorange at the epochs in m, from noise, multipath and attacks."""
        return self.truth.e1_noise_m + self.simulation.e1_multipath_m(self.truth) + self.truth.e1.error_m

    @property
    def range_offset_m(self) -> Float[np.ndarray, " n"]:
        """E6 range minus its prediction from E1 at the epochs in m, without multipath, noise and attacks on E6."""
        return self.truth.iono_diff_m + self.truth.bias_m - self.e1_error_m

    def received(self, band: Band) -> tuple[ReceivedSatellite, ...]:
        """Return the received signal of the satellite in a band, and its spoofing signals."""
        return SatelliteOnAir(
            simulation=self.simulation, path=self.path, symbols=self.symbols, forged_symbols=self.forged_symbols
        ).received(band)

    @cached_property
    def observations(self) -> tuple[E1Observation | None, ...]:
        """E1 observations at the time tag of each epoch, which is 86 ms after the epoch.

        The entry of an epoch is None if the satellite is below the mask, or the receiver has no lock or is still
        acquiring. The entry is also None while the receiver follows a spoofing signal with a delay of 0.1 s or more.
        The reason is that the clock of the receiver then follows the delay, but the time of the samples does not.

        An attacker's delay depends on the time of transmission. The signal that is received at the time tag was sent
        some milliseconds before or after the epoch. So the delay at the epoch is corrected by the rate of the delay
        times the time between epoch and transmission.
        """
        to_hz, truth = -E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS, self.truth
        t_s = self.tag_s
        grown_m = truth.e1.rate_error_mps * (t_s - self.received_s)
        ionosphere_m = self.path.ionosphere_m(Band.E1)[self._own]
        pseudorange_m = self.path.range_m(t_s) + ionosphere_m + self.e1_error_m + grown_m
        phase_m = self.path.range_m(t_s) - ionosphere_m + truth.e1.error_m + grown_m + truth.e1_phase_noise_m
        phase_cycles = self._ambiguity - to_hz * phase_m
        doppler_hz = to_hz * (self.path.rate_mps(t_s) + truth.e1_rate_noise_mps + truth.e1.rate_error_mps)
        rate_hz_per_s = to_hz * self.path.acceleration_mps2(t_s)
        multipath_m = self.simulation.e1_multipath_m(truth)
        cn0_dbhz = reported_cn0_dbhz(self.simulation, truth, multipath_m, first=self.first)
        same_time = np.abs(truth.e1.error_m) < CLOCK_FOLLOWS_S * SPEED_OF_LIGHT_MPS
        shown = is_tracked(self.simulation, truth) & same_time
        return tuple(
            E1Observation(
                svid=self.svid,
                pseudorange_m=float(pseudorange_m[row]),
                carrier_phase_cycles=float(phase_cycles[row]),
                doppler_hz=float(doppler_hz[row]),
                doppler_rate_hz_per_s=float(rate_hz_per_s[row]),
                cn0_dbhz=float(cn0_dbhz[row]),
            )
            if shown[row]
            else None
            for row in range(truth.time_s.size)
        )

    @property
    def _ambiguity(self) -> int:
        """Random ambiguity of the carrier phase in whole cycles; a receiver counts cycles from an arbitrary number."""
        return int(stream(self.simulation.seed, "carrier phase", self.svid).integers(-1_000_000, 1_000_000))

    def truth_table(self) -> dict[str, list[str]]:
        """Return the truth of every epoch as columns of text, by name of the column of `truth.csv`."""
        truth, path = self.truth, self.path
        t_s = self.received_s
        sent = [self.simulation.start + float(elapsed_s) for elapsed_s in truth.time_s]
        columns: dict[str, list[str]] = {
            "epoch": [str(epoch) for epoch in range(self.first, self.end)],
            "svid": [str(self.svid)] * len(sent),
            "gst_week": [str(time.week) for time in sent],
            "gst_second": [f"{time.second + time.fraction:.1f}" for time in sent],
        }
        numbers = {
            "received_s": t_s - truth.time_s,
            "range_m": path.range_m(t_s) - path.troposphere_m(t_s) - path.clock_m(t_s),
            "clock_m": path.clock_m(t_s),
            "doppler_e1_hz": -E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS * path.rate_mps(t_s),
            "doppler_e6_hz": -E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS * path.rate_mps(t_s),
            "group_delay_m": np.full(truth.time_s.size, path.group_delay_m),
            "iono_diff_m": truth.iono_diff_m,
            "bias_m": truth.bias_m,
            "e1_noise_m": truth.e1_noise_m,
            "e1_phase_noise_m": truth.e1_phase_noise_m,
            "e1_rate_noise_mps": truth.e1_rate_noise_mps,
            "e1_multipath_m": self.simulation.e1_multipath_m(truth),
            "e1_attack_error_m": truth.e1.error_m,
            "range_offset_m": self.range_offset_m,
        }
        if path.atmosphere is not None:
            numbers |= {"troposphere_m": path.troposphere_m(t_s), "ionosphere_e1_m": truth.broadcast_ionosphere_e1_m}
        for ray in range(truth.rays.delay_m.shape[1]):
            name = f"ray{ray + 1}"
            numbers |= {
                f"{name}_delay_m": truth.rays.delay_m[:, ray],
                f"{name}_amplitude": np.abs(truth.rays.amplitude[:, ray]),
                f"{name}_phase_rad": np.angle(truth.rays.amplitude[:, ray]),
                f"{name}_doppler_hz": truth.rays.doppler_hz[:, ray],
            }
        for k in range(truth.e6.delay_m.shape[1]):
            for band, effects in (("e1", truth.e1_attack), ("e6", truth.e6)):
                numbers[f"attack{k}_{band}_delay_m"] = effects.delay_m[:, k]
                numbers[f"attack{k}_{band}_power_db"] = effects.power_db[:, k]
        return columns | {name: [repr(float(value)) for value in values] for name, values in numbers.items()}


def tail_after_s(simulation: Simulation, interval_s: float, first: int, end: int) -> float:
    """Return the time in s from the last epoch to the last sample, enough for the last RECS in every spoofing signal.

    The time is for the satellite of `simulation` and the epochs `first` to `end` − 1, which are `interval_s` apart.
    """
    pieces = (np.arange(begin, min(begin + _AT_ONCE, end)) for begin in range(first, end, _AT_ONCE))
    return TAIL_S + max(latest_s(simulation.spoofer, simulation.svid, interval_s * one) for one in pieces)
