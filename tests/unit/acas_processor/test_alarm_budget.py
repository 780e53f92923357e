from __future__ import annotations

import pytest

from vestige.acas_processor.levels import LEVELS
from vestige.acas_processor.monitoring.alarm_budget import Cadence, false_alarm_budget

EIGHT = Cadence(satellites=8)


@pytest.mark.parametrize("level", sorted(LEVELS))
def test_chosen_shares_add_up_to_the_budget(level: int) -> None:
    shares = false_alarm_budget(level, EIGHT, alarms_a_day=2.0)
    assert list(shares) == [row.name for row in LEVELS[level]]
    chosen = [share.alarms_a_day for share in shares.values() if share.chosen]
    assert sum(chosen) == pytest.approx(2.0 if level > 1 else 0.0)
    assert max(chosen, default=0.0) == pytest.approx(min(chosen, default=0.0))


def test_a_share_is_spread_over_the_tests_of_a_day() -> None:
    """Eight satellites: 8 × 86,400 C/N0s, 8 × 2880 hand-over searches, and the receiver's clock 86,400 times a day."""
    shares = false_alarm_budget(2, EIGHT)
    share = 1 / 12  # of twelve checks: fourteen of the level without the two of level 1
    assert shares["C/N0"].p_fa == pytest.approx(share / 691_200)
    assert shares["E1 vestigial search"].p_fa == pytest.approx(share / 23_040)
    assert shares["clock slope"].p_fa == pytest.approx(share / 86_400)


def test_checks_with_a_budget_of_their_own_are_bounds() -> None:
    """3 σ: 0.27 %; power–distortion three times in a row: 0.006³ of 691,200."""
    shares = false_alarm_budget(3, EIGHT)
    assert shares["E1-E6 range"].p_fa == pytest.approx(0.0026998, rel=1e-4)
    assert not shares["E1-E6 range"].chosen
    assert shares["power-distortion"].alarms_a_day == pytest.approx(0.149, abs=1e-3)
