"""Make the true signal and the spoofing signals of one satellite, for a recording or for the samples of a sky."""

from __future__ import annotations

from dataclasses import dataclass

from vestige.broadcast.cnav import cnav_symbols
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.crypto.recs.group_delay import LSB_S, inter_frequency_delay_s
from vestige.receiver.samples.attacked_sky import spoofing_satellites
from vestige.receiver.samples.continuous import ContinuousTruth
from vestige.receiver.samples.recorder import ReceivedSatellite, stretch_samples
from vestige.receiver.simulation import Simulation
from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.signal_generator.keystream import encrypted_component, encryption_key, forged_key
from vestige.signal_generator.waveform import Component, Sequence, coded_component, open_component, random_signs
from vestige.signals.definitions import E1B, E1C, E6B
from vestige.streams import stream, stream_key

# limits of the BGD's magnitude in units of 2⁻³² s: 1.4 to 4.9 ns, or 0.2 to 0.8 m between E1 and E6
_BGD_LSB = (6, 21)


def broadcast_group_delay_s(seed: int, svid: int) -> float:
    """Return a random BGD(E1,E6) of a satellite in s, a nonzero multiple of the resolution of a BGD file.

    The bias of the truth is added to this delay, and contains the residuals of group delay and hardware delay.
    """
    draw = stream(seed, "group delay", svid)
    return LSB_S * int(draw.integers(*_BGD_LSB, endpoint=True)) * int(draw.choice([-1, 1]))


def continuous_truth(simulation: Simulation, truth: TruthBlock) -> ContinuousTruth:
    """Return the truth of a satellite at any time, interpolated between the epochs.

    Parameters
    ----------
    simulation
        Simulation of the satellite.
    truth
        Truth of the satellite at the epochs, which enclose all requested times.
    """
    elevation = simulation.elevation
    bgd_s = broadcast_group_delay_s(simulation.seed, simulation.svid)
    return ContinuousTruth(
        line_of_sight=simulation.line_of_sight if elevation is None else elevation.path,
        truth=truth,
        e1_multipath=simulation.models.e1_multipath,
        group_delay_m=SPEED_OF_LIGHT_MPS * inter_frequency_delay_s(bgd_s),
        atmosphere=None if elevation is None else elevation.atmosphere,
        sky=elevation is not None,
    )


@dataclass(frozen=True, kw_only=True)
class SatelliteOnAir:
    """A satellite with its spoofing signals, as received in both bands."""

    simulation: Simulation
    path: ContinuousTruth
    symbols: Sequence | None = None  # symbols of E1-B since the start of the scenario; None for random symbols
    forged_symbols: Sequence | None = None  # symbols of an attacker's own message; None for random symbols

    def received(self, band: Band) -> tuple[ReceivedSatellite, ...]:
        """Return the satellite's true signal in a band, and all spoofing signals of the satellite."""
        simulation = self.simulation
        true = ReceivedSatellite(
            svid=simulation.svid,
            components=self._components(band),
            cn0_dbhz=simulation.cn0_e1_dbhz if band is Band.E1 else simulation.cn0_dbhz,
            pseudorange=self.path,
            propagation=self.path.propagation(band, simulation.integration_s),
        )
        return true, *spoofing_satellites(
            true,
            self.path,
            simulation.spoofer,
            band,
            forged_chips=encrypted_component(forged_key(simulation.seed), simulation.svid, simulation.start),
            forged_data=self._forged_data(),
            stretch_s=stretch_samples(simulation.front_end.sample_rate_hz) / simulation.front_end.sample_rate_hz,
            seed=simulation.seed,
        )

    def _forged_data(self) -> Component:
        """Return the component E1-B with an attacker's own navigation data."""
        svid = self.simulation.svid
        if self.forged_symbols is not None:
            return coded_component(E1B, svid, self.forged_symbols)
        return coded_component(E1B, svid, random_signs(stream_key(self.simulation.seed, "forged symbols", svid)))

    def _components(self, band: Band) -> tuple[Component, ...]:
        seed, start, svid = self.simulation.seed, self.simulation.start, self.simulation.svid
        if band is Band.E6:
            data = coded_component(E6B, svid, cnav_symbols(seed, svid, start))
            return data, encrypted_component(encryption_key(seed), svid, start)
        data = (
            open_component(E1B, svid, seed=seed) if self.symbols is None else coded_component(E1B, svid, self.symbols)
        )
        return data, open_component(E1C, svid)
