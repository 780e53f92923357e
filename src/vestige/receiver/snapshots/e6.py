"""Simulate E6 of a block at both fidelities: draw banks of correlators, or make samples on request."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice

import numpy as np
from jaxtyping import Bool, Float

from vestige.constants import E6_CARRIER_HZ, GAMMA_E1_E6, SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.e1_taps import e6_power_rise_db, power_noise_db
from vestige.receiver.correlators.other_signals import other_signals_density
from vestige.receiver.draws import rows_of
from vestige.receiver.samples.line_of_sight_samples import LineOfSightSamples
from vestige.receiver.snapshots.e1 import pseudorange_m, range_acceleration_mps2, range_rate_mps, single
from vestige.receiver.snapshots.receiver_truth import ReceiverTruth
from vestige.receiver.snapshots.sky_samples import SkySamples
from vestige.receiver.truth import TruthBlock
from vestige.records import Band, FrontEndStatus, Handover, SampleBatch
from vestige.records.snapshot_block import BankBlock, FrontEndBlock, Handovers
from vestige.sample_processor.correlator import correlate

# number of iterations for the travel time, as in the hand-over; each iteration gains five decimals
_LIGHT_TIME_STEPS = 4
_MADE_TOGETHER = 32  # number of hand-overs that are made one after another; the chips of a hand-over take 10 KB


@dataclass(frozen=True, eq=False)
class DrawnE6:
    """E6 at the fidelity `correlators`, whose banks are drawn from their distribution, without chips."""

    of: ReceiverTruth

    def correlate(
        self,
        asked: Bool[np.ndarray, "n m"],
        handovers: Handovers,  # noqa: ARG002  (the model needs no chips)
        offsets_m: Float[np.ndarray, " n_taps"],
    ) -> BankBlock:
        """Return the requested banks of satellites in view at epochs with RECS, with NaN in all other banks."""
        of = self.of
        taps, noise_power, integration_s = _nothing(of.shape, offsets_m.size)
        if of.recs_rows.size:
            for column, (simulation, truth, arrived) in enumerate(
                zip(of.simulations, of.of_recs, of.arrived, strict=True)
            ):
                if asked[of.rows, column].any():
                    predicted_m = truth.iono_diff_m + truth.bias_m - of.e1_error_m[of.rows, column]
                    others = None if self._other_signals is None else self._other_signals[:, column]
                    drawn = simulation.drawn_banks(of.first_recs, truth, arrived, predicted_m, offsets_m, others)
                    taps[of.rows, column], noise_power[of.rows, column] = drawn
                    integration_s[of.rows, column] = simulation.integration_s
        asked = asked & of.in_view
        return BankBlock(
            offsets_m=offsets_m,
            taps=np.where(asked[..., None], taps, np.nan),
            noise_power=np.where(asked, noise_power, np.nan),
            integration_s=np.where(asked, integration_s, np.nan),
        )

    @cached_property
    def _other_signals(self) -> Float[np.ndarray, "k m"] | None:
        """Density of all signals except each satellite's own E6-C, divided by N0; None on a single line of sight."""
        of = self.of
        if of.simulations[0].elevation is None:
            return None
        cn0_dbhz = [
            one.cn0_dbhz + 20 * np.log10(truth.geometry.amplitude)
            for one, truth in zip(of.simulations, of.of_recs, strict=True)
        ]
        power = [
            1 + np.sum(np.abs(truth.rays.amplitude) ** 2, axis=1) + np.sum(10 ** (truth.e6.power_db / 10), axis=1)
            for truth in of.of_recs
        ]
        return other_signals_density(np.stack(cn0_dbhz, axis=1), np.stack(power, axis=1), of.simulations[0].front_end)

    def front_end(self) -> FrontEndBlock:
        """Return the power of the band, with a gain of 0 dB, because banks are drawn before the gain control."""
        of, simulation = self.of, self.of.simulations[0]
        power_db, gain_db = np.full((2, of.n), np.nan)
        if of.recs_rows.size:
            received_dbhz = np.stack(
                [
                    np.where(truth.geometry.in_view, one.cn0_dbhz + 20 * np.log10(truth.geometry.amplitude), np.nan)
                    for one, truth in zip(of.simulations, of.of_recs, strict=True)
                ],
                axis=1,
            )
            bandwidth_hz = simulation.front_end.power_bandwidth_hz
            power_db[of.rows] = e6_power_rise_db(of.of_recs, received_dbhz, bandwidth_hz=bandwidth_hz) + power_noise_db(
                of.seed,
                of.first_recs,
                of.recs_rows.size,
                band=Band.E6,
                bandwidth_hz=bandwidth_hz,
                averaging_s=simulation.integration_s,
            )
            gain_db[of.rows] = 0.0
        return _reported(gain_db, power_db, np.zeros(of.n, np.bool_))


