"""What a receiver remembers from one block of epochs to the next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from vestige.acas_processor.monitoring.alarm import AlarmState
from vestige.acas_processor.monitoring.baseline import Baseline
from vestige.acas_processor.monitoring.memory import ClockMemory, OsnmaMemory, RateMemory, Vector
from vestige.records.checks import CheckName
from vestige.time import GalileoTime
from vestige.valid_numbers import require_finite, require_time_uncertainty

FIXED_S = 1e-6  # 300 m: of a position out of authenticated pseudoranges


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeUncertainty:
    """Upper limit of the error of the receiver's clock.

    Attributes
    ----------
    initial_s
        Before the first authentic fix.
    frequency_error
        Upper limit of the relative frequency error of the oscillator.
    fixed_at, fixed_s
        Time of the last authentic fix, and how good it was.
    """

    initial_s: float = 15.0
    frequency_error: float = 2e-6  # of a temperature-compensated crystal oscillator over temperature and age
    fixed_at: GalileoTime | None = None
    fixed_s: float = FIXED_S

    def __post_init__(self) -> None:
        require_time_uncertainty(self.initial_s)
        require_finite("time uncertainty", frequency_error=self.frequency_error, fixed_s=self.fixed_s)

    def at(self, time: GalileoTime) -> float:
        """Return the upper limit at a time, in s."""
        if self.fixed_at is None:
            return self.initial_s
        return min(self.fixed_s + self.frequency_error * abs(time - self.fixed_at), self.initial_s)

    def after_fix(self, time: GalileoTime, fixed_s: float = FIXED_S) -> TimeUncertainty:
        """Return the uncertainty after an authentic fix at a time."""
        return replace(self, fixed_at=time, fixed_s=fixed_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchMemory:
    """What is remembered of the exhaustive search.

    Attributes
    ----------
    searched_at
        Time of the last one.
    found_twice
        Whether it was made with the last RECS, and found more than one signal of a satellite.
    suspicious
        Whether another check failed since the last RECS.
    """

    searched_at: GalileoTime | None = None
    found_twice: bool = False
    suspicious: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceiverState:
    """What a receiver remembers.

    Attributes
    ----------
    origin
        Time of the first epoch that it processed.
    last
        Time of the last one.
    uncertainty
        Of its clock.
    baseline
        What is usual of power, C/N0 and noise floor.
    position_m
        ECEF position of the last fix; None before the first.
    clock, osnma, rates, search
        Of single checks.
    streaks
        How many of its last tests a check that has to be confirmed failed in a row, by satellite.
    alarm
        What is shown of each satellite.
    on_e1
        When E1 showed each satellite last.
    """

    origin: GalileoTime
    last: GalileoTime
    uncertainty: TimeUncertainty = field(default_factory=TimeUncertainty)
    baseline: Baseline = field(default_factory=Baseline)
    position_m: Vector | None = None
    clock: ClockMemory = ()
    osnma: OsnmaMemory = field(default_factory=OsnmaMemory)
    rates: RateMemory | None = None
    search: SearchMemory = field(default_factory=SearchMemory)
    streaks: Mapping[CheckName | str, Mapping[int, int]] = field(default_factory=dict)
    alarm: AlarmState = field(default_factory=AlarmState)
    on_e1: Mapping[int, GalileoTime] = field(default_factory=dict)
