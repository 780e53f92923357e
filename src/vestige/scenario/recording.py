"""A scenario of a recording: the satellites in view in both bands, and the files that a recorder leaves of them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from pydantic import Field, field_validator

from vestige.constants import MAX_SVID, SPEED_OF_LIGHT_MPS, SUBFRAME_S
from vestige.crypto.key_file import write_key_file
from vestige.crypto.simulated_chain import make_chain
from vestige.receiver.recorder import ReceivedSatellite, straight
from vestige.records import Band
from vestige.scenario.simulated_recording import SimulatedRecording
from vestige.scenario.toml_file import Section
from vestige.signal_generator.range_model import RangeModel
from vestige.signal_generator.waveform import open_component
from vestige.signals.definitions import ALL_SIGNALS
from vestige.streams import stream_key
from vestige.time import GalileoTime


class ReceiverSection(Section):
    """The simulated receiver.

    Attributes
    ----------
    sample_rate_hz
        Rate of both front ends. Keep away from multiples of the chip rate: the correlation would be a staircase.
    clock_offset_s
        Receiver clock minus Galileo System Time.
    time_uncertainty_s
        What the receiver believes of its clock.
    hardware_bias_e1_e6_m
        Delay of the E6 front end minus that of E1.
    """

    sample_rate_hz: Annotated[float, Field(ge=4e6, le=100e6)] = 12.5e6
    clock_offset_s: Annotated[float, Field(ge=-0.02, le=0.02)] = 0.0
    time_uncertainty_s: Annotated[float, Field(ge=0, le=3600)] = 1.0
    hardware_bias_e1_e6_m: Annotated[float, Field(ge=-100, le=100)] = 0.0


class SatelliteSection(Section):
    """One satellite in view; C/N0 is per component (E1-C alone, E6-C alone), data and pilot alike."""

    svid: Annotated[int, Field(ge=1, le=MAX_SVID)]
    range_m: Annotated[float, Field(ge=2.2e7, le=3.0e7)]
    range_rate_mps: Annotated[float, Field(ge=-1500, le=1500)] = 0.0
    cn0_e1_dbhz: Annotated[float, Field(ge=0, le=70)]
    cn0_e6_dbhz: Annotated[float, Field(ge=0, le=70)]

    def cn0_dbhz(self, band: Band) -> float:
        """Return C/N0 per component in a band, in dBHz."""
        return self.cn0_e1_dbhz if band is Band.E1 else self.cn0_e6_dbhz


class RecordingScenario(Section):
    """A short simultaneous recording of E1 and E6 with open codes on E6-C.

    Attributes
    ----------
    kind
        `recording`.
    seed
        Everything random follows from it.
    start
        Receiver-clock time of the first sample, on a whole second.
    duration_s
        Length of the recording.
    """

    kind: Literal["recording"]
    seed: Annotated[int, Field(ge=0)]
    start: str
    duration_s: Annotated[float, Field(ge=0.06, le=60)]
    receiver: ReceiverSection = ReceiverSection()
    satellites: Annotated[tuple[SatelliteSection, ...], Field(min_length=1, alias="satellite")]

    @field_validator("start")
    @classmethod
    def _whole_second(cls, text: str) -> str:
        if GalileoTime.parse(text).fraction:
            raise ValueError("the start must be a whole second")
        return text

    @field_validator("satellites")
    @classmethod
    def _each_once(cls, satellites: tuple[SatelliteSection, ...]) -> tuple[SatelliteSection, ...]:
        svids = [satellite.svid for satellite in satellites]
        if len(set(svids)) < len(svids):
            raise ValueError("a satellite is listed twice")
        return satellites

    @property
    def start_time(self) -> GalileoTime:
        """`start` as a time."""
        return GalileoTime.parse(self.start)

    def simulated(self) -> SimulatedRecording:
        """Return the recording: open codes, and `osnma/` with the keys of its time and their public key."""
        receiver = self.receiver
        return SimulatedRecording(
            sky={band: tuple(self._received(band, one) for one in self.satellites) for band in Band},
            reference=self.start_time,
            sample_rate_hz=receiver.sample_rate_hz,
            samples=range(round(self.duration_s * receiver.sample_rate_hz)),
            seed=self.seed,
            time_uncertainty_s=receiver.time_uncertainty_s,
            description="simulated by vestige, open codes on E6-C",
            companions=self._write_keys,
        )

    def _received(self, band: Band, satellite: SatelliteSection) -> ReceivedSatellite:
        receiver = self.receiver
        late = straight(receiver.hardware_bias_e1_e6_m if band is Band.E6 else 0.0)
        return ReceivedSatellite(
            svid=satellite.svid,
            components=tuple(
                open_component(signal, satellite.svid, seed=self.seed) for signal in ALL_SIGNALS if signal.band is band
            ),
            cn0_dbhz=satellite.cn0_dbhz(band),
            pseudorange=RangeModel(
                s0_m=satellite.range_m + receiver.clock_offset_s * SPEED_OF_LIGHT_MPS, v_mps=satellite.range_rate_mps
            ),
            propagation=lambda _: late,
        )

    def _write_keys(self, folder: Path) -> None:
        osnma, start = folder / "osnma", self.start_time
        osnma.mkdir()
        subframes = int((start + self.duration_s - start.subframe) / SUBFRAME_S) + 2  # the next key too, for KDI = 1
        chain = make_chain(stream_key(self.seed, "OSNMA chain"), start, subframes)
        write_key_file(osnma / "keys.csv", chain.validated_keys(), (chain.root,))
        pem = chain.private_key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
        (osnma / "public_key.pem").write_bytes(pem)
