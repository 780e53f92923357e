"""Compute how many false alarms a level may raise in a day, and how many of them each check may raise.

Theory of operation
-------------------
**Without the setting `alarms_per_day`** the checks whose false-alarm probability can be chosen may together raise
`ALARMS_PER_DAY` false alarms in a day. These checks get equal shares. A check divides its share equally among its tests
of a day:

    P_fa = alarms a day / (number of these checks · tests a day)

Some checks have their own false-alarm probability, in addition to this budget. The probabilities in this list are upper
limits:

* The probability of the range check is erfc(κ/√2) if its σ is the standard deviation of the errors. The assumed σ is
  larger by intention, so the true probability is smaller. Noise above the detection threshold in one of the N
  correlators of the bank adds N times the P_fa of a correlator.
* The probability of E6 power is 1 − P_d, averaged over fading by multipath (`theory/fading.py`).
* The probability of power–distortion is 0.006ᵏ if the tests are independent: 0.6 % is the published false-alarm
  probability of a test [WESSON18], and k is the number of confirmations.
* The probability of OSNMA agreement is 2⁻²⁴, the probability that CRC-24 passes a damaged page. This is an upper limit
  for a subframe with one damaged page. If all pages of eight satellites are damaged, there are 0.02 false alarms a day.
* The probability of the clock limit is `CLOCK_LIMIT_P_FA`.

The sum of the false alarms of all checks is an upper limit of the false alarms of the level, because several failures
during one alarm (`alarm.py`) count once.

**With `alarms_per_day` = a** the whole level may raise at most `a` false alarms in one day. Alarms from noise in the N
correlators, from OSNMA agreement and from the clock limit are subtracted first, because their probabilities do not
depend on `a`. All n checks of the level except OSNMA agreement and the clock limit get equal shares of the remaining
alarms. Σ fixed is the number of subtracted alarms a day, and T is the number of tests of a check in a day:

    P = (a − Σ fixed) / (n T)        of one test
    range check        κ = √2 erfc⁻¹(P)
    E6 power           M = ⌈ln P / ln(1 − P_d)⌉ misses in a row (`checks/power/e6_misses.py`)
    power–distortion   ⌈ln P / ln 0.006⌉ failures in a row
    all others         P_fa = P

In an example, a receiver at level 1 has eight satellites, a RECS each 30 s, 46 correlators with a P_fa of 10⁻⁷ each,
and a = 1. Noise in the 46 correlators raises 0.11 alarms a day, P is 1.9·10⁻⁵, and κ is 4.27. Optional checks and
checks that a user wrote keep their own probability, and raise alarms in addition to the number a.

Among the checks whose probability can be chosen, the clock checks and RAIM are *exact*: their statistics have the
distribution from which the threshold is computed if the assumed standard deviations are right. The probabilities of all
other checks are upper limits. Many of these checks allow for errors that are not always present, such as a drifting
front end or a fading C/N0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, log, nan, sqrt
from typing import TYPE_CHECKING

from scipy.special import erfcinv

from vestige.acas_processor.checks.e1_e6_range import KAPPA
from vestige.acas_processor.checks.power.e6_misses import expected_miss_rate
from vestige.acas_processor.checks.power.e6_power import MIN_PD
from vestige.acas_processor.levels import LEVELS, CheckSpec, DetectionAssumptions, Scope, TestCadence
from vestige.constants import DAY_S, SUBFRAME_S
from vestige.errors import VestigeError
from vestige.records.checks import AlarmShare, CheckName

if TYPE_CHECKING:
    from vestige.acas_processor.processor import AcasProcessor
    from vestige.acas_processor.verdict_block import VerdictBlock

ALARMS_PER_DAY = 1.0  # false alarms a day of all the checks whose probability can be chosen
_LARGEST_P_FA = 0.5  # upper limit of the false-alarm probability of one test


@dataclass(frozen=True, slots=True, kw_only=True)
class Cadence:
    """Frequency of a receiver's tests: number of satellites, and times between epochs, RECS and searches."""

    satellites: int
    observation_s: float = 1.0  # time between epochs of E1 in s
    recs_s: float = 30.0  # time between RECS in s
    search_s: float = 3600.0  # time between exhaustive searches in s

    def tests_a_day(self, row: CheckSpec) -> float:
        """Return the number of tests of a check in a day."""
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
    alarms_per_day: float | None = None,
    kappa: float = KAPPA,
    pd: float = MIN_PD,
    bank_p_fa: float = 0.0,
    added: Sequence[CheckSpec] = (),
) -> dict[CheckName | str, AlarmShare]:
    """Return the share of each check in the false alarms of a level, by name of the check.

    Parameters
    ----------
    level, cadence
        Mitigation level, and the frequency of its tests.
    alarms_per_day
        False alarms a day of the whole level. With None, the checks whose probability can be chosen have
        `ALARMS_PER_DAY` together, and the other checks have their own probability.
    kappa
        Factor of the range check; used only without `alarms_per_day`.
    pd
        Probability that a test of E6 power passes without an attack, as a mean over the tests; used only without
        `alarms_per_day`.
    bank_p_fa
        Probability that noise exceeds the detection threshold in any correlator of the bank.
    added
        Optional checks that are turned on, and checks that a user wrote.

    Raises
    ------
    VestigeError
        If `alarms_per_day` does not exceed the false alarms a day from noise in the correlators, from OSNMA agreement
        and from the clock limit.

    Examples
    --------
    >>> shares = false_alarm_budget(1, Cadence(satellites=8), alarms_per_day=1.0)
    >>> f"{shares['E6 power'].p_fa:.2g}, {sum(share.alarms_a_day for share in shares.values()):.3g} a day"
    '2.2e-05, 1 a day'
    """
    assumed = DetectionAssumptions(kappa=kappa, pd=pd, bank_p_fa=bank_p_fa)
    if alarms_per_day is None:
        share = ALARMS_PER_DAY / max(sum(row.own_p_fa is None for row in LEVELS[level]), 1)
        found = {row.name: _with_own(row, share / cadence.tests_a_day(row), assumed) for row in LEVELS[level]}
    else:
        share = _set_share(LEVELS[level], cadence, alarms_per_day, assumed)
        found = {row.name: _set(row, share / cadence.tests_a_day(row), assumed) for row in LEVELS[level]}
    found |= {row.name: _with_own(row, 0.0, assumed) for row in added}
    rows = (*LEVELS[level], *added)
    return {
        row.name: replace(one, alarms_a_day=one.confirmed_p_fa * cadence.tests_a_day(row))
        for row, one in zip(rows, found.values(), strict=True)
    }


