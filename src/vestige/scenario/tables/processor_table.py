"""Define the table `[processor]` of a campaign: settings of the processor, and data sheets of the sensors."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Field,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    WithJsonSchema,
    model_serializer,
    model_validator,
)

from vestige.acas_processor.checks.e6_phase import E6PhaseMonitor
from vestige.acas_processor.detectors import DETECTORS, Detector, OwnDetector
from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings
from vestige.acas_processor.own_check import OwnCheck
from vestige.acas_processor.position.error_budget import ErrorBudget
from vestige.acas_processor.processor import EARLY_REACH_M, AcasProcessor
from vestige.constants import MAX_SVID
from vestige.own_parts import OwnPartError, is_own
from vestige.receiver.errors.accelerometer import Accelerometers
from vestige.receiver.errors.clock import TwoStateClock
from vestige.scenario.tables.own_tables import named_part
from vestige.scenario.toml.toml_file import InconsistentSettingsError, Section

_DETECTOR = {"anyOf": [{"enum": list(DETECTORS)}, {"type": "string", "pattern": ":"}]}


class OscillatorTable(Section):
    """Data sheet of the receiver's oscillator, for the clock check; the default is the oscillator of [WFO]."""

    h0_s: Annotated[float, Field(ge=0, le=1e-15)] = TwoStateClock().h0_s
    h_minus_2_hz: Annotated[float, Field(ge=0, le=1e-15)] = TwoStateClock().h_minus_2_hz


class InertialTable(Section):
    """Data sheet of the accelerometers, for the inertial check."""

    sigma_bias_mps2: Annotated[float, Field(ge=0, le=10)] = Accelerometers().sigma_bias_mps2
    walk_mps_per_sqrt_s: Annotated[float, Field(ge=0, le=10)] = Accelerometers().walk_mps_per_sqrt_s


class E6CarrierTable(Section):
    """Table that turns on the phase monitor and the fading monitor of E6, at every level.

    The phase monitor and the fading monitor use the last `window` RECS of a satellite. `ray_life_s` is the duration of
    a reflection in s. The duration is 0 if the reflections at different RECS are independent. By default the duration
    is unknown, and the thresholds allow for a reflection of any duration. `change_mps` is the fastest change in m/s of
    the range difference E6 − E1 that the ionosphere causes.
    """

    window: Annotated[int, Field(ge=4, le=1000)] = E6PhaseMonitor().window
    ray_life_s: Annotated[float, Field(ge=0, le=1e9)] | None = None
    change_mps: Annotated[float, Field(ge=0, le=1)] = E6PhaseMonitor().change_mps


