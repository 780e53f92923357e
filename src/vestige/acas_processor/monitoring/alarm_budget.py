"""How many false alarms a level may raise in a day, and the share of each check.

Most checks can be set to any false-alarm probability. They get equal shares of the level's alarms a day, and each
spreads its share over its tests of a day:

    P_fa = alarms a day / (number of such checks · tests a day)

Some bring their own, and come on top: the range check errs with erfc(κ/√2) if its budget σ is what the errors are (it
is meant to be more), or because noise exceeds the detection threshold in one of N correlators, N times their P_fa; E6
power errs with 1 − P_d, power–distortion with its published 0.6 % [WESSON18] to the power of its
confirmations, and differing OSNMA with 2⁻²⁴ a page. These are bounds. So is the whole: an alarm that is held
(`alarm.py`) counts its failures once.

Of those that can be set, clock and RAIM are *exact*: their statistics have the law from which the threshold is taken.
The others allow for more than is always there, a front end that drifts or a C/N0 that fades: bounds again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vestige.acas_processor.checks.e1_e6_range import KAPPA
from vestige.acas_processor.checks.power.e6_power import MIN_PD
from vestige.acas_processor.levels import LEVELS, CheckSpec, DetectionAssumptions, Scope, TestCadence
from vestige.constants import DAY_S, SUBFRAME_S
from vestige.records.checks import AlarmShare, CheckName
from vestige.theory.thresholds import probability_of_detection

if TYPE_CHECKING:
    from vestige.acas_processor.processor import AcasProcessor
    from vestige.acas_processor.verdict_block import VerdictBlock

ALARMS_A_DAY = 1.0  # for what can be chosen


@dataclass(frozen=True, slots=True, kw_only=True)
class Cadence:
    """How often a receiver tests."""

    satellites: int
    # time between epochs of E1, between RECS, and between exhaustive searches, in s
    observation_s: float = 1.0
    recs_s: float = 30.0
    search_s: float = 3600.0

    def tests_a_day(self, row: CheckSpec) -> float:
        """Return how many tests of a check there are in a day."""
        interval_s = {
            TestCadence.OBSERVATION: self.observation_s,
            TestCadence.RECS: self.recs_s,
            TestCadence.SUBFRAME: SUBFRAME_S,
            TestCadence.SEARCH: self.search_s,
        }[row.cadence]
        return DAY_S / interval_s * (self.satellites if row.scope is Scope.SATELLITE else 1)


def false_alarm_budget(
    level: int,
    cadence: Cadence,
    *,
    alarms_a_day: float = ALARMS_A_DAY,
    kappa: float = KAPPA,
    pd: float = MIN_PD,
    bank_p_fa: float = 0.0,
    further: Sequence[CheckSpec] = (),
) -> dict[CheckName | str, AlarmShare]:
    """Return the share of each check of a level, by name.

    `alarms_a_day` is for all checks together whose probability can be chosen. `pd` is the probability that E6 is
    detected at the C/N0 in view: below `MIN_PD` a miss is no alarm. `bank_p_fa` is the probability that noise exceeds
    the detection threshold in any correlator of the bank. `further` are optional checks, and those that a user wrote.
    """
    assumed = DetectionAssumptions(kappa=kappa, pd=pd, bank_p_fa=bank_p_fa)
    free = sum(row.own_p_fa is None for row in LEVELS[level])
    shares: dict[CheckName | str, AlarmShare] = {}
    for row in (*LEVELS[level], *further):
        tests = cadence.tests_a_day(row)
        p_fa = alarms_a_day / max(free, 1) / tests if row.own_p_fa is None else row.own_p_fa(assumed)
        shares[row.name] = AlarmShare(
            p_fa=p_fa,
            alarms_a_day=p_fa**row.confirm * tests,
            chosen=row.own_p_fa is None,
            exact=row.exact,
        )
    return shares


def budget_of(processor: AcasProcessor, block: VerdictBlock) -> dict[CheckName | str, AlarmShare]:
    """Return the share of each check of a processor, for the satellites that a block shows."""
    return false_alarm_budget(
        processor.level,
        processor.monitoring.cadence,
        alarms_a_day=processor.monitoring.alarms_a_day,
        kappa=processor.kappa,
        pd=_mean_pd(processor, block),
        bank_p_fa=processor.p_fa * processor.offsets_m.size,
        further=processor.further,
    )


def _mean_pd(processor: AcasProcessor, block: VerdictBlock) -> float:
    """Return the mean probability that E6 is detected, at the C/N0 that the antenna has at each elevation."""
    antenna, banks = processor.monitoring.levels.antenna, block.measured.banks
    if antenna is None:
        raise ValueError("the expected probability of detection needs an antenna whose C/N0 is known")
    expected_dbhz = antenna.expected_dbhz(antenna.e6_dbhz, block.evidence.elevation_rad)
    known = np.isfinite(banks.integration_s) & np.isfinite(expected_dbhz)
    if not known.any():
        return 1.0
    levels_dbhz, counts = np.unique(np.round(expected_dbhz[known], 2), return_counts=True)
    detection = probability_of_detection(levels_dbhz, float(banks.integration_s[known][0]), processor.p_fa)
    return float(np.average(detection, weights=counts))
