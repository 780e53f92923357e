"""A stretch of a campaign as an ACAS test case: everything that somebody else's receiver needs, and the truth.

The campaign's receiver runs on through the epochs `first` to `end`: samples of both bands (`receiver.continuous`), E1
observations with the errors of the truth, RECS, group delays, keys. RECS, keys and errors are those with which
`vestige run` processes the same epochs; the noise of the samples is not, because there it belongs to each epoch alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS, SUBFRAME_S
from vestige.crypto.osnma.messages.root_key import RootKey
from vestige.crypto.recs.group_delay import LSB_S, inter_frequency_delay_s
from vestige.errors import VestigeError
from vestige.receiver.samples.attacked_sky import counterfeit_satellites, latest_s
from vestige.receiver.samples.continuous import ContinuousTruth
from vestige.receiver.samples.recorder import ReceivedSatellite
from vestige.receiver.simulation import CLOCK_FOLLOWS_S, SVID, Simulation
from vestige.receiver.snapshots.e1 import reported_cn0_dbhz
from vestige.receiver.truth import TruthBlock
from vestige.recording.observations.e1_observation import MEDIAN_TRAVEL_TIME_S
from vestige.recording.observations.observation_epoch import ObservationEpoch
from vestige.records import Assistance, Band, E1Observation, GroupDelay
from vestige.scenario.campaign import CampaignScenario
from vestige.signal_generator.keystream import encrypted_component, encryption_key
from vestige.signal_generator.waveform import Component, open_component
from vestige.signals.definitions import E1B, E1C, E6B, E6C
from vestige.streams import stream, stream_key

TAIL_S = 0.3  # after the last RECS was sent: its reception and the 100 ms of E1 around it
REACH_S = 0.5  # more than from an epoch to the end of its true samples
PLACED_M = 25_000_000.0  # range of a satellite that the scenario leaves at none; Galileo is 23,200 to 29,000 km away
MAX_RATE_MPS = 10_000.0  # a receiver in a low orbit
_BGD_LSB = (6, 21)  # of 2⁻³² s: 1.4 to 4.9 ns, 0.2 to 0.8 m between the bands
PROCESSABLE_TRAVEL_TIME_S = (0.03, 0.14)  # within which a recording is processed


def with_default_range(scenario: CampaignScenario) -> CampaignScenario:
    """Return the scenario with its satellite at 25,000 km if it stands at no distance, as in the paper's."""
    path = scenario.line_of_sight
    return scenario if path.s0_m else scenario.model_copy(update={"line_of_sight": replace(path, s0_m=PLACED_M)})


