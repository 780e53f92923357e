"""Define the scenario of a recording with open codes on E6-C: the receiver and the satellites in view."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator

from vestige.constants import MAX_SVID
from vestige.records import Band
from vestige.scenario.toml.toml_file import Section
from vestige.time import GalileoTime


class ReceiverSection(Section):
    """Simulated receiver of a recording.

    Attributes
    ----------
    sample_rate_hz
        Sampling rate of both front ends in Hz. Avoid multiples of the chip rate, because the correlation function has
        steps at such rates.
    clock_offset_s
        Time of the receiver's clock minus Galileo System Time, in s.
    time_uncertainty_s
        Upper limit of the clock error in s, as the receiver states it.
    hardware_bias_e1_e6_m
        Delay of the E6 front end minus the delay of the E1 front end, in m.
    """

    sample_rate_hz: Annotated[float, Field(ge=4e6, le=100e6)] = 12.5e6
    clock_offset_s: Annotated[float, Field(ge=-0.02, le=0.02)] = 0.0
    time_uncertainty_s: Annotated[float, Field(ge=0, le=3600)] = 1.0
    hardware_bias_e1_e6_m: Annotated[float, Field(ge=-100, le=100)] = 0.0


class SatelliteSection(Section):
    """Satellite in view, with the C/N0 in dBHz of one component in each band; data and pilot have the same C/N0."""

    svid: Annotated[int, Field(ge=1, le=MAX_SVID)]
    range_m: Annotated[float, Field(ge=2.2e7, le=3.0e7)]
    range_rate_mps: Annotated[float, Field(ge=-1500, le=1500)] = 0.0
    cn0_e1_dbhz: Annotated[float, Field(ge=0, le=70)]
    cn0_e6_dbhz: Annotated[float, Field(ge=0, le=70)]

    def cn0_dbhz(self, band: Band) -> float:
        """Return the C/N0 of one component in a band, in dBHz."""
        return self.cn0_e1_dbhz if band is Band.E1 else self.cn0_e6_dbhz


class RecordingScenario(Section):
    """Scenario of a short simultaneous recording of E1 and E6 with open codes on E6-C.

    Attributes
    ----------
    kind
        Kind of the scenario, always `recording`.
    seed
        Seed of all random numbers.
    start
        Receiver-clock time of the first sample, on a whole second.
    duration_s
        Duration of the recording in s.
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
        """Receiver-clock time of the first sample, from the key `start`."""
        return GalileoTime.parse(self.start)
