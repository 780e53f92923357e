from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.crypto.osnma.disclosure import ReceptionProof, provably_before_disclosure
from vestige.errors import VestigeError
from vestige.time import GalileoTime

DISCLOSED_AT = GalileoTime(1400, 7222)


@pytest.mark.parametrize(
    ("lead_s", "uncertainty_s", "provable"),
    [
        (5.9, 0.0, True), (5.9, 5.8, True), (5.9, 6.0, False),
        (0.0, 0.0, False),  # the last sample ends with the first bit of the key
        (-1.0, 0.0, False), (1e9, math.inf, False), (math.nan, 0.0, False),
    ],
)  # fmt: skip
def test_the_lead_must_be_longer_than_the_clock_may_be_wrong(
    lead_s: float, uncertainty_s: float, provable: bool
) -> None:
    assert provably_before_disclosure(lead_s, uncertainty_s) is provable
    assert provably_before_disclosure(np.array([lead_s, lead_s]), uncertainty_s).tolist() == [provable, provable]


@pytest.mark.parametrize("uncertainty_s", [-1e9, -1e-9, math.nan])
def test_a_bound_is_not_negative(uncertainty_s: float) -> None:
    """A clock that is wrong by less than nothing made samples of an hour after the disclosure early enough."""
    with pytest.raises(VestigeError, match=r"time uncertainty: found .* expected 0 s or more"):
        provably_before_disclosure(-3600.0, uncertainty_s)
    with pytest.raises(VestigeError, match="time uncertainty"):
        provably_before_disclosure(np.array([-3600.0]), uncertainty_s)


@given(st.floats(-30, 30), st.floats(0, 20), st.floats(0, 5))
def test_a_proof_counts_to_the_last_chip_on_the_clock_of_the_bound(
    start_s: float, uncertainty_s: float, behind_s: float
) -> None:
    proof = ReceptionProof(
        disclosed_at=DISCLOSED_AT, duration_s=0.016, time_uncertainty_s=uncertainty_s, labels_behind_s=behind_s
    )
    lead_s = -start_s - 0.016 - behind_s
    if abs(lead_s - uncertainty_s) > 1e-9:  # beyond rounding
        assert proof.holds(DISCLOSED_AT + start_s) is (lead_s > uncertainty_s)
