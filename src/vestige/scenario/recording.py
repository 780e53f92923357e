"""A scenario of a recording: the satellites in view in both bands, and the files that a recorder leaves of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from pydantic import Field, field_validator

from vestige.constants import MAX_SVID, SUBFRAME_S
from vestige.crypto.key_file import write_key_file
from vestige.crypto.simulated_chain import make_chain
from vestige.receiver.recorder import record_band
from vestige.recording.sample_format import SampleFormat
from vestige.recording.sigmf_writer import write_collection, write_sigmf
from vestige.records import Band
from vestige.scenario.toml_file import Section
from vestige.signal_generator.range_model import RangeModel
from vestige.streams import stream_key
from vestige.time import GalileoTime

NOISE_COUNTS = 20.0  # int8 counts of one unit: noise of 14 counts in I and in Q, 9 σ to the end of the scale


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


def write_recording(
    scenario: RecordingScenario, folder: Path, *, progress: Callable[[str], None] | None = None
) -> tuple[Path, ...]:
    """Write a scenario as files and return their paths: a SigMF collection of both bands, the OSNMA keys of its time.

    Parameters
    ----------
    folder
        Made if it does not exist; gets `e1`, `e6`, the collection `recording`, and `osnma/` with keys and public key.
    progress
        Called with a line of text before long steps.
    """
    folder.mkdir(parents=True, exist_ok=True)
    receiver, start = scenario.receiver, scenario.start_time
    metas = []
    for band in Band:
        if progress is not None:
            progress(f"{band.value}: {len(scenario.satellites)} satellites, {scenario.duration_s:g} s")
        batches = record_band(
            band,
            tuple(
                (one.svid, RangeModel(s0_m=one.range_m, v_mps=one.range_rate_mps), one.cn0_dbhz(band))
                for one in scenario.satellites
            ),
            start=start,
            duration_s=scenario.duration_s,
            sample_rate_hz=receiver.sample_rate_hz,
            clock_offset_s=receiver.clock_offset_s,
            delay_m=receiver.hardware_bias_e1_e6_m if band is Band.E6 else 0.0,
            seed=scenario.seed,
        )
        metas.append(
            write_sigmf(
                folder / band.value.lower(),
                batches,
                form=SampleFormat(component="int8", layout="iq"),
                scale=NOISE_COUNTS,
                time_uncertainty_s=receiver.time_uncertainty_s,
                description="simulated by vestige, open codes on E6-C",
            )
        )
    collection = write_collection(folder / "recording", metas)
    osnma = folder / "osnma"
    osnma.mkdir(exist_ok=True)
    subframes = int((start + scenario.duration_s - start.subframe) / SUBFRAME_S) + 2  # the next key too, for KDI = 1
    chain = make_chain(stream_key(scenario.seed, "OSNMA chain"), start, subframes)
    keys, public_key = osnma / "keys.csv", osnma / "public_key.pem"
    write_key_file(keys, chain.validated_keys(), (chain.root,))
    pem = chain.private_key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    public_key.write_bytes(pem)
    return (collection, *metas, keys, public_key)