@dataclass(frozen=True, eq=False)
class SimulatedE6Samples:
    """E6 at the fidelity `samples`, whose samples are made on request.

    The satellites of a sky share the samples of one recording (`sky_samples`). A single line of sight has separate
    samples for each epoch. The status of the front end is stored both under a sky and on a single line of sight.
    """

    of: ReceiverTruth
    _statuses: dict[tuple[int, int], FrontEndStatus] = field(default_factory=dict)

    def correlate(
        self, asked: Bool[np.ndarray, "n m"], handovers: Handovers, offsets_m: Float[np.ndarray, " n_taps"]
    ) -> BankBlock:
        """Return the requested banks, with NaN in all other banks.

        A requested bank is also NaN if the satellite is out of view, if the epoch has no RECS or no hand-over, or if
        the samples do not cover the RECS.
        """
        of = self.of
        taps, noise_power, integration_s = _nothing(of.shape, offsets_m.size)
        for epoch, column, made in self._handed_over(asked, handovers):
            handover = self._without_growth(self._without_delay(made, epoch, column), epoch, column)
            handover = self._with_ionosphere(handover, epoch, column)
            bank = correlate(self.samples(epoch, column), handover, offsets_m)
            if bank is not None:
                taps[epoch, column], noise_power[epoch, column] = bank.taps, bank.noise_power
                integration_s[epoch, column] = of.simulations[column].integration_s
        return BankBlock(offsets_m=offsets_m, taps=taps, noise_power=noise_power, integration_s=integration_s)

    def _handed_over(self, asked: Bool[np.ndarray, "n m"], handovers: Handovers) -> Iterator[tuple[int, int, Handover]]:
        """Yield epoch, column and hand-over of each requested RECS that has samples and a hand-over.

        The hand-overs of `_MADE_TOGETHER` RECS are made one after another. The code that makes a hand-over then stays
        in the caches of the CPU, while the samples of a RECS would displace this code.
        """
        places = zip(*(axis.tolist() for axis in np.nonzero(asked & self._made)), strict=True)
        while part := tuple(islice(places, _MADE_TOGETHER)):
            for (epoch, column), handover in zip(part, [handovers.at(*place) for place in part], strict=True):
                if handover is not None:
                    yield epoch, column, handover

    def samples(self, epoch: int, column: int) -> SampleBatch:
        """Return the samples around the RECS of one satellite and one epoch, with the time tags that follow from E1.

        If an attacker delays E1 by more than `CLOCK_FOLLOWS_S`, the delay is subtracted from the time tags.
        """
        of = self.of
        simulation, row = of.simulations[column], (epoch - of.rows.start) // of.every
        if simulation.elevation is None:
            batch, status = self._lines_of_sight[column].around(row)
            later_s = -float(self._seconds_late_m[column][epoch]) / SPEED_OF_LIGHT_MPS
        else:
            expected_s = self._expected_s(row, column)
            batch, status = self._sky.around(expected_s, simulation.n_chips)
            later_s = self._time_off_s(expected_s, epoch, column)
        self._statuses[epoch, column] = status
        return replace(batch, start=batch.start + later_s) if later_s else batch

    @cached_property
    def _made(self) -> Bool[np.ndarray, "n m"]:
        """Whether a satellite has samples at an epoch: it is in view, and it sends a RECS."""
        made = np.zeros(self.of.shape, np.bool_)
        made[self.of.rows] = self.of.in_view[self.of.rows]
        return made

    @cached_property
    def _sky(self) -> SkySamples:
        return SkySamples(of=self.of, band=Band.E6)

    @cached_property
    def _lines_of_sight(self) -> tuple[LineOfSightSamples, ...]:
        of = self.of
        return tuple(
            LineOfSightSamples(simulation=simulation, truth=truth, arrived=arrived, first=of.first_recs)
            for simulation, truth, arrived in zip(of.simulations, of.of_recs, of.arrived, strict=True)
        )

    def _expected_s(self, row: int, column: int) -> float:
        """Return the true arrival of one RECS of a satellite plus the attacker's delay, in s after the start."""
        truth, arrived = self.of.of_recs[column], self.of.arrived[column]
        return float(truth.time_s[row] + arrived.dt_s[row] + self._repeated_later_m[column][row] / SPEED_OF_LIGHT_MPS)

    def _time_off_s(self, expected_s: float, epoch: int, column: int) -> float:
        """Return the correction in s of the time tags of samples, which removes a delay above `CLOCK_FOLLOWS_S`.

        `_without_delay` removes the same delay from the hand-over. During the delay the receiver's clock drifts. The
        correction also subtracts this drift, because the hand-over has the clock error of the epoch.
        """
        if not self._seconds_late_m[column][epoch]:
            return 0.0
        row = (epoch - self.of.rows.start) // self.of.every
        late_s = float(self._repeated_later_m[column][row]) / SPEED_OF_LIGHT_MPS
        early_m, late_m = self._sky.paths[column].clock_m(np.array([expected_s - late_s, expected_s]))
        return -late_s - float(late_m - early_m) / SPEED_OF_LIGHT_MPS

    def _without_delay(self, handover: Handover, epoch: int, column: int) -> Handover:
        """Return the hand-over that the receiver would make without an attacker's delay over `CLOCK_FOLLOWS_S`.

        A hand-over extrapolates the observation of the epoch to the reception of the RECS. With a delay of seconds the
        reception is seconds later, and the clock drifts in the meantime. A real receiver uses the observation at the
        later time, which has the same satellite position and clock error as the RECS. So the model uses the hand-over
        of the true signal, and subtracts the delay from the time tags of the samples. On a single line of sight the
        clock follows the attacker, so the hand-over is not changed.
        """
        simulation, late_m = self.of.simulations[column], float(self._seconds_late_m[column][epoch])
        if simulation.elevation is None or not late_m:
            return handover
        here = self._here(epoch, column)
        range_m, rate_mps = float(pseudorange_m(self.of)[epoch, column]), float(range_rate_mps(simulation, here)[0])
        late = range_m, rate_mps, float(range_acceleration_mps2(simulation, here)[0])
        true = range_m - late_m, rate_mps - float(here.e1.rate_error_mps[0]), float(here.acceleration_mps2[0])
        late_s, true_s = _travel_s(*late), _travel_s(*true)
        to_hz = -E6_CARRIER_HZ / SPEED_OF_LIGHT_MPS
        return replace(
            handover,
            start_time=handover.start_time + (true_s - late_s),
            doppler_hz=to_hz * (true[1] + true[2] * true_s),
            doppler_rate_hz_per_s=to_hz * true[2],
        )

    def _without_growth(self, handover: Handover, epoch: int, column: int) -> Handover:
        """Return a hand-over without the growth of an attacker's delay over the travel time.

        The errors of an epoch are the errors at the reception of the epoch's RECS. The RECS and the E1 signal arrive
        together and were sent together at the epoch, so both have the attacker's delay at the epoch. A hand-over
        extrapolates the observation over the travel time and thereby adds the growth of the attacker's delay, which is
        0.7 m at 9 m/s. In an observation of a real receiver the attacker's delay is smaller by this growth. If
        `_without_delay` has removed a delay from a hand-over, the growth is removed, too, and the hand-over is returned
        unchanged.
        """
        truth, start = self.of.truth[column], self.of.simulations[column].start
        growth_mps = float(truth.e1.rate_error_mps[epoch])
        if not growth_mps or self._seconds_late_m[column][epoch]:
            return handover
        travel_s = handover.start_time - (start + float(truth.time_s[epoch]))
        return replace(handover, start_time=handover.start_time + -growth_mps * travel_s / SPEED_OF_LIGHT_MPS)

    def _with_ionosphere(self, handover: Handover, epoch: int, column: int) -> Handover:
        """Return a hand-over with the ionospheric delay E6 − E1 that the receiver predicts from the message.

        The receiver predicts the delay at each epoch, while the assistance of a recording has one value per satellite
        for all epochs.
        """
        ionosphere_m = float(self.of.truth[column].broadcast_ionosphere_e1_m[epoch])
        if not ionosphere_m:
            return handover
        later_s = (GAMMA_E1_E6 - 1) * ionosphere_m / SPEED_OF_LIGHT_MPS
        return replace(handover, start_time=handover.start_time + later_s)

    @cached_property
    def _seconds_late_m(self) -> tuple[Float[np.ndarray, " n"], ...]:
        """Delay of each satellite's E1 signal in m, or 0 for delays up to `CLOCK_FOLLOWS_S`."""
        return tuple(one.seconds_late_m(truth) for one, truth in zip(self.of.simulations, self.of.truth, strict=True))

    @cached_property
    def _repeated_later_m(self) -> tuple[Float[np.ndarray, " k"], ...]:
        """Delay in m of the RECS to which each satellite's E1 hand-over leads, relative to the true RECS."""
        of = self.of
        return tuple(one.repeated_later_m(truth) for one, truth in zip(of.simulations, of.of_recs, strict=True))

    def _here(self, epoch: int, column: int) -> TruthBlock:
        """Return the truth of one satellite at one epoch."""
        return rows_of(self.of.truth[column], slice(epoch, epoch + 1))

    def front_end(self) -> FrontEndBlock:
        """Return the front end's status around the RECS of all satellites: mean power and gain, and any clipping."""
        of = self.of
        power_db, gain_db = np.full((2, of.n), np.nan)
        saturated = np.zeros(of.n, np.bool_)
        epochs, columns = np.nonzero(self._made)
        own = [self._status(*place) for place in zip(epochs.tolist(), columns.tolist(), strict=True)]
        own_power_db = np.array([one.total_power_db for one in own], np.float64)
        own_gain_db = np.array([one.agc_gain_db for one in own], np.float64)
        satellites = np.count_nonzero(self._made, axis=1)
        for count in np.unique(satellites[satellites > 0]).tolist():
            rows = satellites == count
            power_db[rows] = own_power_db[rows[epochs]].reshape(-1, count).mean(axis=1)
            gain_db[rows] = own_gain_db[rows[epochs]].reshape(-1, count).mean(axis=1)
        saturated[epochs[np.array([one.saturated for one in own], np.bool_)]] = True
        return _reported(gain_db, power_db, saturated)

    def _status(self, epoch: int, column: int) -> FrontEndStatus:
        if (epoch, column) not in self._statuses:
            self.samples(epoch, column)
        return self._statuses[epoch, column]