def _set_share(
    rows: Sequence[CheckSpec], cadence: Cadence, alarms_per_day: float, assumed: DetectionAssumptions
) -> float:
    """Return the equal share of each settable check in `alarms_per_day`, after the fixed alarms are subtracted."""
    fixed = sum(_fixed_p_fa(row, assumed) * cadence.tests_a_day(row) for row in rows)
    if alarms_per_day <= fixed:
        raise VestigeError(
            f"alarms_per_day: found {alarms_per_day:g}, expected more than {fixed:.2g}, which noise in the correlators "
            "brings with so many satellites and RECS; set more alarms a day, or a smaller p_fa of a correlator"
        )
    return (alarms_per_day - fixed) / sum(row.settable for row in rows)


def _fixed_p_fa(row: CheckSpec, assumed: DetectionAssumptions) -> float:
    """Return the part of a check's false-alarm probability that does not depend on `alarms_per_day`."""
    fixed = row.fixed_p_fa if row.settable else row.own_p_fa
    return 0.0 if fixed is None else fixed(assumed)


def _set(row: CheckSpec, p_fa: float, assumed: DetectionAssumptions) -> AlarmShare:
    """Return the share of a check if the alarms a day are set; `p_fa` is the probability P of one test."""
    if not row.settable:
        return _with_own(row, p_fa, assumed)
    p_fa = min(p_fa, _LARGEST_P_FA)
    if row.confirm > 1 and row.own_p_fa is not None:
        own = row.own_p_fa(assumed)
        confirm = max(1, ceil(log(p_fa) / log(own)))
        return AlarmShare(p_fa=own, confirm=confirm, alarms_a_day=nan, chosen=False)
    fixed = _fixed_p_fa(row, assumed)
    return AlarmShare(p_fa=p_fa + fixed, confirm=row.confirm, alarms_a_day=nan, chosen=True, exact=row.exact)


def _with_own(row: CheckSpec, p_fa: float, assumed: DetectionAssumptions) -> AlarmShare:
    """Return the share of a check with its own false-alarm probability, or with `p_fa` if the check has none."""
    return AlarmShare(
        p_fa=p_fa if row.own_p_fa is None else row.own_p_fa(assumed),
        confirm=row.confirm,
        alarms_a_day=nan,
        chosen=row.own_p_fa is None,
        exact=row.exact,
    )


def set_kappa(share: AlarmShare, bank_p_fa: float) -> float:
    """Return κ of the range check, √2 erfc⁻¹(P), from the share of this check in the false alarms of a level.

    `bank_p_fa` is the probability that noise exceeds the detection threshold in any correlator of the bank. P is the
    false-alarm probability of the share without `bank_p_fa`.
    """
    return sqrt(2) * float(erfcinv(share.p_fa - bank_p_fa))


def budget_of(processor: AcasProcessor, block: VerdictBlock) -> dict[CheckName | str, AlarmShare]:
    """Return the share of each check in the false alarms of a processor's level, by name of the check.

    The miss rate of E6 power follows from the C/N0 on E1 in the block, averaged over the configured fading.
    """
    return false_alarm_budget(
        processor.level,
        processor.monitoring.cadence,
        alarms_per_day=processor.monitoring.alarms_per_day,
        kappa=processor.kappa,
        pd=1 - expected_miss_rate(processor.miss_prediction, block.measured),
        bank_p_fa=processor.bank_p_fa,
        added=processor.added_checks,
    )
