"""Define the settings of the false-alarm budget and of the checks beyond level 1, and make the checks of a level."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from vestige.acas_processor.checks.check import Check
from vestige.acas_processor.checks.clock import ClockDriftMonitor
from vestige.acas_processor.checks.e6_phase import E6PhaseMonitor
from vestige.acas_processor.checks.inertial import InertialMonitor
from vestige.acas_processor.checks.osnma import OsnmaAvailabilityMonitor, OsnmaReceptionMonitor
from vestige.acas_processor.checks.power.cn0 import Cn0Monitor
from vestige.acas_processor.checks.power.decision_map import PowerDistortionMonitor
from vestige.acas_processor.checks.power.e6_cn0 import E6StrengthMonitor
from vestige.acas_processor.checks.power.e6_fading import E6FadingMonitor
from vestige.acas_processor.checks.power.noise_floor import NoiseFloorMonitor
from vestige.acas_processor.checks.power.received_power import ReceivedPowerMonitor
from vestige.acas_processor.checks.second_signal import SecondSignalMonitor
from vestige.acas_processor.levels import LEVELS
from vestige.acas_processor.monitoring.alarm_budget import Cadence, false_alarm_budget
from vestige.acas_processor.monitoring.baseline import ReferenceLevels
from vestige.acas_processor.position.fix_measurement import FixSettings
from vestige.acas_processor.searches.sampled_searches import E1VestigialSearch, E6ExhaustiveSearch
from vestige.records import Band
from vestige.records.checks import AlarmShare, CheckName
from vestige.theory.search_budget import SEARCH_P_FA

if TYPE_CHECKING:
    from vestige.acas_processor.processor import AcasProcessor


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitoringSettings:
    """Settings of the false-alarm budget, of the checks that levels 2 and 3 add, and of the optional checks.

    Attributes
    ----------
    cadence
        Frequency of the tests: number of satellites, and times between epochs, RECS and searches.
    alarms_per_day
        Number of false alarms a day that the whole level may raise. Thresholds and confirmations follow from this
        number (`alarm_budget.py`). With None, the checks whose probability can be chosen may together raise one alarm a
        day, and the other checks have their own probability.
    test_p_fa
        False-alarm probability of one test, in place of the shares of the budget. The purpose is to measure detection
        curves. The three clock checks have this probability together. The value does not affect the range check, OSNMA
        agreement, power–distortion, the searches or a user's checks. Without `alarms_per_day` the value does not affect
        E6 power either. With None, the checks have the shares of the budget.
    levels
        Reference levels that are known beforehand; the receiver learns the other reference levels.
    fix
        Orbits, and the assumed errors of the observations.
    e1_power, e6_power, e1_cn0, e6_cn0, noise_floor, second_signal, clock, power_distortion, inertial
        Settings of one check each; `clock` has the settings of the three clock checks. `e1_power` and `e6_power` belong
        to the checks of received power, not to E6 power. The class of each attribute describes the settings.
    e6_phase, e6_fading
        The optional monitors of the carrier on E6, for every level; None if they are turned off.
    osnma_availability, osnma_reception
        Settings of the checks OSNMA availability and OSNMA reception. The level's budget replaces the false-alarm
        probability in these settings.
    second_signal_filtered
        Whether a filter of the E6 front end distorts the correlation function. If True, the check for a second signal
        is not made.
    e1_search, exhaustive_search
        Settings of the E1 vestigial search and of the E6 exhaustive search, except `search_p_fa` and
        `exhaustive_period_s`.
    search_p_fa
        False-alarm probability of one exhaustive search. The E1 vestigial search has this probability on E1 for all
        satellites together, and the same probability on E6 for each satellite.
    exhaustive_period_s
        Time in s between two exhaustive searches while no check fails.
    """

    cadence: Cadence = Cadence(satellites=10, observation_s=30.0)  # noqa: RUF009  (frozen)
    alarms_per_day: float | None = None
    test_p_fa: float | None = None
    levels: ReferenceLevels = field(default_factory=ReferenceLevels)
    fix: FixSettings = field(default_factory=FixSettings)
    e1_power: ReceivedPowerMonitor = field(default_factory=lambda: ReceivedPowerMonitor(band=Band.E1))
    e6_power: ReceivedPowerMonitor = field(default_factory=lambda: ReceivedPowerMonitor(band=Band.E6))
    e1_cn0: Cn0Monitor = field(default_factory=Cn0Monitor)
    e6_cn0: E6StrengthMonitor = field(default_factory=E6StrengthMonitor)
    noise_floor: NoiseFloorMonitor = field(default_factory=NoiseFloorMonitor)
    second_signal: SecondSignalMonitor = field(default_factory=SecondSignalMonitor)
    second_signal_filtered: bool = False
    clock: ClockDriftMonitor = field(default_factory=ClockDriftMonitor)
    power_distortion: PowerDistortionMonitor = field(default_factory=PowerDistortionMonitor)
    inertial: InertialMonitor = field(default_factory=InertialMonitor)
    e6_phase: E6PhaseMonitor | None = None
    e6_fading: E6FadingMonitor | None = None
    osnma_availability: OsnmaAvailabilityMonitor = field(default_factory=OsnmaAvailabilityMonitor)
    osnma_reception: OsnmaReceptionMonitor = field(default_factory=OsnmaReceptionMonitor)
    e1_search: E1VestigialSearch = field(default_factory=E1VestigialSearch)
    exhaustive_search: E6ExhaustiveSearch = field(default_factory=E6ExhaustiveSearch)
    search_p_fa: float = SEARCH_P_FA
    exhaustive_period_s: float = 3600.0


def shares_of(processor: AcasProcessor) -> dict[CheckName | str, float]:
    """Return the false-alarm probability of one test of each check of a processor's level."""
    settings = processor.monitoring
    if settings.test_p_fa is not None:
        ours = (*LEVELS[processor.level], *processor.optional)
        shared = {spec.name: settings.test_p_fa / spec.one_of for spec in ours}
        return shared | {one.spec.name: one.p_fa for one in processor.own_of_level}
    return {name: share.p_fa for name, share in set_shares(processor).items()}


def set_shares(processor: AcasProcessor) -> dict[CheckName | str, AlarmShare]:
    """Return the share of each check in the false alarms of a processor's level, without use of measurements.

    `VestigeError` is raised if the configured false alarms a day are too few.
    """
    return false_alarm_budget(
        processor.level,
        processor.monitoring.cadence,
        alarms_per_day=processor.monitoring.alarms_per_day,
        bank_p_fa=processor.bank_p_fa,
        added=processor.added_checks,
    )


def checks_of(processor: AcasProcessor, p_fa: Mapping[CheckName | str, float]) -> dict[CheckName | str, Check]:
    """Return the checks of a processor's level by name, except the searches, which `assess` makes.

    `p_fa` is the false-alarm probability of one test of each check of the level.
    """
    made = {
        spec.name: spec.make(processor, p_fa[spec.name])
        for spec in (*LEVELS[processor.level], *processor.optional)
        if spec.make is not None
    }
    ours: dict[CheckName | str, Check] = {name: check for name, check in made.items() if check is not None}
    return ours | {one.spec.name: one for one in processor.own_of_level}
