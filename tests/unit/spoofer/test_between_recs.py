from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vestige.records import Band
from vestige.spoofer.between_recs import BetweenRecs
from vestige.spoofer.phase import Slipping

ATTACK = BetweenRecs(top_m=80.0, power_db=3.0, period_s=30.0, first_recs_s=12.0, guard_s=2.0)


def test_nothing_at_a_recs_and_the_top_between_two() -> None:
    t_s = np.array([12.0, 14.0, 27.0, 40.0, 42.0, 57.0])
    spoofing_signal = ATTACK.spoofing_signal(Band.E6, t_s)
    assert spoofing_signal is not None
    assert np.isfinite(spoofing_signal.power_db).tolist() == [False, False, True, False, False, True]
    assert spoofing_signal.delay_m == pytest.approx([0.0, 0.0, 80.0, 0.0, 0.0, 80.0], abs=1e-9)


def test_rate_is_the_derivative() -> None:
    t_s = np.arange(15.0, 39.0, 1e-3)
    spoofing_signal = ATTACK.spoofing_signal(Band.E1, t_s)
    assert spoofing_signal is not None
    middle = (spoofing_signal.delay_rate_mps[1:] + spoofing_signal.delay_rate_mps[:-1]) / 2
    assert np.max(np.abs(np.diff(spoofing_signal.delay_m) / 1e-3 - middle)) < 1e-5


def test_a_slip_counts_from_the_start_of_the_attack() -> None:
    """0.025 Hz: a quarter of a turn 10 s after the start."""
    spoofing_signal = replace(ATTACK, phase=Slipping(slip_hz=0.025), start_s=15.0).spoofing_signal(
        Band.E1, np.array([25.0])
    )
    assert spoofing_signal is not None
    assert spoofing_signal.phase_rad == pytest.approx([np.pi / 2])