class ProcessorTable(Section):
    """Settings of the processor of a campaign.

    vestige evaluates its two detectors, and the detector that `detector` names gives the verdicts. `detector` may name
    a class `module:Name` that the user wrote. vestige evaluates a user's own detector in addition to the two detectors
    of vestige. `checks` names checks that the user wrote, which are made after the checks of the level.

    The bank has `n_taps` correlators around the predicted range. Further correlators lie up to `early_reach_m` before
    the predicted range. The distance between neighbouring correlators is `tap_spacing_m`.

    `alarms_per_day` is the number of false alarms a day that the checks of the level together may raise. Optional
    checks and the user's checks raise alarms in addition. The thresholds of most checks of the level follow from this
    number, including the limit of the range check. The number of consecutive E6 misses for an alarm also follows from
    this number. The detection threshold follows from `p_fa`. Without `alarms_per_day`, `kappa` gives the limit of the
    range check, and every single miss is an alarm. A miss counts only if E1 predicts a detection probability of at
    least `min_pd`.

    `search_s` is the time in s between two exhaustive searches of level 3, if nothing is suspicious. `ray_power_db` is
    the mean power of all reflections at 16° elevation, relative to the direct signal in dB. The check for a second
    signal allows for reflections of this power. The probability of a miss on E6 also follows from this power. The
    values of this table do not follow from the errors that a scenario gives its receiver. So a better or worse
    oscillator must also be stated in this table.

    `expected_cn0_e1_dbhz` and `expected_cn0_e6_dbhz` are the C/N0 that the receiver expects at the zenith. The defaults
    of these two C/N0 are the values of `[receiver]`, because a receiver knows its antenna. `e6_over_e1_db` is the
    expected C/N0 of E6-C minus the expected C/N0 of E1-C, by default `expected_cn0_e6_dbhz` − `expected_cn0_e1_dbhz`.
    `expected_satellites` is the number of satellites that the receiver expects in view. By default this number is the
    number of satellites above the mask at the first epoch.

    `e6_carrier` turns on the phase monitor and the fading monitor of E6, which are off by default.
    """

    level: Literal[1, 2, 3] = 1
    detector: Annotated[str, WithJsonSchema(_DETECTOR)] = "early"
    spacing: Annotated[int, Field(ge=1, le=20)] = 1
    p_fa: Annotated[float, Field(ge=1e-15, le=0.1)] = 1e-7
    n_taps: Annotated[int, Field(ge=3, le=63)] = 11
    tap_spacing_m: Annotated[float, Field(ge=0.1, le=100)] = 15.0
    early_reach_m: Annotated[float, Field(ge=0, le=900)] = EARLY_REACH_M
    budget: ErrorBudget = ErrorBudget.uncorrected()
    kappa: Annotated[float, Field(ge=0.1, le=10)] = 3.0
    min_pd: Annotated[float, Field(ge=0, le=1)] = 0.9
    alarms_per_day: Annotated[float, Field(gt=0, le=1000)] | None = None
    search_s: Annotated[float, Field(ge=1, le=1e7)] = 3600.0
    ray_power_db: Annotated[float, Field(ge=-60, le=10)] = -15.8
    expected_satellites: Annotated[int, Field(ge=1, le=MAX_SVID)] | None = None
    expected_cn0_e1_dbhz: Annotated[float, Field(ge=0, le=80)] | None = None
    expected_cn0_e6_dbhz: Annotated[float, Field(ge=0, le=80)] | None = None
    e6_over_e1_db: Annotated[float, Field(ge=-40, le=40)] | None = None
    oscillator: OscillatorTable = OscillatorTable()
    inertial: InertialTable = InertialTable()
    e6_carrier: E6CarrierTable | None = None
    checks: tuple[str, ...] = ()
    _own_detector: Any = PrivateAttr(None)
    _own_checks: tuple[OwnCheck, ...] = PrivateAttr(())

    def model_post_init(self, _context: Any) -> None:
        """Import the detector and the checks that the user wrote; worker processes import these classes, too."""
        if is_own(self.detector):
            self._own_detector = named_part(self.detector, object, "detector")
        elif self.detector not in DETECTORS:
            raise InconsistentSettingsError(
                "detector", self.detector, f"{' or '.join(map(repr, DETECTORS))}, or 'module:Name'"
            )
        try:
            self._own_checks = tuple(OwnCheck.named(one) for one in self.checks)
        except OwnPartError as error:
            raise InconsistentSettingsError("checks", f"{error.kind} and {error.found}", error.expected) from error

    @property
    def detectors(self) -> dict[str, Callable[[], Detector]]:
        """Factory of each detector by its name: the two detectors of vestige, and a detector that the user wrote."""
        ours: dict[str, Callable[[], Detector]] = {
            name: partial(detector, spacing=self.spacing) for name, detector in DETECTORS.items()
        }
        return ours | ({self.detector: self._made_detector} if is_own(self.detector) else {})

    def _made_detector(self) -> Detector:
        return OwnDetector.of(self.detector, self._own_detector, spacing=self.spacing)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.alarms_per_day is not None and "kappa" in self.model_fields_set:
            raise InconsistentSettingsError(
                "kappa", f"{self.kappa:g} beside alarms_per_day", "one of the two: κ follows from alarms_per_day"
            )
        self.processor()  # raises a ValueError if the bank of correlators is impossible
        return self

    @model_serializer(mode="wrap")
    def _without_what_follows(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Write the table without κ if `alarms_per_day` is set, because a table with both values cannot be read."""
        table: dict[str, Any] = dump(self)
        if self.alarms_per_day is not None:
            table.pop("kappa", None)
        return table

    def processor(self, monitoring: MonitoringSettings | None = None) -> AcasProcessor:
        """Return the processor that the table describes; `monitoring` has the settings of checks at levels 2 and 3."""
        return AcasProcessor(
            level=self.level,
            detector=self.detectors[self.detector](),
            p_fa=self.p_fa,
            n_taps=self.n_taps,
            tap_spacing_m=self.tap_spacing_m,
            early_reach_m=self.early_reach_m,
            budget=self.budget,
            kappa=self.kappa,
            min_pd=self.min_pd,
            monitoring=MonitoringSettings() if monitoring is None else monitoring,
            own_checks=self._own_checks,
        )
