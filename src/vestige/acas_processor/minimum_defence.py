"""The minimum defence, steps 1 and 2 of every mitigation level [WFO, Sec. IV-A].

1. Significant E6 correlation power at the offset that E1 predicts, against the post-correlation noise of a code that is
   not in the signal, so that pushing up the power does not help an attacker.
2. The range difference between E1 and E6 within |offset| ≤ κσ [TAES2023, Eq. 21-24].

A missing E6 signal is an alarm, unless the C/N0 on E1 says that it would often be missed anyway: then nothing follows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from vestige.acas_processor.checks.e1_e6_range import KAPPA
from vestige.acas_processor.checks.e6_power import MIN_PD
from vestige.acas_processor.error_budget import ErrorBudget
from vestige.records.checks import CheckName


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What the checks compare with.

    Attributes
    ----------
    budget, kappa
        Error budget of the range difference, and its factor κ.
    min_pd
        Smallest predicted probability of detection with which a missing signal means anything.
    """

    budget: ErrorBudget
    kappa: float = KAPPA
    min_pd: float = MIN_PD


def minimum_block(
    detected: Bool[np.ndarray, "*n"],
    range_offset_m: Float[np.ndarray, "*n"],
    predicted_pd: Float[np.ndarray, "*n"],
    limits: Limits,
) -> tuple[dict[CheckName, Bool[np.ndarray, "*n"]], Bool[np.ndarray, "*n"]]:
    """Return which of the checks of step 1 and 2 failed in a block of epochs, and where they were run.

    Parameters
    ----------
    detected
        Whether the encrypted signal was found.
    range_offset_m
        Measured minus predicted range in m; not looked at where nothing was detected.
    predicted_pd
        Probability of detection that E1 predicts; NaN if it is not known or nothing was correlated.
    limits
        Thresholds of the checks.
    """
    missing = ~detected & (predicted_pd >= limits.min_pd)
    far = detected & (np.abs(range_offset_m) > limits.kappa * limits.budget.sigma_m)
    return {CheckName.E6_POWER: missing, CheckName.E1_E6_RANGE: far}, detected | missing
