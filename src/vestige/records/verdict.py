"""Define the answer of the processor: the outcome of each check, the status of a satellite, and the verdict."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from vestige.time import GalileoTime


class Outcome(Enum):
    """Result of one check.

    Attributes
    ----------
    PASS
        The magnitude of the statistic does not exceed the threshold.
    FAIL
        The magnitude of the statistic exceeds the threshold. If the check needs confirmation, only several failed tests
        in a row change the status of the satellite.
    NOT_RUN
        The check was not made, for example because an input is missing. `CheckResult.reason` gives the reason.

    Examples
    --------
    >>> import vestige as vs
    >>> vs.Outcome("not run") is vs.Outcome.NOT_RUN
    True
    """

    PASS = "pass"  # noqa: S105  (not a password)
    FAIL = "fail"
    NOT_RUN = "not run"


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckResult:
    """Result of a check: the statistic, the threshold, and the reason why the check failed or was not run."""

    name: str
    outcome: Outcome
    statistic: float = float("nan")
    threshold: float = float("nan")
    unit: str = ""
    reason: str = ""


class Status(Enum):
    """Conclusion of the receiver about a satellite.

    Columns of stored results contain the index of a status in the order of this class. The order of gravity is
    different. The order from the gravest to the least grave status is SPOOFED, NOT_DETECTED, SUSPECT, AUTHENTIC,
    NOT_AVAILABLE. SPOOFED, NOT_DETECTED and SUSPECT are alarms.

    Attributes
    ----------
    AUTHENTIC
        The encrypted signal was found in E6 at the range that E1 predicts, and no check failed.
    SUSPECT
        A check failed that alone does not prove an attack, or a search found another satellite twice.
    SPOOFED
        The range of E6 disagrees with E1, the satellite was found twice, or OSNMA differs from the second channel. A
        delay between the front ends that is not calibrated can also lead to SPOOFED.
    NOT_DETECTED
        The encrypted signal was not found in E6, although the C/N0 of E1 predicts a detection.
    NOT_AVAILABLE
        No conclusion is possible, for example because the RECS, its key, samples or E1 are missing, or because the
        signal is too weak.

    Examples
    --------
    >>> import vestige as vs
    >>> [status.name for status in vs.Status]
    ['AUTHENTIC', 'SUSPECT', 'SPOOFED', 'NOT_DETECTED', 'NOT_AVAILABLE']
    """

    AUTHENTIC = "authentic"
    SUSPECT = "suspect"
    SPOOFED = "spoofed"
    NOT_DETECTED = "not detected"
    NOT_AVAILABLE = "not available"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """The answer of the processor for one satellite and one snapshot, with the results of all checks.

    Attributes
    ----------
    index
        Running number of the epoch in its source, from 0. Epochs of E1 tracking between two RECS also have numbers.
    time
        Receiver-clock time of the E1 observations; in an epoch with RECS, the time of reception of the RECS. If the
        message on E1 or the RECS in the samples gives the error of the time tag, `vestige process` and `vestige live`
        write the time without this error.
    available_at
        Time at which the whole key has been on air, so that a receiver can know the verdict; None if the verdict was
        made without a key.
    svid
        SVID of the satellite, 1 to 36.
    level
        Mitigation level, 1 to 3.
    status
        Conclusion of the receiver about the satellite.
    checks
        Checks of the level that the settings allow, and optional and own checks, with statistic, threshold and outcome.
    range_offset_m
        Measured minus predicted E6 range in m; NaN if nothing was detected.
    reason
        Reason for the status in one line of text. If the status is AUTHENTIC, the reason names the checks that could
        not be run.
    true_offset_m
        Range of the earliest signal minus the E1 range in m, if a search found several signals, or if the E6
        correlators have a signal that is earlier than E1 predicts by more than the limit of the range check. NaN in all
        other cases. The value is also NaN if no search can decide which signal is true, or if the range is impossible.

    Examples
    --------
    >>> import vestige as vs
    >>> source = vs.simulate(vs.load_scenario("scenarios/quick.toml", ["epochs=1", "receiver.cn0_dbhz=45"]))
    >>> verdict = next(vs.AcasProcessor().run(source))
    >>> verdict.svid, verdict.status.name, abs(verdict.range_offset_m) < 15
    (11, 'AUTHENTIC', True)
    >>> [check.name for check in verdict.checks if check.outcome is vs.Outcome.FAIL]
    []
    """

    index: int
    time: GalileoTime
    available_at: GalileoTime | None
    svid: int
    level: int
    status: Status
    checks: tuple[CheckResult, ...]
    range_offset_m: float
    reason: str
    true_offset_m: float = math.nan
