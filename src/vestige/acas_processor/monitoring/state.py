"""Define the state of the receiver: the values that the receiver keeps from block to block."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from vestige.acas_processor.monitoring.alarm import AlarmState
from vestige.acas_processor.monitoring.baseline import Baseline
from vestige.acas_processor.monitoring.memory import CheckMemory, FixMemory, OsnmaMemory, Vector
from vestige.records.checks import CheckName
from vestige.records.time_uncertainty import TimeUncertainty
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchMemory:
    """Memory that decides when the next exhaustive search is due."""

    searched_at: GalileoTime | None = None  # time of the last search
    found_twice: bool = False  # whether a search with the last RECS found more than one signal of a satellite
    suspicious: bool = False  # whether another check failed since the last RECS


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceiverState:
    """Memory of a receiver between two blocks of epochs."""

    origin: GalileoTime  # time of the first epoch that the receiver processed
    last: GalileoTime  # time of the last epoch
    uncertainty: TimeUncertainty = field(default_factory=TimeUncertainty)
    baseline: Baseline = field(default_factory=Baseline)  # values from which reference levels are learned
    position_m: Vector | None = None  # ECEF position of the last fix; None before the first fix
    # last fix of an epoch with at least four AUTHENTIC satellites, without an alarm, and without a range in use of an
    # earlier signal; None if there was no such epoch, and always None at level 1
    fix: FixMemory | None = None
    osnma: OsnmaMemory = field(default_factory=OsnmaMemory)
    memory: Mapping[CheckName | str, CheckMemory] = field(default_factory=dict)  # memory of each check
    search: SearchMemory = field(default_factory=SearchMemory)
    # number of tests in a row that failed up to the last test, for each check that needs confirmation, by satellite
    streaks: Mapping[CheckName | str, Mapping[int, int]] = field(default_factory=dict)
    alarm: AlarmState = field(default_factory=AlarmState)
    on_e1: Mapping[int, GalileoTime] = field(default_factory=dict)  # last time at which E1 tracked each satellite
