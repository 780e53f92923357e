"""Export some epochs of a campaign as an ACAS test case: all data that an independent receiver needs, and the truth.

The test case contains the epochs `first` to `end` − 1. The samples of E1 and E6 are continuous and contain all
satellites of the scenario (`receiver.samples.continuous`). The test case also contains RECS, group delays, keys, and E1
observations with the errors that `truth.csv` states. `vestige run` processes the same epochs with the same RECS, keys
and errors. In a scenario with a constellation and `fidelity = "samples"`, the E6 samples are equal to the samples of
the campaign. The E1 samples are equal except for the symbols of E1-B. In a scenario with a single line of sight, test
case and campaign have different noise. The reason is that the campaign makes separate noise for each epoch.

Truth, samples and files are made in blocks of epochs, so the memory for the truth does not grow with the number of
epochs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vestige.broadcast.sky_message import SkyMessage, make_sky_message
from vestige.constants import SUBFRAME_S
from vestige.crypto.osnma.operator.osnma_operator import OsnmaOperator
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.crypto.recs.recs_segment import key_time
from vestige.errors import VestigeError
from vestige.receiver.samples.recorder import ReceivedSatellite
from vestige.receiver.samples.sampled_epoch import SUBFRAMES_BEFORE
from vestige.receiver.samples.spoofer_interference import SpooferInterference
from vestige.receiver.simulation import Simulation
from vestige.records import Assistance, Band, EncryptedSegment, GroupDelay
from vestige.records.observation_epoch import ObservationEpoch
from vestige.scenario.campaign import CampaignScenario
from vestige.simulated.exported_receiver import ExportedReceiver
from vestige.simulated.exported_satellite import ExportedSatellite, tail_after_s
from vestige.time import GalileoTime

EPOCHS_IN_MEMORY = 500  # number of epochs in a block, which needs 3 MB with eight satellites
DEFAULT_RANGE_M = 25_000_000.0  # range in m if the scenario has no range; real ranges are 23,200 to 29,000 km
MAX_RATE_MPS = 10_000.0  # largest range rate in m/s, reached by a receiver in a low orbit
_MESSAGE_SPARE_S = 1.0  # time in s from the last sample to the end of the message
PROCESSABLE_TRAVEL_TIME_S = (0.03, 0.14)  # limits in s of the travel time in a recording


def with_default_range(scenario: CampaignScenario) -> CampaignScenario:
    """Return the scenario; if its line of sight has the range 0, return a scenario with a range of 25,000 km."""
    path = scenario.line_of_sight
    return scenario if path.s0_m else scenario.model_copy(update={"line_of_sight": replace(path, s0_m=DEFAULT_RANGE_M)})


@dataclass(frozen=True, kw_only=True)
class AcasTestCase:
    """Test case with the epochs `first` to `end` − 1 of a campaign."""

    scenario: CampaignScenario  # campaign whose satellites have realistic ranges
    first: int
    end: int
    block_epochs: int = EPOCHS_IN_MEMORY  # largest number of epochs in memory, which does not affect the files

    def __post_init__(self) -> None:
        if not 0 <= self.first < self.end <= self.scenario.epochs:
            raise VestigeError(
                f"epochs {self.first}:{self.end}: expected first:end within the scenario's 0:{self.scenario.epochs}"
            )
        offset_s = self.scenario.receiver.clock_offset_s
        if offset_s:
            raise VestigeError(
                f"receiver.clock_offset_s: found {offset_s:g}, expected 0 for a recording; make the recording without "
                "it, and give `vestige process --start` the time that the wrong clock shows"
            )
        for number in range(len(self.satellites)):
            _check_motion((block[0] for block in self.blocks(number)), f"epochs {self.first}:{self.end}")

    @property
    def simulation(self) -> Simulation:
        """Simulation of the receiver and the first satellite of the scenario."""
        return self.scenario.simulations[0]

    @cached_property
    def satellites(self) -> tuple[ExportedSatellite, ...]:
        """All satellites of the scenario, each with all epochs of the test case."""
        message = self.message
        forged = None if message is None else message.forged(self.scenario.seed)
        return tuple(
            ExportedSatellite(
                simulation=one,
                interval_s=self.scenario.interval_s,
                first=self.first,
                end=self.end,
                symbols=None if message is None else message.symbols(one.svid, one.start),
                forged_symbols=None if forged is None else forged.symbols(one.svid, one.start),
            )
            for one in self.scenario.simulations
        )

    def blocks(self, *numbers: int) -> Iterator[tuple[ExportedSatellite, ...]]:
        """Yield successive blocks of epochs, each with its satellites.

        `numbers` are positions in `satellites`. Without `numbers`, each block contains all satellites.
        """
        chosen = [self.satellites[number] for number in numbers] or self.satellites
        if self.end - self.first <= self.block_epochs:
            yield tuple(chosen)  # the satellites keep the truth of this block for the next call
        else:
            yield from zip(*(one.blocks(self.block_epochs) for one in chosen), strict=True)

    @cached_property
    def message(self) -> SkyMessage | None:
        """E1-B messages of the satellites; None for a single line of sight, which has no orbit."""
        scenario, constellation = self.scenario, self.scenario.constellation
        if constellation is None:
            return None
        return make_sky_message(
            [one.elevation.path.ephemeris for one in scenario.simulations if one.elevation is not None],
            self.simulation.osnma_operator(),
            self._message_end,
            first=self._message_begin,
            almanac=constellation.ephemerides(scenario.start_time),
            ionosphere=scenario.atmosphere.models().broadcast,
        )

    @property
    def _message_begin(self) -> GalileoTime | None:
        """Time in the first subframe of the message; None with OSNMA events, where the message has all subframes.

        The message begins `SUBFRAMES_BEFORE` subframes before the first epoch. So tags with ADKD 12 have data to
        authenticate, and the message covers the longest delay of a spoofing signal.
        """
        if self.simulation.osnma.events:
            return None
        first = self.scenario.start_time + self.first * self.scenario.interval_s
        return first.subframe + -float(SUBFRAME_S * SUBFRAMES_BEFORE)

    @property
    def _message_end(self) -> GalileoTime:
        """Time until which the message lasts: past the last sample, and with OSNMA events past the last RECS's key."""
        last = self.scenario.start_time + self.end * self.scenario.interval_s
        end = last + (self.tail_s + _MESSAGE_SPARE_S)
        if not self.simulation.osnma.events:
            return end
        return max(end, last.subframe + (2.0 * SUBFRAME_S - 1.0))  # the keys of the last RECS are sent before this time

    @cached_property
    def tail_s(self) -> float:
        """Time in s from the last epoch to the last sample, long enough for the last RECS in every spoofing signal."""
        epochs = self.scenario.interval_s, self.first, self.end
        return max(tail_after_s(one, *epochs) for one in self.scenario.simulations)

    @cached_property
    def osnma_receiver(self) -> OsnmaReceiver | None:
        """OSNMA receiver that has received all pages; None without OSNMA events, or without E1-B messages."""
        if self.message is None or not self.simulation.osnma.events:
            return None
        receiver = OsnmaReceiver(self.operator.public_keys, self.operator.merkle_tree)
        for pages in self.message.subframes():
            for page in sorted((page for of in pages.values() for page in of), key=lambda one: one.time):
                receiver.process(page)
        receiver.finish()
        return receiver

    @property
    def samples(self) -> range:
        """Numbers of the samples, counted from the scenario's start.

        The samples last from epoch `first` to `tail_s` after the last epoch.
        """
        rate_hz, interval_s = self.scenario.receiver.sample_rate_hz, self.scenario.interval_s
        first_s, last_s = self.first * interval_s, (self.end - 1) * interval_s
        return range(int(first_s * rate_hz), int(np.ceil((last_s + self.tail_s) * rate_hz)))

    def sky(self, band: Band) -> tuple[ReceivedSatellite, ...]:
        """Return all signals in a band, including spoofing signals."""
        return tuple(signal for one in self.satellites for signal in one.received(band))

    @property
    def interference(self) -> dict[Band, SpooferInterference]:
        """Noise and jamming of the attacks by band; empty without attacks."""
        simulation = self.simulation
        if not simulation.spoofer.attacks:
            return {}
        return {band: SpooferInterference(simulation=simulation, band=band) for band in Band}

    def receivers(self) -> Iterator[ExportedReceiver]:
        """Yield the true position and clock in each block of epochs; yield nothing for a single line of sight."""
        if self.scenario.constellation is None:
            return
        for (one,) in self.blocks(0):
            yield ExportedReceiver(scenario=self.scenario, path=one.path, first=one.first, tag_s=one.tag_s)

    def observations(self) -> Iterator[ObservationEpoch]:
        """Yield the E1 observations at the time tag of each epoch; epochs without observations are left out."""
        for block in self.blocks():
            for row, tag_s in enumerate(block[0].tag_s):
                found = {one.svid: seen for one in block if (seen := one.observations[row]) is not None}
                if found:
                    yield ObservationEpoch(time=self.simulation.start + float(tag_s), observations=found)

    @property
    def _recs_numbers(self) -> range:
        """Numbers of the RECS that each satellite sends within the epochs."""
        every = self.scenario.recs.every if self.scenario.constellation is not None else 1
        return range(-(-self.first // every), -(-self.end // every))

    def segments_of(self, simulation: Simulation) -> tuple[EncryptedSegment, ...]:
        """Return the RECS that a satellite sends within the epochs."""
        return tuple(simulation.segment(number)[0] for number in self._recs_numbers)

    @cached_property
    def operator(self) -> OsnmaOperator:
        """OSNMA operator that sends the keys."""
        return self.simulation.osnma_operator()

    def assistance(self) -> Assistance:
        """Return RECS and group delays of all satellites, the received keys, and the predicted ionospheric delays."""
        each = [self.segments_of(one) for one in self.scenario.simulations]
        segments = tuple(segment for same_time in zip(*each, strict=True) for segment in same_time)
        return replace(self.assistance_without_recs(), segments=segments)

    def assistance_without_recs(self) -> Assistance:
        """Return the assistance without RECS, because the RECS of a recording of hours need much memory."""
        simulation, numbers = self.simulation, self._recs_numbers
        if not numbers:
            raise VestigeError(
                f"epochs {self.first}:{self.end}: found no RECS, expected at least one; there is one every "
                f"{self.scenario.recs.every} epochs"
            )
        receiver = self.osnma_receiver
        keys = {
            key.time: key for key in (self.operator.validated_keys() if receiver is None else receiver.filled_keys())
        }
        begin = simulation.transmit_time(numbers[0]).subframe
        end = key_time(simulation.transmit_time(numbers[-1]), simulation.key_delay) + SUBFRAME_S
        return Assistance(
            group_delays=tuple(
                GroupDelay(svid=one.svid, bgd_e1_e6_s=one.bgd_s, valid_from=begin) for one in self.satellites
            ),
            keys=tuple(
                key
                for time, key in keys.items()
                if begin <= time <= end and not simulation.withheld(time - simulation.start)
            ),
            ionosphere_e1_m=self._predicted_ionosphere,
        )

    @property
    def _predicted_ionosphere(self) -> dict[int, float]:
        """Ionospheric delay on E1 in m at the middle epoch, by SVID, as a receiver computes the delay from word 5."""
        if self.scenario.atmosphere.ionosphere is None:
            return {}
        middle = self.first + (self.end - self.first) // 2
        block = next(block for block in self.blocks() if middle < block[0].end)
        row = middle - block[0].first
        return {one.svid: float(one.truth.broadcast_ionosphere_e1_m[row]) for one in block}

    def truth_tables(self) -> Iterator[dict[str, list[str]]]:
        """Yield tables of `truth.csv`, one for each satellite and block of epochs, as columns of text by name."""
        for number in range(len(self.satellites)):
            for (block,) in self.blocks(number):
                yield block.truth_table()


def _check_motion(blocks: Iterator[ExportedSatellite], epochs: str) -> None:
    """Raise `VestigeError` if a travel time is outside 30 to 140 ms, or a range rate is above 10 km/s."""
    travels_s, rates_mps = [], []
    for one in blocks:
        travel_s, rate_mps = one.received_s - one.truth.time_s, one.path.rate_mps(one.truth.time_s)
        travels_s += [travel_s.min(), travel_s.max()]
        rates_mps.append(np.abs(rate_mps).max())
    low, high = PROCESSABLE_TRAVEL_TIME_S
    if not (min(travels_s) >= low and max(travels_s) <= high):
        raise VestigeError(
            f"line_of_sight: found {1e3 * min(travels_s):.0f} to {1e3 * max(travels_s):.0f} ms of travel in {epochs}, "
            f"expected {1e3 * low:.0f} to {1e3 * high:.0f} ms"
        )
    if not max(rates_mps) <= MAX_RATE_MPS:
        raise VestigeError(
            f"line_of_sight: found up to {max(rates_mps):.0f} m/s in {epochs}, expected at most {MAX_RATE_MPS:.0f} m/s"
        )
