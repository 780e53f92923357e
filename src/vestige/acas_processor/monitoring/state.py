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
    """Upper limit of the error of the receiver's clock."""

    initial_s: float = 15.0  # before the first authentic fix
    # upper limit of the relative frequency error of the oscillator
    frequency_error: float = 2e-6  # of a temperature-compensated crystal oscillator over temperature and age
    # time of the last authentic fix, and how good it was
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
    """What is remembered of the exhaustive search."""

    searched_at: GalileoTime | None = None  # time of the last one
    found_twice: bool = False  # whether it was made with the last RECS, and found more than one signal of a satellite
    suspicious: bool = False  # whether another check failed since the last RECS


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceiverState:
    """What a receiver remembers."""

    origin: GalileoTime  # time of the first epoch that it processed
    last: GalileoTime  # time of the last one
    uncertainty: TimeUncertainty = field(default_factory=TimeUncertainty)
    baseline: Baseline = field(default_factory=Baseline)  # what is usual of power, C/N0 and noise floor
    position_m: Vector | None = None  # ECEF position of the last fix; None before the first
    # of single checks
    clock: ClockMemory = ()
    osnma: OsnmaMemory = field(default_factory=OsnmaMemory)
    rates: RateMemory | None = None
    search: SearchMemory = field(default_factory=SearchMemory)
    # how many of its last tests a check that has to be confirmed failed in a row, by satellite
    streaks: Mapping[CheckName | str, Mapping[int, int]] = field(default_factory=dict)
    alarm: AlarmState = field(default_factory=AlarmState)
    on_e1: Mapping[int, GalileoTime] = field(default_factory=dict)  # when E1 showed each satellite last