@dataclass(frozen=True, slots=True, eq=False)
class FrontEnds(Mapping[Band, FrontEndBlock]):
    """Power and gain of the front ends by band.

    The values of E6 are computed on request.
    """

    e1: FrontEndBlock | None
    e6: DrawnE6 | SimulatedE6Samples
    _known: dict[Band, FrontEndBlock] = field(default_factory=dict)

    def __getitem__(self, band: Band) -> FrontEndBlock:
        if band is Band.E1 and self.e1 is None:
            raise KeyError(band)
        if band not in self._known:
            self._known[band] = self.e6.front_end() if self.e1 is None or band is Band.E6 else self.e1
        return self._known[band]

    def __iter__(self) -> Iterator[Band]:
        return iter((Band.E6,) if self.e1 is None else (Band.E1, Band.E6))

    def __len__(self) -> int:
        return len(tuple(iter(self)))


def _travel_s(range_m: float, rate_mps: float, acceleration_mps2: float) -> float:
    """Return the travel time in s of a signal sent at the epoch, if the pseudorange has a constant acceleration."""
    travel_s = 0.0
    for _ in range(_LIGHT_TIME_STEPS):
        travel_s = (range_m + rate_mps * travel_s + acceleration_mps2 * travel_s**2 / 2) / SPEED_OF_LIGHT_MPS
    return travel_s


def _reported(
    gain_db: Float[np.ndarray, " n"], power_db: Float[np.ndarray, " n"], saturated: Bool[np.ndarray, " n"]
) -> FrontEndBlock:
    return FrontEndBlock(agc_gain_db=single(gain_db), total_power_db=single(power_db), saturated=saturated)


def _nothing(shape: tuple[int, int], n_taps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return taps, noise powers and integration times of a block before any correlation, all NaN."""
    noise_power, integration_s = np.full((2, *shape), np.nan)
    return np.full((*shape, n_taps), np.nan + 0j), noise_power, integration_s