@dataclass(frozen=True, kw_only=True)
class AcasTestCase:
    """Epochs `first` to `end` − 1 of a campaign."""

    scenario: CampaignScenario  # the campaign; its satellite stands where one can be
    first: int
    end: int

    def __post_init__(self) -> None:
        if not 0 <= self.first < self.end <= self.scenario.epochs:
            raise VestigeError(
                f"epochs {self.first}:{self.end}: expected first:end within the scenario's 0:{self.scenario.epochs}"
            )
        if self.scenario.constellation is not None:
            raise VestigeError(
                "constellation: found a sky, expected a single line of sight in a test case "
                "(--set constellation=none --set trajectory=none --set recs.every=1)"
            )
        if any(effects.jammers for effects in (self.truth.e1_attack, self.truth.e6)):
            raise VestigeError(
                "attack: found a jamming waveform, expected counterfeits and white noise in a test case; waveforms are "
                "simulated epoch by epoch, by vestige run (--set attack=none)"
            )
        if not self.simulation.front_end.transparent:
            raise VestigeError(
                "receiver.front_end: found a filter or a quantiser, expected none in a test case, which is what the "
                "antenna delivers (--set receiver.front_end=none)"
            )
        travel_s, rate_mps = self.received_s - self.truth.time_s, self.path.rate_mps(self.truth.time_s)
        low, high = PROCESSABLE_TRAVEL_TIME_S
        if not (travel_s.min() >= low and travel_s.max() <= high):
            raise VestigeError(
                f"line_of_sight: found {1e3 * travel_s.min():.0f} to {1e3 * travel_s.max():.0f} ms of travel in epochs "
                f"{self.first}:{self.end}, expected {1e3 * low:.0f} to {1e3 * high:.0f} ms"
            )
        if not np.abs(rate_mps).max() <= MAX_RATE_MPS:
            raise VestigeError(
                f"line_of_sight: found up to {np.abs(rate_mps).max():.0f} m/s in epochs {self.first}:{self.end}, "
                f"expected at most {MAX_RATE_MPS:.0f} m/s"
            )

    @cached_property
    def simulation(self) -> Simulation:
        """The simulated receiver."""
        return self.scenario.simulation()

    @cached_property
    def _neighbours(self) -> tuple[int, int]:
        """Epochs before and after that the samples still feel: what holds there, and the clock's way on."""
        before, after = (
            int(np.ceil(reach_s / self.scenario.interval_s)) + 1 for reach_s in (REACH_S, self._tail_s + 0.2)
        )
        return min(self.first, before), after

    @cached_property
    def _tail_s(self) -> float:
        """Time in s after the last transmission to the last sample: by then every counterfeit has repeated the RECS."""
        return TAIL_S + latest_s(self.simulation.spoofer, SVID, self.truth.time_s)

    @cached_property
    def path(self) -> ContinuousTruth:
        """The truth at any time."""
        before, after = self._neighbours
        process = self.simulation.truth()
        process.advance(0, self.first - before)
        return ContinuousTruth(
            line_of_sight=self.simulation.line_of_sight,
            truth=process.advance(self.first - before, before + self.end - self.first + after),
            e1_multipath=self.simulation.models.e1_multipath,
            group_delay_m=SPEED_OF_LIGHT_MPS * inter_frequency_delay_s(self.bgd_s),
        )

    @cached_property
    def bgd_s(self) -> float:
        """BGD(E1,E6) of the satellite in s: a value that its file can hold, and never so small that it would not show.

        The truth's bias is what is left of it.
        """
        draw = stream(self.simulation.seed, "group delay", SVID)
        return LSB_S * int(draw.integers(*_BGD_LSB, endpoint=True)) * int(draw.choice([-1, 1]))

    @cached_property
    def truth(self) -> TruthBlock:
        """The truth at the epochs."""
        process = self.simulation.truth()
        process.advance(0, self.first)
        return process.advance(self.first, self.end - self.first)

    @cached_property
    def received_s(self) -> Float[np.ndarray, " n"]:
        """Receiver time in s after the scenario's start at which the first chip of each RECS arrives on E6."""
        before, _ = self._neighbours
        return self.path.received_s()[before : before + self.end - self.first]

    @cached_property
    def e1_error_m(self) -> Float[np.ndarray, " n"]:
        """Error of the E1 pseudorange at the epochs, in m."""
        return self.truth.e1_noise_m + self.simulation.e1_multipath_m(self.truth) + self.truth.e1.error_m

    @property
    def range_offset_m(self) -> Float[np.ndarray, " n"]:
        """What E6 minus its prediction from E1 is at the epochs, in m; rays and noise on E6 come on top."""
        return self.truth.iono_diff_m + self.truth.bias_m - self.e1_error_m

    @property
    def samples(self) -> range:
        """Numbers of the samples, counted from the scenario's start: from epoch `first` on, see `_tail_s`."""
        rate_hz, from_s = self.scenario.receiver.sample_rate_hz, self.truth.time_s
        return range(int(from_s[0] * rate_hz), int(np.ceil((from_s[-1] + self._tail_s) * rate_hz)))

    def sky(self, band: Band) -> tuple[ReceivedSatellite, ...]:
        """Return the satellite as a band receives it, and its counterfeits."""
        true, simulation = self.satellite(band), self.simulation
        secret = stream_key(simulation.seed, "chips that an attacker makes up")
        forged = (encrypted_component(secret, SVID, simulation.start),)
        return true, *counterfeit_satellites(true, self.path, simulation.spoofer, band, forged)

    def noise_power(self, band: Band, t_s: float) -> float:
        """Return the variance of the noise at a time, the receiver's own being 1."""
        return 1.0 + float(self.simulation.spoofer.effects(band, SVID, np.array([t_s])).white[0])

    def satellite(self, band: Band) -> ReceivedSatellite:
        """Return the satellite as a band receives it without an attack."""
        simulation = self.simulation
        return ReceivedSatellite(
            svid=SVID,
            components=self._components(band),
            cn0_dbhz=simulation.cn0_e1_dbhz if band is Band.E1 else simulation.cn0_dbhz,
            pseudorange=self.path,
            propagation=self.path.propagation(band, simulation.n_chips / E6C.chip_rate_hz),
        )

    def _components(self, band: Band) -> tuple[Component, ...]:
        seed, start = self.simulation.seed, self.simulation.start
        if band is Band.E1:
            return tuple(open_component(signal, SVID, seed=seed) for signal in (E1B, E1C))
        return open_component(E6B, SVID, seed=seed), encrypted_component(encryption_key(seed), SVID, start)

    def observations(self) -> tuple[ObservationEpoch, ...]:
        """Return what E1 tracking says while each RECS arrives, 86 ms after it was sent.

        A receiver that follows a meaconer of seconds has another time than the samples: then there is nothing here.
        """
        to_hz = -E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS
        t_s = self.truth.time_s + MEDIAN_TRAVEL_TIME_S
        pseudorange_m = self.path.range_m(t_s) + self.e1_error_m
        phase_m = self.path.range_m(t_s) + self.truth.e1.error_m + self.truth.e1_phase_noise_m
        phase_cycles = self._ambiguity - to_hz * phase_m
        doppler_hz = to_hz * (self.path.rate_mps(t_s) + self.truth.e1_rate_noise_mps + self.truth.e1.rate_error_mps)
        rate_hz_per_s = to_hz * self.path.acceleration_mps2(t_s)
        multipath_m = self.simulation.e1_multipath_m(self.truth)
        cn0_dbhz = reported_cn0_dbhz(self.simulation, self.truth, multipath_m, first=self.first)
        return tuple(
            ObservationEpoch(
                time=self.simulation.transmit_time(epoch) + MEDIAN_TRAVEL_TIME_S,
                observations={
                    SVID: E1Observation(
                        svid=SVID,
                        pseudorange_m=float(pseudorange_m[row]),
                        carrier_phase_cycles=float(phase_cycles[row]),
                        doppler_hz=float(doppler_hz[row]),
                        doppler_rate_hz_per_s=float(rate_hz_per_s[row]),
                        cn0_dbhz=float(cn0_dbhz[row]),
                    )
                },
            )
            for row, epoch in enumerate(range(self.first, self.end))
            if abs(self.truth.e1.error_m[row]) < CLOCK_FOLLOWS_S * SPEED_OF_LIGHT_MPS
        )

    @property
    def _ambiguity(self) -> int:
        """Whole cycles by which the carrier phase is not the range, as a receiver counts them from anywhere."""
        return int(stream(self.simulation.seed, "carrier phase", SVID).integers(-1_000_000, 1_000_000))

    def assistance(self) -> tuple[Assistance, RootKey]:
        """Return RECS, group delays and keys, and their root key."""
        simulation, chain = self.simulation, self.simulation.osnma_chain()
        keys = {key.time: key for key in chain.validated_keys()}
        segments = [simulation.segment(epoch)[0] for epoch in range(self.first, self.end)]
        begin, end = segments[0].transmit_time.subframe, segments[-1].key_time + SUBFRAME_S
        return (
            Assistance(
                segments=tuple(segments),
                group_delays=(GroupDelay(svid=SVID, bgd_e1_e6_s=self.bgd_s, valid_from=begin),),
                keys=tuple(
                    key
                    for time, key in keys.items()
                    if begin <= time <= end and not simulation.withheld(time - simulation.start)
                ),
            ),
            chain.root,
        )

    def truth_table(self) -> dict[str, list[str]]:
        """Return the truth of every epoch as columns of text: what `truth.csv` holds."""
        truth, path = self.truth, self.path
        t_s = self.received_s
        sent = [self.simulation.transmit_time(epoch) for epoch in range(self.first, self.end)]
        columns: dict[str, list[str]] = {
            "epoch": [str(epoch) for epoch in range(self.first, self.end)],
            "gst_week": [str(time.week) for time in sent],
            "gst_second": [f"{time.second + time.fraction:.1f}" for time in sent],
        }
        numbers = {
            "received_s": t_s - truth.time_s,
            "range_m": self.simulation.line_of_sight.range_m(t_s),
            "clock_m": path.range_m(t_s) - self.simulation.line_of_sight.range_m(t_s),
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
