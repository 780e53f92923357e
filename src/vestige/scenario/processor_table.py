"""The `[processor]` table of a campaign: the receiver's processing, and what its maker knows of its parts."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from vestige.acas_processor.detectors import DETECTORS
from vestige.acas_processor.error_budget import ErrorBudget
from vestige.acas_processor.monitoring_settings import MonitoringSettings
from vestige.acas_processor.processor import AcasProcessor
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.accelerometer import Accelerometers
from vestige.receiver.clock import TwoStateClock
from vestige.sample_processor.correlator_kernel import REACH_CHIPS
from vestige.scenario.toml_file import Section
from vestige.signals.definitions import E6C


class OscillatorTable(Section):
    """What the data sheet of the receiver's oscillator says, for the monitor of its clock; the default is [WFO]'s."""

    h0_s: Annotated[float, Field(ge=0, le=1e-15)] = TwoStateClock().h0_s
    h_minus_2_hz: Annotated[float, Field(ge=0, le=1e-15)] = TwoStateClock().h_minus_2_hz


class InertialTable(Section):
    """What the data sheet of the accelerometers says, for the inertial check."""

    sigma_bias_mps2: Annotated[float, Field(ge=0, le=10)] = Accelerometers().sigma_bias_mps2
    walk_mps_per_sqrt_s: Annotated[float, Field(ge=0, le=10)] = Accelerometers().walk_mps_per_sqrt_s


class ProcessorTable(Section):
    """The processing; both detectors are evaluated, `detector` gives the status.

    `search_s` is the time between two exhaustive searches of level 3, if nothing is suspicious. `ray_power_db` is the
    multipath at 16° that the check for a second signal allows for. None of it follows from the errors that a scenario
    gives its receiver: a better or worse oscillator has to be told to the processor, too.
    """

    level: Literal[1, 2, 3] = 1
    detector: Literal["early", "maximum"] = "early"
    spacing: Annotated[int, Field(ge=1, le=20)] = 1
    p_fa: Annotated[float, Field(ge=1e-15, le=0.1)] = 1e-7
    n_taps: Annotated[int, Field(ge=3, le=63)] = 11
    tap_spacing_m: Annotated[float, Field(ge=0.1, le=100)] = 15.0
    budget: ErrorBudget = ErrorBudget.uncorrected()
    kappa: Annotated[float, Field(ge=0.1, le=10)] = 3.0
    min_pd: Annotated[float, Field(ge=0, le=1)] = 0.9
    search_s: Annotated[float, Field(ge=1, le=1e7)] = 3600.0
    ray_power_db: Annotated[float, Field(ge=-60, le=10)] = -15.8
    oscillator: OscillatorTable = OscillatorTable()
    inertial: InertialTable = InertialTable()

    @model_validator(mode="after")
    def _possible(self) -> Self:
        reach_m = float(np.max(np.abs(self.processor().offsets_m)))
        limit_m = REACH_CHIPS * SPEED_OF_LIGHT_MPS / E6C.chip_rate_hz
        if reach_m > limit_m:
            raise ValueError(f"a bank that reaches {reach_m:g} m from its middle; {limit_m:.0f} m is the limit")
        return self

    def processor(self, monitoring: MonitoringSettings | None = None) -> AcasProcessor:
        """Return the processor that the table describes, with settings for the checks of levels 2 and 3."""
        return AcasProcessor(
            level=self.level,
            detector=DETECTORS[self.detector](spacing=self.spacing),
            p_fa=self.p_fa,
            n_taps=self.n_taps,
            tap_spacing_m=self.tap_spacing_m,
            budget=self.budget,
            kappa=self.kappa,
            min_pd=self.min_pd,
            monitoring=MonitoringSettings() if monitoring is None else monitoring,
        )
