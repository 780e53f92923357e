"""The limits of steps 1 and 2 exactly where they are, of one satellite and of a block of epochs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vestige.acas_processor.error_budget import ErrorBudget
from vestige.acas_processor.minimum_defence import Limits, check_e6_power, check_range, minimum_block
from vestige.measurement import Detection, SatelliteMeasurement
from vestige.records import CorrelatorBank, Outcome

LIMITS = Limits(budget=ErrorBudget.uncorrected(), kappa=3.0, min_pd=0.9)
LIMIT_M = 3.0 * LIMITS.budget.sigma_m
BANK = CorrelatorBank(offsets_m=np.zeros(1), taps=np.zeros(1, np.complex128), noise_power=1.0, integration_s=0.016)
NOTHING = SatelliteMeasurement(svid=7, bank=BANK, predicted_pd=0.9)


def _block(*, detected: bool, offset_m: float = 0.0, pd: float = 1.0) -> tuple[bool, bool, bool]:
    failed, run = minimum_block(np.array([detected]), np.array([offset_m]), np.array([pd]), LIMITS)
    return bool(failed["E6 power"][0]), bool(failed["E1-E6 range"][0]), bool(run[0])


@pytest.mark.parametrize(
    ("pd", "outcome"),
    [
        (0.9, Outcome.FAIL),
        (np.nextafter(0.9, 0), Outcome.NOT_RUN),
        (1.0, Outcome.FAIL),
        (np.nan, Outcome.NOT_RUN),
    ],
)
def test_a_missing_signal_means_something_from_min_pd_on(pd: float, outcome: Outcome) -> None:
    assert check_e6_power(replace(NOTHING, predicted_pd=pd), LIMITS).outcome is outcome
    fails = outcome is Outcome.FAIL
    assert _block(detected=False, pd=pd) == (fails, False, fails)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("of_limit", "passes"), [(1.0, True), (1.0 + 1e-12, False), (0.0, True)])
def test_the_range_limit_itself_passes(sign: float, of_limit: float, passes: bool) -> None:
    offset_m = sign * of_limit * LIMIT_M
    found = Detection(tap=5, magnitude=9.0, phase_rad=0.0, threshold=5.7, range_offset_m=offset_m)
    check = check_range(replace(NOTHING, detection=found), LIMITS)
    assert check.outcome is (Outcome.PASS if passes else Outcome.FAIL)
    assert _block(detected=True, offset_m=offset_m) == (False, not passes, True)
