"""What came of an attack at one mitigation level, run by run: detected, mitigated, missed, denied.

Theory of operation
-------------------
A run is one campaign with one attack; *attacked* are its epochs from the attack's start to its stop. With every verdict
AUTHENTIC the user takes over the range of E1, and with it the largest error that the attack made since the verdict
before, which the truth says. An error is *harmful* beyond twice what the range test allows, 2κσ: smaller ones may pass
because the noise of E6 makes up for them. Of a run is said, and more than one may be true,

    detected     an alarm (SUSPECT, SPOOFED, NOT_DETECTED) while the attack acts
    missed       a harmful error was accepted at any time
    mitigated    none was in the last quarter of the attack: the true signal is used, or an alarm stands
    denied       more than half of the attack's epochs have no verdict (NOT_AVAILABLE)

A statement about an attack is made of many runs with other seeds, and holds if the exact interval of its probability
lies above one half. Where the interval holds one half, nothing is said. An expectation is such a statement:

    pass         alarms without an attack are not more frequent than the range test's own, erfc(κ/√2)
    detect       detected
    mitigate     mitigated
    miss         missed, and not detected
    deny         denied, and not missed
    partial      detected, and not: the interval holds one half

All functions are pure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from math import erfc, isfinite, nan, sqrt
from statistics import median

import numpy as np
from jaxtyping import Bool

from vestige.acas_processor.mitigation import ALARMS
from vestige.campaign.outcomes import position
from vestige.campaign.statistics import Proportion, proportion
from vestige.records import Status

DAY_S = 86_400.0
_HALF = 0.5
_LAST = 0.25  # of the attack's epochs: how it ends
_HARMFUL = 2.0  # times κσ


class Agreement(Enum):
    """How a measurement compares with an expectation."""

    AGREES = "as expected"
    DIFFERS = "DIFFERS"
    UNDECIDED = "undecided"
    NOT_EXPECTED = ""  # nothing was


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOutcome:
    """What came of one run.

    Attributes
    ----------
    epochs, alarms
        Epochs that count, and alarms in them: those of the attack, or all if there is none.
    detected, mitigated, missed, denied
        See the top of this module; without an attack only `detected` can be true, by chance.
    time_to_detect_s
        From the first attacked epoch to the first alarm; NaN if there is none.
    worst_accepted_m
        Error of largest magnitude that was accepted; NaN if nothing was.
    """

    epochs: int
    alarms: int
    detected: bool
    mitigated: bool
    missed: bool
    denied: bool
    time_to_detect_s: float
    worst_accepted_m: float


def run_outcome(results: Mapping[str, np.ndarray], attacked: Bool[np.ndarray, " n"], limit_m: float) -> RunOutcome:
    """Return what came of one run.

    Parameters
    ----------
    results
        Columns of a campaign with one satellite: `time_s`, `status`, and under attack `truth_e1_worst_error_m`.
    attacked
        Which epochs count.
    limit_m
        What the range test allows, κσ.
    """
    time_s, status = results["time_s"][attacked], results["status"][attacked, 0]
    alarm = np.isin(status, [position(one) for one in ALARMS])
    accepted = status == position(Status.AUTHENTIC)
    error_m = results["truth_e1_worst_error_m"][attacked, 0] if "truth_e1_worst_error_m" in results else 0.0 * time_s
    harmful = accepted & (np.abs(error_m) > _HARMFUL * limit_m)
    accepted_m = error_m[accepted]
    last = max(1, round(_LAST * time_s.size))
    return RunOutcome(
        epochs=int(time_s.size),
        alarms=int(np.count_nonzero(alarm)),
        detected=bool(alarm.any()),
        mitigated=not harmful[-last:].any(),
        missed=bool(harmful.any()),
        denied=bool(np.mean(status == position(Status.NOT_AVAILABLE)) > _HALF) if time_s.size else False,
        time_to_detect_s=float(time_s[np.argmax(alarm)] - time_s[0]) if alarm.any() else nan,
        worst_accepted_m=float(accepted_m[np.argmax(np.abs(accepted_m))]) if accepted_m.size else nan,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneOutcome:
    """What came of an attack in many runs.

    Attributes
    ----------
    detected, mitigated, missed, denied
        Runs of which it is true.
    by_chance
        Runs without the attack that have an alarm in the same epochs; none were made if the scene has no attack.
    alarms
        Epochs with an alarm.
    time_to_detect_s
        Median of the runs with an alarm; NaN without any.
    worst_accepted_m
        Of all runs.
    interval_s
        Between RECS.
    kappa
        Factor of the range test.
    """

    detected: Proportion
    mitigated: Proportion
    missed: Proportion
    denied: Proportion
    by_chance: Proportion
    alarms: Proportion
    time_to_detect_s: float
    worst_accepted_m: float
    interval_s: float
    kappa: float

    @property
    def alarms_a_day(self) -> tuple[float, float, float]:
        """Alarms in a day, and the ends of the interval."""
        a_day = DAY_S / self.interval_s
        return self.alarms.value * a_day, self.alarms.low * a_day, self.alarms.high * a_day


def scene_outcome(
    runs: Sequence[RunOutcome], chance: Sequence[RunOutcome], *, interval_s: float, kappa: float
) -> SceneOutcome:
    """Return what came of the runs of a scene, and of those without its attack."""
    n = len(runs)
    times_s = [run.time_to_detect_s for run in runs if isfinite(run.time_to_detect_s)]
    errors_m = [run.worst_accepted_m for run in runs if isfinite(run.worst_accepted_m)]
    return SceneOutcome(
        detected=proportion(sum(run.detected for run in runs), n),
        mitigated=proportion(sum(run.mitigated for run in runs), n),
        missed=proportion(sum(run.missed for run in runs), n),
        denied=proportion(sum(run.denied for run in runs), n),
        by_chance=proportion(sum(run.detected for run in chance), len(chance)),
        alarms=proportion(sum(run.alarms for run in runs), sum(run.epochs for run in runs)),
        time_to_detect_s=median(times_s) if times_s else nan,
        worst_accepted_m=max(errors_m, key=abs, default=nan),
        interval_s=interval_s,
        kappa=kappa,
    )


def agreement(expected: str, found: SceneOutcome) -> Agreement:
    """Return how a measurement compares with an expected outcome; an empty one is none.

    Raises
    ------
    ValueError
        If there is no such outcome.
    """
    if not expected:
        return Agreement.NOT_EXPECTED
    often, seldom = _often, _seldom
    rules = {
        "pass": (found.alarms.low <= erfc(found.kappa / sqrt(2)), found.alarms.low > erfc(found.kappa / sqrt(2))),
        "detect": (often(found.detected), seldom(found.detected)),
        "mitigate": (often(found.mitigated), seldom(found.mitigated)),
        "miss": (often(found.missed) and seldom(found.detected), seldom(found.missed) or often(found.detected)),
        "deny": (often(found.denied) and seldom(found.missed), seldom(found.denied) or often(found.missed)),
        "partial": (
            not often(found.detected) and not seldom(found.detected),
            often(found.detected) or seldom(found.detected),
        ),
    }
    if expected not in rules:
        raise ValueError(f"outcome {expected!r}: {', '.join(rules)}")
    holds, fails = rules[expected]
    return Agreement.AGREES if holds else Agreement.DIFFERS if fails else Agreement.UNDECIDED


def _often(found: Proportion) -> bool:
    return found.low > _HALF


def _seldom(found: Proportion) -> bool:
    return found.high < _HALF
