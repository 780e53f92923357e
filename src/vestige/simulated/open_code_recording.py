"""Make the recording of a scenario with `kind = "recording"`, with open codes on E6-C and a file of OSNMA keys."""

from __future__ import annotations

from pathlib import Path

from vestige.constants import SPEED_OF_LIGHT_MPS, SUBFRAME_S
from vestige.crypto.keys.key_file import write_key_file
from vestige.crypto.osnma.operator.osnma_service import SERVICE_WITHOUT_EVENTS
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.samples.recorder import ReceivedSatellite, straight
from vestige.receiver.samples.sampled_epoch import osnma_operator
from vestige.records import Band
from vestige.scenario.recording import RecordingScenario, SatelliteSection
from vestige.signal_generator.range_model import RangeModel
from vestige.signal_generator.waveform import open_component
from vestige.signals.definitions import ALL_SIGNALS
from vestige.simulated.simulated_recording import SimulatedRecording
from vestige.simulated.sky_parts import WholeSky


def open_code_recording(scenario: RecordingScenario) -> SimulatedRecording:
    """Return the recording of a scenario, with the OSNMA keys of the recorded time and a trust anchor in `osnma/`."""
    receiver = scenario.receiver
    return SimulatedRecording(
        sky=WholeSky(
            signals={band: tuple(_received(scenario, band, one) for one in scenario.satellites) for band in Band}
        ),
        reference=scenario.start_time,
        front_end=FrontEnd(sample_rate_hz=receiver.sample_rate_hz),
        samples=range(round(scenario.duration_s * receiver.sample_rate_hz)),
        seed=scenario.seed,
        time_uncertainty_s=receiver.time_uncertainty_s,
        description="simulated by vestige, open codes on E6-C",
        companions=lambda folder: _write_keys(scenario, folder),
    )


def _received(scenario: RecordingScenario, band: Band, satellite: SatelliteSection) -> ReceivedSatellite:
    receiver = scenario.receiver
    late = straight(receiver.hardware_bias_e1_e6_m if band is Band.E6 else 0.0)
    return ReceivedSatellite(
        svid=satellite.svid,
        components=tuple(
            open_component(signal, satellite.svid, seed=scenario.seed) for signal in ALL_SIGNALS if signal.band is band
        ),
        cn0_dbhz=satellite.cn0_dbhz(band),
        pseudorange=RangeModel(
            s0_m=satellite.range_m + receiver.clock_offset_s * SPEED_OF_LIGHT_MPS, v_mps=satellite.range_rate_mps
        ),
        propagation=lambda _: late,
    )


def _write_keys(scenario: RecordingScenario, folder: Path) -> None:
    osnma, start = folder / "osnma", scenario.start_time
    osnma.mkdir()
    # the last key is sent in the subframe after the recording, because a RECS with KDI 1 needs this key
    subframes = int((start + scenario.duration_s - start.subframe) / SUBFRAME_S) + 2
    operator = osnma_operator(scenario.seed, start, subframes, SERVICE_WITHOUT_EVENTS)
    write_key_file(osnma / "keys.csv", operator.validated_keys(), operator.roots)
    operator.write_files(osnma)
